"""Forces on a simulated robot: planned pushes, drawn punches, pushes on request."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gaitchain.messages import Array
from gaitchain.sim.push import Punches, Push


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
        self._taken: Push | None = None
        self._began_s = 0.0
        self._punches = iter(punches)
        self._punch = next(self._punches, None)

    def __bool__(self) -> bool:
        """Return whether there is any push, past, present or future."""
        return bool(self._pushes) or self._punch is not None

    def start_clock(self, now_s: float) -> None:
        """Restart the clock of the pushes at the simulator's time `now_s`."""
        self._began_s = now_s

    def stop_clock(self) -> None:
        """Suspend all pushes until `start_clock`."""
        self._began_s = math.inf

    def set_punches(self, punches: Iterable[Push], now_s: float) -> None:
        """Let other punches follow from now on, or none; their times rise."""
        self._over = self._begun(now_s)
        self._punches = iter(punches)
        self._punch = next(self._punches, None)

    def ensure_clock(self, now_s: float) -> None:
        """Start the clock at the simulator's time `now_s` if it is stopped."""
        self._began_s = min(self._began_s, now_s)

    def known(self, now_s: float) -> list[Push]:
        """Return the planned pushes and the punches that have begun."""
        return [*self._pushes, *self._begun(now_s)]

    def take_begun(self, now_s: float) -> list[Push]:
        """Return the punches that have begun since the last call, and forget them."""
        begun = self._begun(now_s)
        new = [punch for punch in begun if punch is not self._taken]
        self._over.clear()
        self._taken = begun[-1] if begun else None
        return new

    def _begun(self, now_s: float) -> list[Push]:
        punch = self._punch
        begins = punch is not None and punch.at_s <= self.elapsed_s(now_s)
        return [*self._over, punch] if punch and begins else list(self._over)

    def elapsed_s(self, now_s: float) -> float:
        """Return the time on the clock, -inf while it is stopped [s]."""
        return now_s - self._began_s

    def add(self, push: Push, now_s: float) -> None:
        """Add a push that begins now, and remove those that have ended."""
        self.ensure_clock(now_s)
        now_s = self.elapsed_s(now_s)
        going = (p for p in self._pushes if p.ends_s > now_s)
        self._pushes = (*going, replace(push, at_s=now_s))

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
    rng: np.random.Generator,
    punches: Punches,
    masses: Mapping[str, float],
    since_s: float = 0.0,
) -> Iterator[Push]:
    """Draw punches without end: impulse, direction in space, and body are random.

    The impulse is uniform up to the largest, the direction uniform on the sphere.

    Args:
        rng: of the world's stream of punches.
        punches: how hard and how often.
        masses: of each body by its name [kg].
        since_s: when they were begun with [s].
    """
    at_s = since_s + punches.every_s
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
