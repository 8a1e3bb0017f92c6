"""Exported code, compiled and run on the computer at hand: its times and its memory."""

import re
import tempfile
from pathlib import Path
from typing import NamedTuple

from gaitchain.errors import ExportError, temporary_folder
from gaitchain.export.c_library import CODE, DEMO
from gaitchain.export.compiler import STRICT, compile_c, run_program


class Trial(NamedTuple):
    """What the program `demo.c` said of 60 s of walking, and how large the code is."""

    period_us: float
    """Mean of all control periods [us]."""
    deciding_us: float
    """Mean of those that choose a step [us]."""
    longest_us: float
    """The longest one, with all that the computer did meanwhile [us]."""
    state_bytes: int
    """Memory of one robot."""
    message_bytes: int
    """Memory of the sensors and targets of a period."""
    code_bytes: int
    """Code and tables: what lies in flash on a microcontroller."""


_SAID = re.compile(
    r"periods: \d+, (?P<period_us>\S+) us each, at most (?P<longest_us>\S+) us\n"
    r"periods that choose a step: \d+, (?P<deciding_us>\S+) us each\n"
    r"state: (?P<state_bytes>\d+) bytes, a period's sensors and targets: "
    r"(?P<message_bytes>\d+) bytes\n"
)


def try_c(folder: Path) -> Trial:
    """Compile and run exported code.

    Args:
        folder: where the files are; nothing is written there.

    Raises:
        ExportError: there is no compiler, or the code does not compile or run.
    """
    with tempfile.TemporaryDirectory(dir=temporary_folder(ExportError)) as work:
        code, demo = Path(work) / "gait.o", Path(work) / "demo"
        compile_c([folder / CODE], code, *STRICT, "-O2", "-c")
        compile_c(
            [code, folder / DEMO],
            demo,
            *STRICT,
            "-O2",
            f"-I{folder}",
            libraries=["-lm"],
        )
        done = run_program([str(demo)])
        said = _SAID.fullmatch(done.stdout)
        if done.returncode or said is None:
            raise ExportError(f"{folder / DEMO}: {done.stdout}{done.stderr}"[:500])
        return Trial(
            period_us=float(said["period_us"]),
            deciding_us=float(said["deciding_us"]),
            longest_us=float(said["longest_us"]),
            state_bytes=int(said["state_bytes"]),
            message_bytes=int(said["message_bytes"]),
            code_bytes=_loaded_bytes(code),
        )


def _loaded_bytes(code: Path) -> int:
    """Return the size of code and constants; that of the file without binutils."""
    try:
        done = run_program(["size", str(code)])
    except ExportError:
        return code.stat().st_size
    text, data = done.stdout.splitlines()[-1].split()[:2]
    return int(text) + int(data)
