"""Where the driver sent the robot: through places to the last one, or by footsteps."""

import math
from collections import deque
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

from gaitchain.errors import CommandError
from gaitchain.live.messages import Errand, Going, GoTo
from gaitchain.walker.place import Place, check_place
from gaitchain.walker.waypoints import Near, check_way, near_of

if TYPE_CHECKING:  # which needs machine code, the checks here do not
    from gaitchain.walker.walker import Walker

MOST_PLACES = 1000
"""Places of one errand: it is compared whenever it is repeated."""
_STOPS = 0.7  # of that; a walker stops where that brings it to within half of it
_PASSED = 0.3  # of the leg: so near to a place on the way, the next one is the goal


class Trip:
    """Leads a walker on an errand."""

    def __init__(self, walker: "Walker") -> None:
        """Stay where it is."""
        self._walker = walker
        leg = walker.library.robot.reduced.leg_length
        self._passed = Near(_PASSED * leg, math.pi)
        self._there = near_of(walker.library)
        self._stops = Near(_STOPS * _PASSED * leg, math.pi)
        self._errand: Errand | None = None
        self._places = deque[Place]()  # still to come, the next one first
        self._after = deque[float]()  # from each of them to the last one [m]

    def begin(self, errand: Errand) -> None:
        """Set out.

        Raises:
            CommandError: there is no such way; see `Walker.go_to` and `follow_steps`.
                The message has the number of the place or footstep. Or there are more
                than `MOST_PLACES`.
        """
        self.end()
        if isinstance(errand, GoTo):
            self._check(errand.places)
            self._places = deque(errand.places)
            self._after = deque(_lengths(errand.places))
            self._go(errand.crouch)
        else:
            self._walker.follow_steps(errand.steps)
        self._errand = errand

    def _check(self, places: Sequence[Place]) -> None:
        """Refuse places that cannot be walked to: on the way it is too late."""
        check_count(len(places))
        here, most = self._walker.place, self._walker.command_range
        # A robot that walks in every direction has a way to every place, and a control
        # period is too short to look for a thousand.
        everywhere = all(most.both_ways)
        for number, place in enumerate(places, start=1):
            name = f"place {number}"
            check_place(place, name)
            if here is None or everywhere:  # where there is none the walker says why
                continue
            near = self._there if number == len(places) else self._passed
            check_way(here, place, most, near, name)
            # A robot that cannot turn still has the heading that it set out with.
            here = place if any(most.yaw_rate) else place._replace(yaw=here.yaw)

    def end(self) -> None:
        """Forget it; the walker goes on until it has another command."""
        self._errand = None
        self._places.clear()
        self._after.clear()

    def pass_places(self) -> None:
        """Go on to the next place where one on the way is near; each control period.

        Raises:
            CommandError: there is no way any more from where the robot has come to.
        """
        here, errand = self._walker.place, self._errand
        if here is None or not isinstance(errand, GoTo):
            return
        passed = False
        while len(self._places) > 1 and self._is_near(here):
            self._places.popleft()
            self._after.popleft()
            passed = True
        if passed:
            self._go(errand.crouch)

    def _is_near(self, here: Place) -> bool:
        """Whether it is there, or would soon be told to stop there."""
        goal, stop = self._places[0], self._walker.stop_place or here
        stops = self._stops.holds(goal.seen_from(stop))
        return stops or self._passed.holds(goal.seen_from(here))

    def _go(self, crouch: float) -> None:
        on_the_way = self._passed if len(self._places) > 1 else None
        self._walker.go_to(self._places[0], on_the_way, crouch)

    @property
    def going(self) -> Going | None:
        """How far it is; None without an errand."""
        here, walker = self._walker.place, self._walker
        if self._errand is None or here is None:
            return None
        if not self._places:
            left = walker.footsteps_left
            there = walker.standing and not left
            return Going(None, 0, left, math.nan, math.nan, there)
        goal = self._places[-1]
        distance = _apart(here, self._places[0]) + self._after[0]
        turn = math.remainder(goal.yaw - here.yaw, math.tau)
        there = walker.arrived and walker.goal == goal
        return Going(goal, len(self._places), 0, distance, turn, there)


def check_count(places: int) -> None:
    """Refuse a way through no place or too many.

    Raises:
        CommandError: there are none, or more than `MOST_PLACES`.
    """
    if not places:
        raise CommandError("no place to go to; give at least one")
    if places > MOST_PLACES:
        raise CommandError(
            f"{places} places: at most {MOST_PLACES} are walked one after another; "
            "leave some out, or send the rest when these are passed"
        )


def _lengths(places: Sequence[Place]) -> list[float]:
    """Return how far it is from each place through the others to the last one [m]."""
    legs = [_apart(a, b) for a, b in pairwise(places)]
    return [*accumulate(reversed(legs), initial=0.0)][::-1]


def _apart(a: Place, b: Place) -> float:
    return math.hypot(b.x - a.x, b.y - a.y)
