"""The C compiler of this computer, if it has one."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from gaitchain.errors import ExportError

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
"""Flags with which exported code compiles without a word."""
_COMPILERS = ("cc", "gcc", "clang")
_LONGEST_S = 300.0


def find_compiler() -> str | None:
    """Return the path of a compiler: that of the variable CC, or one of the usual."""
    wanted = os.environ.get("CC")
    names = (wanted,) if wanted else _COMPILERS
    return next(filter(None, map(shutil.which, names)), None)


def compile_c(
    sources: Sequence[Path], output: Path, *flags: str, libraries: Sequence[str] = ()
) -> None:
    """Compile C.

    Args:
        sources: files of C, or object files.
        output: what is to be written.
        flags: of the compiler.
        libraries: flags that follow the sources.

    Raises:
        ExportError: there is no compiler, or it refuses the code.
    """
    compiler = find_compiler()
    if compiler is None:
        raise ExportError(
            "no C compiler here: install one (Debian: apt install gcc libc6-dev), or "
            "name it in the variable CC"
        )
    words = [compiler, *flags, *map(str, sources), "-o", str(output), *libraries]
    done = run_program(words)
    if done.returncode:
        raise ExportError(f"{' '.join(words)}: {done.stderr.strip()[-2000:]}")


def run_program(words: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; keep what it writes.

    Raises:
        ExportError: it cannot be started, or takes more than five minutes.
    """
    try:
        return subprocess.run(
            words, capture_output=True, text=True, timeout=_LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ExportError(f"{words[0]}: {error}") from None
