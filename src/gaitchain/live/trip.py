"""Where the driver sent the robot: through places to the last one, or by footsteps."""

import math
from collections import deque
from itertools import pairwise

from gaitchain.errors import CommandError
from gaitchain.live.messages import Errand, Going, GoTo
from gaitchain.walker.walker import Walker
from gaitchain.walker.waypoints import Near, Place, check_place

_PASSED = 0.3  # of the leg: who comes so near to a place on the way goes on to the next


class Trip:
    """Leads a walker on an errand."""

    def __init__(self, walker: Walker) -> None:
        """Stay where it is."""
        self._walker = walker
        leg = walker.library.robot.reduced.leg_length
        self._passed = Near(_PASSED * leg, math.pi)
        self._errand: Errand | None = None
        self._places = deque[Place]()  # still to come, the next one first

    def begin(self, errand: Errand) -> None:
        """Set out.

        Raises:
            CommandError: there is no such way; see `Walker.go_to` and `follow_steps`.
                The message has the number of the place or footstep.
        """
        self.end()
        if isinstance(errand, GoTo):
            if not errand.places:
                raise CommandError("no place to go to; give at least one")
            for number, place in enumerate(errand.places, start=1):
                check_place(place, f"place {number}")  # on the way it is too late
            self._places = deque(errand.places)
            self._go(errand.crouch)
        else:
            self._walker.follow_steps(errand.steps)
        self._errand = errand

    def end(self) -> None:
        """Forget it; the walker goes on until it has another command."""
        self._errand = None
        self._places.clear()

    def pass_places(self) -> None:
        """Go on to the next place where one on the way is near; each control period."""
        here, errand = self._walker.place, self._errand
        if here is None or not isinstance(errand, GoTo):
            return
        passed = False
        while len(self._places) > 1 and self._is_near(here):
            self._places.popleft()
            passed = True
        if passed:
            self._go(errand.crouch)

    def _is_near(self, here: Place) -> bool:
        return self._passed.holds(self._places[0].seen_from(here))

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
        way, goal = (here, *self._places), self._places[-1]
        distance = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(way))
        turn = math.remainder(goal.yaw - here.yaw, math.tau)
        there = walker.arrived and walker.goal == goal
        return Going(goal, len(self._places), 0, distance, turn, there)
