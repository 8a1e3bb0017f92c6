"""A bounded queue with a thread that empties it, so that producers never block."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")
_log = logging.getLogger(__name__)
_DEPTH = 8
"""Capacity of the queue: at 100 Hz no message older than 80 ms is handled."""


class Mailbox(Generic[T]):
    """A queue of items that a thread passes, in order, to a function that may block."""

    def __init__(self, handle: Callable[[T | None], bool], name: str) -> None:
        """Start the thread.

        Args:
            handle: called on the thread with an item, or with None after `wake`;
                returns whether it succeeded.
            name: name of the thread.
        """
        self._handle = handle
        self._items: deque[T] = deque()
        self._change = threading.Condition()
        self._woken = self._closed = False
        self.put_in = 0
        """Number of items put in."""
        self.lost = 0
        """Number of these items that were dropped or not handled successfully."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, item: T) -> None:
        """Append an item; if the queue is full, drop the oldest."""
        with self._change:
            self.put_in += 1
            if self._closed:
                self.lost += 1
                return
            if len(self._items) == _DEPTH:
                self._items.popleft()
                self.lost += 1
            self._items.append(item)
            self._change.notify()

    def wake(self) -> None:
        """Call `handle` even if the queue is empty."""
        with self._change:
            self._woken = True
            self._change.notify()

    def close(self, timeout_s: float) -> None:
        """Accept no more items, and wait until the queued ones are handled.

        Args:
            timeout_s: longest time to wait [s].
        """
        with self._change:
            self._closed = True
            self._change.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(
                    lambda: self._items or self._woken or self._closed
                )
                item = self._items.popleft() if self._items else None
                woken, self._woken = self._woken, False
            if item is None and not woken:
                return
            if not self._succeeded(item) and item is not None:
                with self._change:
                    self.lost += 1

    def _succeeded(self, item: T | None) -> bool:
        try:
            return self._handle(item)
        except Exception:
            # An item that cannot be handled must not end the thread.
            _log.exception("%s: lost %s", self._thread.name, item)
            return False
