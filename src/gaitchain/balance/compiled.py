"""Compile the control step with Numba; GAITCHAIN_PLAIN=1 runs it as plain Python.

Both give the same numbers: compiled functions use floats, small arrays and `math` only.
Plain Python is for tests and debuggers; it takes some forty times as long.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from gaitchain.balance.code_cache import find_folder, unkept
from gaitchain.errors import GaitchainError

F = TypeVar("F", bound=Callable[..., Any])


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


_numba = _find_numba()
_folder = find_folder() if _numba else None

COMPILED = _numba is not None
"""Whether the control step is machine code."""
_functions: list[Any] = []
_lost: list[str] = []


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
    """Return the folder of the machine code; None where none is kept.

    It is named after the sources, so another version of them has another folder.
    """
    return _folder


def cache_trouble() -> str:
    """Return why machine code is compiled again by the next process, if it is."""
    if COMPILED and _folder is None:
        return unkept()
    if not _lost:
        return ""
    return (
        f"{_folder}: machine code cannot be kept: {_lost[-1]}; it takes some 12 "
        "MiB: make room, or set XDG_CACHE_HOME to another folder"
    )


def compiled(function: F) -> F:
    """Compile a function of floats, small arrays and named tuples of them."""
    if _numba is None:
        return function
    result: F = _numba.njit(function)
    if _folder is not None:
        _keep(result, function)
    _functions.append(result)
    return result


def _keep(dispatcher: Any, function: Callable[..., Any]) -> None:
    """Let a compiled function be kept in the folder, as `njit(cache=True)` does."""
    before, _numba.config.CACHE_DIR = _numba.config.CACHE_DIR, str(_folder)
    try:
        dispatcher._cache = _forgiving_cache()(function)
    except RuntimeError as error:  # what is in the folder is another user's
        _lost.append(str(error))
    finally:
        _numba.config.CACHE_DIR = before


@cache
def _forgiving_cache() -> type[Any]:
    """Return Numba's cache of a function, for disks that are full or were cut off."""
    from numba.core.caching import FunctionCache  # noqa: PLC0415 - heavy, as above

    class Forgiving(FunctionCache):
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            try:
                return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            except Exception:  # a file that a power cut emptied may raise anything
                self._forget()
                return None

        def _forget(self) -> None:
            """Begin the function's files anew; else it would be read to be saved."""
            try:
                self.flush()  # type: ignore[no-untyped-call]
            except OSError as error:
                self.disable()  # type: ignore[no-untyped-call]
                _lost.append(error.strerror or str(error))

        def save_overload(self, sig: Any, data: Any) -> None:
            try:
                super().save_overload(sig, data)  # type: ignore[no-untyped-call]
            except OSError as error:
                _lost.append(error.strerror or str(error))

    return Forgiving


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
