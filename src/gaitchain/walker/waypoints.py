"""Walk to places on the floor: a position controller above the commands. Ours.

Where the robot is follows from its steps, as the legs and the gyro measured them; no
camera or map is needed, and what is measured wrong adds up.
"""

import math
from dataclasses import replace
from typing import NamedTuple, Self

from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.limits import is_real
from gaitchain.messages import Command
from gaitchain.walker.place import Place, check_place

_SLOW = 2.0  # steps: the rest of a way is made in no less
_NEAR, _NEAR_TURN = 0.02, math.radians(2.0)  # of the leg
# Of a robot that has to face where it goes: a turn moves it by 0.02.
_NEAR_FACING = 0.06
_SURELY = 0.5  # of what is near enough: there a robot stops
_LEFT = math.sqrt(1.0 - _SURELY**2)  # of it: what may be left beside that
_DIRECTIONS = (
    ("back", "ahead"),
    ("to the right", "to the left"),
    ("around to the right", "around to the left"),
)


def near_of(library: GaitLibrary) -> "Near":
    """Return how near a place counts as there for the robot of a library.

    A robot that does not walk to all sides has to turn for what is left of a way, and a
    turn on the spot moves it, too.
    """
    ahead, aside, _ = library.command_range.both_ways
    part = _NEAR if ahead and aside else _NEAR_FACING
    return Near(part * library.robot.reduced.leg_length, _NEAR_TURN)


class Near(NamedTuple):
    """How near a place counts as there."""

    distance: float
    """[m]"""
    turn: float
    """[rad]"""

    def holds(self, off: Place) -> bool:
        """Return whether an error, from `Place.seen_from`, is near enough."""
        return math.hypot(off.x, off.y) <= self.distance and abs(off.yaw) <= self.turn


def check_near(near: Near) -> None:
    """Refuse what no robot comes to, however near it is.

    Raises:
        CommandError: it is no `Near`, or not of numbers above 0.
    """
    if not isinstance(near, Near):
        raise CommandError(f"near {near!r:.80}: give Near(distance, turn), or None")
    if not all(is_real(most) and most > 0.0 for most in near):
        raise CommandError(
            f"near {tuple(near)!r:.80}: distance and turn must be numbers above 0 "
            "[m, rad], as Near(0.01, 0.05)"
        )


def check_way(
    start: Place,
    goal: Place,
    most: CommandRange,
    near: Near,
    name: str = "goal",
) -> None:
    """Refuse a place to which the range of the commands has no way.

    Args:
        start: where the robot sets out, in the frame of the place.
        goal: the place.
        most: the range of the commands.
        near: how near counts as there.
        name: what the place is, for the message.

    Raises:
        CommandError: it leads in a direction that the range lacks, and the robot cannot
            turn to it and walk ahead either.
    """
    off = _needed(goal.seen_from(start), most, near)
    if _has_way(off, most):
        return
    parts = zip(most.parts(Command(*off)), _DIRECTIONS, strict=True)
    lacks = [ways[part > 0.0] for part, ways in parts if math.isinf(part)]
    ends = zip(most.limits, _DIRECTIONS, strict=True)
    has = [way for end, ways in ends for way, can in zip(ways, end, strict=True) if can]
    raise CommandError(
        f"{name} {tuple(goal)}: the way there leads {' and '.join(lacks)}, where this "
        f"library does not walk; it walks {', '.join(has) or 'nowhere'}: a place that "
        "needs no more would do"
    )


class Way:
    """The way to a place on which the robot is to stand."""

    def __init__(
        self,
        goal: Place,
        most: CommandRange,
        slow_s: float,
        near: Near,
        slide: float = 0.0,
        crouch: float = 0.0,
    ) -> None:
        """Set out for a place.

        Args:
            goal: the place, in the frame of the robot's own odometry.
            most: the range of the commands.
            slow_s: see `steer` [s].
            near: how near counts as there.
            slide: how far ahead feet that step usually slide in `slow_s` [m].
            crouch: hips lower by this on the way [m].

        Raises:
            CommandError: there is no such place, or nothing is so near; see
                `check_place` and `check_near`.
        """
        check_place(goal)
        check_near(near)
        self.goal, self.near = goal, near
        self._most, self._slow_s = most, slow_s
        self._slide, self._crouch = slide, crouch
        self._stop_off = 0.0, 0.0  # ahead and to the left [m]
        self._expected: Place | None = None  # where it was first told to stop

    @classmethod
    def of(
        cls,
        library: GaitLibrary,
        goal: Place,
        near: Near | None = None,
        crouch: float = 0.0,
    ) -> Self:
        """Set out for a place with a library of strides; see `Walker.go_to`."""
        if near is None:
            near = near_of(library)
        slow_s, slide = _SLOW * library.timing.step, _SLOW * library.slides.steps.each
        return cls(goal, library.command_range, slow_s, near, slide, crouch)

    def ends_at(self, place: Place) -> bool:
        """Return whether a place is near enough to the goal."""
        return self.near.holds(self.goal.seen_from(place))

    def time_from(self, place: Place) -> float:
        """Return about how long the way from a place takes at full speed [s].

        It is infinite where the range of the commands has no such way.
        """
        off = _needed(self.goal.seen_from(place), self._most, self.near)
        facing = _time_facing(off, self._most, self._slow_s)
        return min(_time(off, self._most), facing)

    def command(self, place: Place, *, stepping: bool) -> Command:
        """Return the command to give; to stop where that brings it to the goal.

        Args:
            place: where the robot comes to stand if it is told to stop now.
            stepping: whether it is still on its way there.
        """
        if not stepping:
            self._learn_stop(place)
        comes_to = place.moved(*self._stop_off) if stepping else place
        if self._stops_at(comes_to) or (not stepping and self.ends_at(place)):
            self._expected = self._expected or comes_to
            return Command(crouch=self._crouch)
        off = self._off(comes_to.moved(self._slide, 0.0))
        way = steer(off, self._most, self._slow_s)
        return replace(way, crouch=self._crouch)

    def _stops_at(self, place: Place) -> bool:
        """Return whether to stop at a place; the last step may miss a little."""
        surely = Near(*(_SURELY * most for most in self.near))
        return surely.holds(self._off(place))

    def _learn_stop(self, place: Place) -> None:
        """Learn how far from where it was expected the robot came to stand."""
        if self._expected is not None:
            x, y, _ = place.seen_from(self._expected)
            self._stop_off = self._stop_off[0] + x, self._stop_off[1] + y
        self._expected = None

    def _off(self, place: Place) -> Place:
        """Return the goal from a place, as far as it is to be made up.

        A little that the range lacks is left: turns for it would never end. Where there
        is no way any more, as after a slip of a robot that cannot turn, the robot goes
        as near as it can.
        """
        seen = self.goal.seen_from(place)
        off = _without(seen, self._most, Near(*(_LEFT * most for most in self.near)))
        if _has_way(off, self._most):
            return off
        return _without(seen, self._most, Near(math.inf, math.inf))


def steer(off: Place, most: CommandRange, slow_s: float) -> Command:
    """Return the command that brings the robot to a place soonest.

    The parts of a command share the range, so the way straight there takes t = |x| /
    v_x + |y| / v_y + |yaw| / v_yaw, all three at once. Far away it is sooner to turn
    first, or meanwhile, and walk ahead.

    Args:
        off: the place from the robot.
        most: the range of the commands.
        slow_s: time in which the rest of the way is made at the end, so that the robot
            does not overshoot by the step it is in [s].
    """
    straight = _time(off, most)
    aim, time = off, straight
    if _time_facing(off, most, slow_s) < straight:
        distance, bearing = math.hypot(off.x, off.y), math.atan2(off.y, off.x)
        # Ahead only as far as it brings the robot nearer.
        aim = Place(distance * max(math.cos(bearing), 0.0), 0.0, bearing)
        time = _time(aim, most)
    time = max(time, slow_s)
    return Command(aim.x / time, aim.y / time, aim.yaw / time)


def _has_way(off: Place, most: CommandRange) -> bool:
    return math.isfinite(min(_time(off, most), _time_facing(off, most, 0.0)))


def _needed(off: Place, most: CommandRange, near: Near) -> Place:
    """Leave out what is near enough and the range has no way to make up.

    A robot that cannot turn is never quite in the heading of its goal.
    """
    return off if _has_way(off, most) else _without(off, most, near)


def _without(off: Place, most: CommandRange, near: Near) -> Place:
    """Leave out what the range lacks, if it is no more than that."""
    enough = near.distance, near.distance, near.turn
    parts = zip(off, most.parts(Command(*off)), enough, strict=True)
    return Place(
        *(0.0 if math.isinf(p) and abs(v) <= least else v for v, p, least in parts)
    )


def _time_facing(off: Place, most: CommandRange, slow_s: float) -> float:
    """Return the time to face a place, walk there, and turn as it says [s]."""
    bearing = math.atan2(off.y, off.x)
    facing = Place(math.hypot(off.x, off.y), 0.0, bearing)
    then = Place(yaw=math.remainder(off.yaw - bearing, math.tau))
    # To come to a place and then turn there takes `slow_s` once more.
    return _time(facing, most) + slow_s + _time(then, most)


def _time(off: Place, most: CommandRange) -> float:
    """Return the least time for a way, inf where the range lacks it [s]."""
    return most.share(Command(*off))
