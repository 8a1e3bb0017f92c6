"""The C compiler of this computer, if it has one."""

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from gaitchain.errors import ExportError

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
"""Flags with which exported code compiles without a word."""
_COMPILERS = ("cc", "gcc", "clang")
_LONGEST_S = 300.0


def find_compiler() -> list[str] | None:
    """Return a compiler and flags: those of the variable CC, or one of the usual.

    Raises:
        ExportError: CC names no program that is here.
    """
    wanted = _words(os.environ.get("CC", ""))
    if not wanted:
        found = next(filter(None, map(shutil.which, _COMPILERS)), None)
        return [found] if found else None
    program, *flags = wanted
    path = shutil.which(program)
    if path is None:
        raise ExportError(f"no program {program!r} here, which the variable CC names")
    return [path, *flags]


def _words(text: str) -> list[str]:
    """Split a variable as a shell does."""
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ExportError(f"the variable CC is {text!r}: {error}") from None


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
    words = [*compiler, *flags, *map(str, sources), "-o", str(output), *libraries]
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
