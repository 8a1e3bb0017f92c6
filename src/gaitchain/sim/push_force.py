"""Forces on a simulated robot: planned pushes, drawn punches, pushes on request."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from gaitchain.messages import Array
from gaitchain.sim.world import Punches, Push, World
from gaitchain.sim.world_draws import PUNCHES_STREAM, stream_of

ANY_BODY = "any"
"""Instead of a body's name: one is drawn, each with its part of the robot's mass."""


class Pushes:
    """The pushes on the robot, timed by a clock that can be restarted or stopped."""

    def __init__(self, planned: Sequence[Push], punches: Iterable[Push] = ()) -> None:
        """Set the pushes of a world; their clock begins at 0.

        Args:
            planned: pushes at known times.
            punches: more of them, one after the other.
        """
        self._pushes = tuple(planned)
        self._over: list[Push] = []
        self._punches = iter(punches)
        self._punch = next(self._punches, None)
        self._began_s = 0.0

    def __bool__(self) -> bool:
        """Return whether there is any push, past, present or future."""
        return bool(self._pushes) or self._punch is not None

    def start_clock(self, now_s: float) -> None:
        """Restart the clock of the pushes at the simulator's time `now_s`."""
        self._began_s = now_s

    def stop_clock(self) -> None:
        """Suspend all pushes until `start_clock`."""
        self._began_s = math.inf

    def known(self, now_s: float) -> list[Push]:
        """Return the planned pushes and the punches that have begun."""
        known = [*self._pushes, *self._over]
        if self._punch is not None and self._punch.at_s <= self.elapsed_s(now_s):
            known.append(self._punch)
        return known

    def elapsed_s(self, now_s: float) -> float:
        """Return the time on the clock, -inf while it is stopped [s]."""
        return now_s - self._began_s

    def add(self, impulse_ns: float, direction_deg: float, now_s: float) -> None:
        """Add a push of 0.1 s that begins now, and remove those that have ended.

        Raises:
            CommandError: a number is outside its limits.
        """
        self.start_clock(min(self._began_s, now_s))
        now_s = self.elapsed_s(now_s)
        going = (p for p in self._pushes if p.ends_s > now_s)
        self._pushes = (*going, Push(impulse_ns, direction_deg, now_s))

    def impulses_within(
        self, now_s: float, duration_s: float, heading: float
    ) -> dict[str, Array]:
        """Return the impulse on each body that is pushed from now on.

        Args:
            now_s: the simulator's time [s].
            duration_s: length of the interval [s].
            heading: heading of the trunk [rad].

        Returns:
            By the body's name, (3,) in the world's frame [N s].
        """
        found: dict[str, Array] = {}
        now_s = self.elapsed_s(now_s)
        for push in self._now(now_s):
            part = push.impulse_within(now_s, now_s + duration_s)
            if part:
                pushed = part * np.array(push.axis(heading))
                found[push.body] = found.get(push.body, 0.0) + pushed
        return found

    def _now(self, now_s: float) -> tuple[Push, ...]:
        """Return the planned pushes and the punch that is not over yet."""
        while self._punch is not None and self._punch.ends_s <= now_s:
            self._over.append(self._punch)
            self._punch = next(self._punches, None)
        return self._pushes if self._punch is None else (*self._pushes, self._punch)


def draw_punches(
    world: World, punches: Punches, masses: Mapping[str, float]
) -> Iterator[Push]:
    """Draw punches without end: impulse, direction in space, and body are random.

    The impulse is uniform up to the largest, the direction uniform on the sphere.

    Args:
        world: its seed decides.
        punches: how hard and how often.
        masses: of each body by its name [kg].
    """
    rng = stream_of(world, PUNCHES_STREAM)
    at_s = punches.every_s
    while True:
        yield Push(
            float(rng.uniform(0.0, punches.most_ns)),
            float(rng.uniform(-180.0, 180.0)),
            at_s,
            punches.duration_s,
            elevation_deg=math.degrees(math.asin(rng.uniform(-1.0, 1.0))),
            body=draw_body(masses, rng),
        )
        at_s += punches.every_s


def draw_body(masses: Mapping[str, float], rng: np.random.Generator) -> str:
    """Draw a body, each with its part of the robot's mass."""
    parts = np.array(list(masses.values()))
    return list(masses)[int(rng.choice(len(parts), p=parts / parts.sum()))]
