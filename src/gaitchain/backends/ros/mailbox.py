"""A bounded queue with a thread that empties it: who puts something in never waits."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")
_log = logging.getLogger(__name__)
_DEPTH = 8
"""Letters in a row: at 100 Hz none is handled that is older than 80 ms."""


class Mailbox(Generic[T]):
    """Letters, in order, to a function that may take its time."""

    def __init__(self, handle: Callable[[T | None], bool], name: str) -> None:
        """Start the thread.

        Args:
            handle: called on the thread with a letter, or with None after `wake`; says
                whether that went well.
            name: of the thread.
        """
        self._handle = handle
        self._letters: deque[T] = deque()
        self._change = threading.Condition()
        self._woken = self._closed = False
        self.put_in = 0
        """Letters that were put in."""
        self.lost = 0
        """Of them, those that were dropped, or handled without success."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, letter: T) -> None:
        """Put a letter in; where the box is full the oldest goes."""
        with self._change:
            self.put_in += 1
            if self._closed:
                self.lost += 1
                return
            if len(self._letters) == _DEPTH:
                self._letters.popleft()
                self.lost += 1
            self._letters.append(letter)
            self._change.notify()

    def wake(self) -> None:
        """Have `handle` called even if the box is empty."""
        with self._change:
            self._woken = True
            self._change.notify()

    def close(self, timeout_s: float) -> None:
        """Let what is in the box be handled, then end.

        Args:
            timeout_s: how long to wait for that [s].
        """
        with self._change:
            self._closed = True
            self._change.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(
                    lambda: self._letters or self._woken or self._closed
                )
                letter = self._letters.popleft() if self._letters else None
                woken, self._woken = self._woken, False
            if letter is None and not woken:
                return
            if not self._went_well(letter) and letter is not None:
                with self._change:
                    self.lost += 1

    def _went_well(self, letter: T | None) -> bool:
        try:
            return self._handle(letter)
        except Exception:
            # One letter that cannot be handled must not end all that follow.
            _log.exception("%s: lost %s", self._thread.name, letter)
            return False
