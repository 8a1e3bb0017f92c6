"""Compile the online path where Numba is installed; run it as plain Python elsewhere.

Both give the same numbers: what is compiled uses floats, small arrays and `math` only.
Set GAITCHAIN_PLAIN=1 to keep Numba out.
"""

import os
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def _find_compiler() -> Callable[[Any], Any] | None:
    if os.environ.get("GAITCHAIN_PLAIN"):
        return None
    try:
        from numba import njit  # noqa: PLC0415 - heavy, and optional
    except ImportError:
        return None
    compiler: Callable[[Any], Any] = njit(cache=True)
    return compiler


_compiler = _find_compiler()

COMPILED = _compiler is not None
"""Whether the online path is machine code."""


def compiled(function: F) -> F:
    """Compile a function of floats, small arrays and named tuples of them."""
    if _compiler is None:
        return function
    result: F = _compiler(function)
    return result
