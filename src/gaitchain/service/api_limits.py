"""Limits of connections, requests and messages that the HTTP API accepts."""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class ApiLimits:
    """The limits of one server."""

    connections: int = 256
    """TCP connections at once."""
    sockets: int = 32
    """Clients of the telemetry stream at once."""
    viewers: int = 8
    """Clients of the 3-D view at once."""
    request_s: float = 20.0
    """Time from connecting, or the last answer, to the end of the next answer [s]."""
    requests_per_s: float = 400.0
    """Requests per second from one address."""
    refused_s: float = 0.5
    """Time after which a request beyond that is refused, so that it is not repeated at
    once [s]."""
    body_bytes: int = 16_384
    """Size of a request's body [byte]."""
    footsteps_per_s: float = 1000.0
    """New footsteps that are looked at per second, of all clients: a stop waits for
    those of one request, 10 ms for 200 of them."""
    footsteps: int = 400
    """How many of them at once."""
    message_bytes: int = 2_048
    """Size of a client's message on the telemetry stream [byte]."""
    messages_per_s: float = 200.0
    """Messages per second from one stream client; above that, the client is closed."""
    frames_per_s: float = 400.0
    """WebSocket frames per second from one client, pings and fragments counted; above
    that, the client is closed."""
    head_bytes: int = 16_384
    """Size of a request's line and headers [byte]."""
    lines: int = 1_024
    """Lines of a request's head and chunks; above that, the client is closed."""
    bad_messages: int = 100
    """Unreadable messages, plus one per second, after which a client is closed."""
    stalled_s: float = 5.0
    """Time without any accepted byte after which a client is closed [s]."""
    silent_s: float = 1.0
    """Time without telemetry after which the loop counts as silent [s]."""


class Allowance:
    """So many per second, and as many at once as in `burst`."""

    def __init__(
        self,
        per_s: float,
        burst: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin with a full burst.

        Args:
            per_s: how many come back each second.
            burst: how many can be taken at once; those of one second by default.
            clock: seconds that never go back.
        """
        self._per_s, self._clock = per_s, clock
        self._most = max(1.0, per_s if burst is None else burst)
        self._left, self._then = self._most, clock()

    def take(self, many: int = 1) -> bool:
        """Take one, or so many; False if they are not left."""
        now = self._clock()
        self._left = min(self._most, self._left + self._per_s * (now - self._then))
        self._then = now
        if self._left < many:
            return False
        self._left -= many
        return True
