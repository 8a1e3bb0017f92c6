"""`gaitchain export --to c`: a library as C99, for computers without Python."""

from pathlib import Path
from typing import Any

from gaitchain.cli.console import print_table, say
from gaitchain.cli.files import check_files, make_folder
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Export
from gaitchain.errors import CommandError, file_errors
from gaitchain.export.c_library import CODE, DEMO, HEADER, export_c
from gaitchain.export.c_trial import Trial, try_c
from gaitchain.export.compiler import find_compiler


def write_c(options: Export) -> tuple[int, dict[str, Any]]:
    """Write the files; try them where there is a compiler."""
    written = export_c(read_library(options.library))
    own = Path("runs/export") / f"{Path(options.library).stem}_c"
    folder = make_folder(options.output or own)
    named = options.report.json, Path(options.library)
    check_files((folder / name for name in written), named)
    for name, text in written.items():
        with file_errors(folder / name, "written", CommandError):
            (folder / name).write_text(text, "utf-8")
    said = {HEADER: "what a program includes", CODE: "tables and walker"}
    for name in written:
        say(f"{folder / name}: {said.get(name, 'tries them on the computer at hand')}")
    results: dict[str, Any] = {"files": [str(folder / name) for name in written]}
    if options.no_try:
        return 0, results
    if find_compiler() is None:
        say(f"not tried: no C compiler here; {_how(folder)}")
        return 0, results
    trial = try_c(folder)
    _show(trial)
    return 0, {**results, **trial._asdict()}


def _how(folder: Path) -> str:
    return f"cd {folder} && cc -std=c99 -O2 {CODE} {DEMO} -lm -o demo && ./demo"


def _show(trial: Trial) -> None:
    rows = [
        ("one control period", f"{trial.period_us:.1f}", "us, mean"),
        ("one that chooses a step", f"{trial.deciding_us:.1f}", "us, mean"),
        ("the longest one", f"{trial.longest_us:.0f}", "us"),
        ("code and tables", f"{trial.code_bytes / 1024:.1f}", "KiB, constant"),
        ("state of a robot", f"{trial.state_bytes / 1024:.1f}", "KiB"),
        ("its sensors and targets", f"{trial.message_bytes / 1024:.1f}", "KiB"),
    ]
    print_table("On this computer, compiled with -O2", ("", "", ""), rows, (0, 2))
