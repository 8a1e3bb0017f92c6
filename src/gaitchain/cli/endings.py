"""What ends a verb from outside: Ctrl-C, a closed terminal, a plain kill."""

import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from gaitchain.errors import GaitchainError
from gaitchain.service.ends import known_ends

_Handler = Callable[[int, Any], Any]


class _End:
    """A handler that interrupts a verb."""

    def __init__(self, *, once: bool) -> None:
        self._once, self.asked = once, False

    @property
    def ignores(self) -> bool:
        """Whether what comes from now on is ignored."""
        return self._once and self.asked

    def __call__(self, number: int, frame: Any) -> None:
        ignored, self.asked = self.ignores, True
        # Not by SIG_IGN: Python complains of a signal that came just before that.
        if not ignored:
            signal.default_int_handler(number, frame)


@contextmanager
def ended_as_by_hand(*, once: bool) -> Iterator[None]:
    """Let a closed terminal and a plain kill end a verb as Ctrl-C does.

    A verb that they end at once leaves its worker processes behind, which nobody ends,
    or the torque of servos on. What was to be ignored, as under nohup, stays so.

    Args:
        once: whether what comes after the first one is ignored, as it would interrupt a
            verb that lets go of servos. It stays ignored afterwards, until
            `handlers_restored` or `ignore_later_ends`.
    """
    usual, end = (signal.SIG_DFL, signal.default_int_handler), _End(once=once)
    before = {n: h for n, h in _handlers().items() if h in usual}
    _handle(dict.fromkeys(before, end))
    try:
        yield
    except GaitchainError:
        raise
    except Exception as error:
        # A compiler loses an interrupt in its callback, and misses what that makes.
        if end.asked:
            raise KeyboardInterrupt from error
        raise
    finally:
        if not end.ignores:
            _handle(before)


@contextmanager
def handlers_restored() -> Iterator[None]:
    """Undo what `ended_as_by_hand` left, for a process that goes on after a verb."""
    before = _handlers()
    try:
        yield
    finally:
        _handle({n: before[n] for n in _that_ignore()})


def ignore_later_ends() -> None:
    """Ignore what an ended verb ignores until the process is gone.

    Python lets go of handlers of its own before that, and who presses Ctrl-C again and
    again would end it by the signal.
    """
    _handle(dict.fromkeys(_that_ignore(), signal.SIG_IGN))


@contextmanager
def interrupts_kept(interrupted: threading.Event) -> Iterator[None]:
    """Record an interrupt, since its exception is lost in destructors and callbacks.

    Args:
        interrupted: set by each signal that ends the verb with KeyboardInterrupt.
    """
    # A script that runs a verb in the background lets it ignore SIGINT, which whoever
    # sends it later does not mean.
    known = _handlers()
    before = {n: h for n, h in known.items() if callable(h) or n == signal.SIGINT}

    def note(number: int, frame: Any) -> None:
        interrupted.set()
        own: _Handler = before[number]
        (own if callable(own) else signal.default_int_handler)(number, frame)

    _handle(dict.fromkeys(before, note))
    try:
        yield
    finally:
        # What is ignored since then stays so.
        _handle({n: h for n, h in before.items() if signal.getsignal(n) is note})


def _that_ignore() -> list[int]:
    """Return the signals whose handler a verb has left to ignore them."""
    known = _handlers().items()
    return [n for n, h in known if isinstance(h, _End) and h.ignores]


def _handle(handlers: Mapping[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _handlers() -> dict[int, Any]:
    """Return the handler of each signal; none where only the main thread may set it."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {number: signal.getsignal(number) for number in known_ends()}
