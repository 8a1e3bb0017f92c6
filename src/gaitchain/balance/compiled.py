"""Compile the control step with Numba; GAITCHAIN_PLAIN=1 runs it as plain Python.

Both give the same numbers: compiled functions use floats, small arrays and `math` only.
Plain Python is for tests and debuggers; it takes some forty times as long.
"""

import hashlib
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from gaitchain.errors import GaitchainError

F = TypeVar("F", bound=Callable[..., Any])
_IMPORTED = re.compile(r"^from gaitchain\.([\w.]+) import", re.MULTILINE)


def _find_numba() -> Any:
    if os.environ.get("GAITCHAIN_PLAIN", "0") not in ("", "0"):
        return None
    try:
        import numba  # noqa: PLC0415 - heavy, and not loaded for plain Python
        import numba.extending  # noqa: PLC0415
    except ImportError as error:
        raise GaitchainError(
            f"Numba cannot be loaded ({error}); without it a control step takes 4 "
            "instead of 0.1 ms: pip install numba, or set GAITCHAIN_PLAIN=1 to run "
            "plain Python all the same"
        ) from error
    return numba


def source_files() -> list[Path]:
    """List the modules of this folder and those that they import names from.

    Machine code contains their constants and the layouts of their named tuples. Names
    are never passed on (mypy refuses it), so imports of imports do not matter.
    """
    here = Path(__file__).parent
    files = set(here.glob("*.py"))
    for file in sorted(files):
        for module in _IMPORTED.findall(file.read_text("utf-8")):
            path = here.parent.joinpath(*module.split("."))
            files.add(path.with_suffix(".py"))
    return sorted(file for file in files if file.is_file())


def _cache_folder() -> str:
    """Name a folder after the sources of all that is compiled.

    Numba checks the file of a function only, and would go on using an old copy of what
    it calls, or of the constants it reads, in other files.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in source_files():
        digest.update(file.read_bytes())
    name = f"numba-{digest.hexdigest()[:12]}"
    beside = here / "__pycache__"
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    if not os.access(beside if beside.is_dir() else here, os.W_OK):
        return str(home / "gaitchain" / name)
    for old in beside.glob("numba-*"):  # of sources that are no longer there
        if old.name != name:
            shutil.rmtree(old, ignore_errors=True)
    return str(beside / name)


_numba = _find_numba()
_folder = _cache_folder() if _numba else ""

COMPILED = _numba is not None
"""Whether the control step is machine code."""
_functions: list[Any] = []


class Compilation(NamedTuple):
    """How far this process is with the compiled functions it has imported."""

    functions: int
    """All of them; of those that another one calls, some are never made alone."""
    ready: int
    """Of these are machine code here."""
    made: int
    """Were compiled in this process; the others came from disk."""


def compilation() -> Compilation:
    """Count the compiled functions."""
    ready = sum(bool(function.signatures) for function in _functions)
    made = sum(bool(function.stats.cache_misses) for function in _functions)
    return Compilation(len(_functions), ready, made)


def cache_folder() -> Path | None:
    """Return the folder of the machine code; None where plain Python runs.

    It is named after the sources, so another version of them has another folder.
    """
    return Path(_folder) if COMPILED else None


def compiled(function: F) -> F:
    """Compile a function of floats, small arrays and named tuples of them."""
    if _numba is None:
        return function
    before, _numba.config.CACHE_DIR = _numba.config.CACHE_DIR, _folder
    try:
        result: F = _numba.njit(cache=True)(function)
    finally:
        _numba.config.CACHE_DIR = before
    _functions.append(result)
    return result


def compiled_as(function: Callable[..., Any]) -> Callable[[F], F]:
    """Decorate a maker of what compiled code calls in place of a plain function.

    The maker takes the Numba types of the arguments and returns a Python function of
    the same arguments, to be compiled (`numba.extending.overload`).
    """
    if _numba is None:
        return lambda maker: maker
    decorator: Callable[[F], F] = _numba.extending.overload(function)
    return decorator


@contextmanager
def telling_compilation(tell: Callable[[int], None]) -> Iterator[None]:
    """Tell of every function within that is compiled, not read from the cache.

    Args:
        tell: called with how many there were, when one begins.
    """
    if _numba is None:
        yield
        return
    from numba.core import event  # noqa: PLC0415 - heavy, as above

    class Counter(event.Listener):
        begun = 0

        def on_start(self, event: Any) -> None:
            self.begun += 1
            tell(self.begun)

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Counter()):
        yield
