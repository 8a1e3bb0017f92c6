"""What ends a verb from outside: Ctrl-C, a closed terminal, a plain kill."""

import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from gaitchain.errors import GaitchainError
from gaitchain.service.ends import known_ends

_Handler = Callable[[int, Any], Any]


@contextmanager
def ended_as_by_hand(*, once: bool) -> Iterator[None]:
    """Let a closed terminal and a plain kill end a verb as Ctrl-C does.

    A verb that they end at once leaves its worker processes behind, which nobody ends,
    or the torque of servos on. What was to be ignored, as under nohup, stays so.

    Args:
        once: whether what comes after the first one is ignored, as it would interrupt a
            verb that lets go of servos.
    """
    usual, asked = (signal.SIG_DFL, signal.default_int_handler), threading.Event()

    def end(number: int, frame: Any) -> None:
        asked.set()
        if once:
            _handle(dict.fromkeys(before, signal.SIG_IGN))
        signal.default_int_handler(number, frame)

    before = {n: h for n, h in _handlers().items() if h in usual}
    _handle(dict.fromkeys(before, end))
    try:
        yield
    except GaitchainError:
        raise
    except Exception as error:
        # A compiler loses an interrupt in its callback, and misses what that makes.
        if asked.is_set():
            raise KeyboardInterrupt from error
        raise
    finally:
        _handle(before)


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


def _handle(handlers: Mapping[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _handlers() -> dict[int, Any]:
    """Return the handler of each signal; none where only the main thread may set it."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {number: signal.getsignal(number) for number in known_ends()}
