"""The riser: sensors to joint targets of the whole robot, from lying to standing. Ours.

It stands beside the walker: one `step` a period, no clock, no I/O, no simulator.
"""

import math
from enum import StrEnum

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, Side, TimedPose, Way, way_targets
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Sensors
from gaitchain.walker.sensor_check import LIMITS, below

TRIES = 3
"""How often it is tried."""
STANDS_WITHIN = math.radians(15.0)
"""Joints that stand are all within this of the pose to stand in [rad]. Half of what the
loop's guard takes for a joint that does not follow: a robot that is up has to be able
to walk. OP3's joints are within 0.04 rad in its model; knees that kneel are bent by
more than 1 rad."""
_STRAIGHTENS_S = (
    1.5  # from wherever the joints are to the pose that the ways begin with
)
_RESTS_S, _STANDS_S = 1.0, 1.0
_FEELS_S = 0.2  # time constant of the mean acceleration
_UPRIGHT = 0.9  # of gravity, along the trunk
_RESTLESS = 0.3  # of gravity: it still rolls or slides


class Rising(StrEnum):
    """What a riser does."""

    STRAIGHTENING = "straightening"
    """Moves the joints slowly to the pose that the ways begin with, and rests there."""
    GETTING_UP = "getting up"
    UP = "up"
    """It stands."""
    GIVEN_UP = "given up"


class Riser:
    """Get one robot up that lies."""

    def __init__(self, found: GetUp, period_s: float = CONTROL_PERIOD_S) -> None:
        """Take the ways.

        Args:
            found: of this robot.
            period_s: control period, at which `step` is called [s].

        Raises:
            CommandError: no way is known.
        """
        if not found.ways:
            raise CommandError(f"{found.robot}: no way to get up was found")
        self._found, self._period_s = found, period_s
        ends = [way.poses[-1].angles for way in found.ways.values()]
        self._stands = np.array(ends)  # of each way (ways, n)
        self.state, self.tries, self._why = Rising.UP, 0, ""
        self.side: Side | None = None
        """What it lies on, as the accelerometer says; None before it was asked."""
        self._rows, self._next = np.empty((0, len(found.joint_names))), 0
        self._felt = np.zeros(3)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints in the order of the sensors and of the targets."""
        return self._found.joint_names

    @property
    def note(self) -> str:
        """What it does, or why it gave up."""
        if self.state is Rising.GIVEN_UP:
            return f"given up: {self._why}"
        side = "" if self.side is None else f" from the {self.side}"
        return f"{self.state.value}{side}, try {self.tries} of {TRIES}"

    def begin(self, joint_position: Array) -> None:
        """Begin anew, from where the joints are.

        Args:
            joint_position: (n,) [rad].
        """
        self.tries, self.side, self._felt = 0, None, np.zeros(3)
        self._straighten(joint_position)

    def step(self, sensors: Sensors) -> Array:
        """Return the joint targets of this control period.

        Args:
            sensors: of all joints, in the order of `joint_names`; what is no number
                does not count.

        Returns:
            (n,) [rad].

        Raises:
            CommandError: it has not begun.
        """
        if not len(self._rows):
            raise CommandError("a riser steps after `begin`, from where the joints are")
        self._feel(sensors.acceleration)
        if self._next == len(self._rows):
            self._go_on(sensors.joint_position)
        target = self._rows[min(self._next, len(self._rows) - 1)]
        self._next = min(self._next + 1, len(self._rows))
        return np.array(target)

    def _feel(self, acceleration: Array) -> None:
        if below(acceleration, LIMITS["acceleration"]):
            part = min(self._period_s / _FEELS_S, 1.0)
            self._felt = self._felt + part * (acceleration - self._felt)

    def _go_on(self, joint_position: Array) -> None:
        """Choose what comes after what has ended."""
        last = self._rows[-1]
        if self.state not in (Rising.STRAIGHTENING, Rising.GETTING_UP):
            return
        upright = self._felt[2] > _UPRIGHT * GRAVITY
        if upright and self._is_straight(joint_position):
            self.state = Rising.UP
        elif self.state is Rising.GETTING_UP or upright or self._restless:
            self._try_again(last)
        else:
            self._rise(last)

    def _is_straight(self, joint_position: Array) -> bool:
        """Whether the joints are as it stands: a kneeling robot is upright, too."""
        off = np.abs(joint_position - self._stands)
        far = (off > STANDS_WITHIN) & (
            np.abs(joint_position) < LIMITS["joint_position"]
        )
        return not far.any(axis=1).all()

    @property
    def _restless(self) -> bool:
        off = float(np.linalg.norm(self._felt)) - GRAVITY
        return abs(off) > _RESTLESS * GRAVITY

    def _try_again(self, start: Array) -> None:
        if self.tries < TRIES:
            self._straighten(start)
        else:
            self._give_up(f"it does not stand after {TRIES} tries")

    def _give_up(self, why: str) -> None:
        self.state, self._why = Rising.GIVEN_UP, why

    def _straighten(self, start: Array) -> None:
        self.state, self.tries = Rising.STRAIGHTENING, self.tries + 1
        lying = Way((TimedPose(_STRAIGHTENS_S, self._found.lying),), 0, 1)
        self._play(way_targets(lying, start, self._period_s), _RESTS_S)

    def _rise(self, start: Array) -> None:
        """Take the way from the side that it lies on.

        With the front down the trunk's x axis points down, so that what the
        accelerometer feels, which points up, is against it.
        """
        self.side = "front" if self._felt[0] < 0.0 else "back"
        way = self._found.ways.get(self.side)
        if way is None:
            self._give_up(f"no way from the {self.side} is known")
            return
        self.state = Rising.GETTING_UP
        self._play(way_targets(way, start, self._period_s), _STANDS_S)

    def _play(self, rows: Array, hold_s: float) -> None:
        """Go through these targets, and hold the last."""
        hold = np.repeat(rows[-1:], round(hold_s / self._period_s), axis=0)
        self._rows, self._next = np.concatenate([rows, hold]), 0
