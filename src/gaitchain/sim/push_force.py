"""Pushes on the trunk of a simulated robot, planned or started on request."""

import math
from collections.abc import Sequence

from gaitchain.sim.world import Push


class Pushes:
    """The pushes on the robot, timed by a clock that can be restarted or stopped."""

    def __init__(self, planned: Sequence[Push]) -> None:
        """Set the planned pushes of a world; their clock begins at 0."""
        self._pushes = tuple(planned)
        self._began_s = 0.0

    def __bool__(self) -> bool:
        """Return whether there is any push, past, present or future."""
        return bool(self._pushes)

    def start_clock(self, now_s: float) -> None:
        """Restart the clock of the pushes at the simulator's time `now_s`."""
        self._began_s = now_s

    def stop_clock(self) -> None:
        """Suspend all pushes until `start_clock`."""
        self._began_s = math.inf

    def add(self, impulse_ns: float, direction_deg: float, now_s: float) -> None:
        """Add a push of 0.1 s that begins now, and remove those that have ended.

        Raises:
            CommandError: a number is outside its limits.
        """
        self.start_clock(min(self._began_s, now_s))
        now_s -= self._began_s
        going = (p for p in self._pushes if p.at_s + p.duration_s > now_s)
        self._pushes = (*going, Push(impulse_ns, direction_deg, now_s))

    def impulse_within(
        self, now_s: float, duration_s: float, heading: float
    ) -> tuple[float, float]:
        """Return the impulse from now on, along x and y of the world [N s].

        Args:
            now_s: the simulator's time [s].
            duration_s: length of the interval [s].
            heading: heading of the trunk [rad].
        """
        x = y = 0.0
        now_s -= self._began_s
        for push in self._pushes:
            part = push.impulse_within(now_s, now_s + duration_s)
            angle = heading + math.radians(push.direction_deg)
            x, y = x + part * math.cos(angle), y + part * math.sin(angle)
        return x, y
