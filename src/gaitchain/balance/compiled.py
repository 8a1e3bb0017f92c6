"""Compile the online path by Numba; with GAITCHAIN_PLAIN=1 run it as plain Python.

Both give the same numbers: what is compiled uses floats, small arrays and `math` only.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def _find_numba() -> Any:
    if os.environ.get("GAITCHAIN_PLAIN"):
        return None
    import numba  # noqa: PLC0415 - heavy

    return numba


def _cache_folder() -> str:
    """Name a folder after the sources of all that is compiled.

    Numba looks at a function's own file only, and would go on using an old copy of
    what it calls in other files.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(here.glob("*.py")):
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
"""Whether the online path is machine code."""


def compiled(function: F) -> F:
    """Compile a function of floats, small arrays and named tuples of them."""
    if _numba is None:
        return function
    before, _numba.config.CACHE_DIR = _numba.config.CACHE_DIR, _folder
    try:
        result: F = _numba.njit(cache=True)(function)
    finally:
        _numba.config.CACHE_DIR = before
    return result
