"""`gaitchain export`: a library as code, or as motions that other projects read."""

from typing import Any

from gaitchain.cli.options import Export


def run(options: Export) -> tuple[int, dict[str, Any]]:
    """Write a library in a format; the exit code is 1 if a motion fell."""
    if options.to == "c":
        from gaitchain.cli.export_c import write_c  # noqa: PLC0415

        return write_c(options)
    from gaitchain.cli.export_motions import write_motions  # noqa: PLC0415

    return write_motions(options)
