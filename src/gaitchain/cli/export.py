"""`gaitchain export`: a library as code, or as motions that other projects read."""

from typing import Any

from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Export

_OF_C = ("no_try",)
_OF_MOTIONS = ("grid", "seconds", "own_model", "rate")


def run(options: Export) -> tuple[int, dict[str, Any]]:
    """Write a library in a format; the exit code is 1 if a motion fell."""
    if options.to == "c":
        refuse(options, _OF_MOTIONS, "of motions, which --to c does not walk")
        from gaitchain.cli.export_c import write_c  # noqa: PLC0415

        return write_c(options)
    refuse(options, _OF_C, f"of --to c, and no option of --to {options.to}")
    from gaitchain.cli.export_motions import write_motions  # noqa: PLC0415

    return write_motions(options)
