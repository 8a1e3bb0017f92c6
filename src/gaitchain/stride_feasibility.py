"""Which pairs of strides the plan itself can carry out, without physics.

The plan is run with sensors that report its own reference. A pair is walked only if the
ZMP stays inside the sole without moving the landing, and if no joint goes beyond its
limits. Ours.
"""

import numpy as np
from numpy.typing import NDArray

from gaitchain.kinematics import Array
from gaitchain.messages import Sensors
from gaitchain.motion import Timing
from gaitchain.online.gains import derive_gains, step_times
from gaitchain.online.legs import legs_of
from gaitchain.online.state import DOUBLE, SETTLE, SHIFT, STAND
from gaitchain.online.stride_walk import Snapshot, StrideWalk
from gaitchain.poses import STAND as STANDING
from gaitchain.stride_poses import StridePoses

_ANGLE_HEADROOM, _SPEED_HEADROOM = 0.98, 1.6
_MOVED = 0.01  # of the leg: a landing moved further was not feasible
_STEADY_STEPS = 4  # until a walk from a stand repeats itself
_PERIOD_S = 0.01
_STRAIGHTEST = 0.12  # rad: a knee bent less is at the end of the leg's reach


def feasible_pairs(
    poses: StridePoses, timing: Timing, speed_limit: float
) -> NDArray[np.bool_]:
    """Check every pair of strides.

    Args:
        poses: the candidates.
        timing: the step's times.
        speed_limit: of the joints, infinite for none [rad/s].

    Returns:
        (N_1, N_4) mask.
    """
    rehearsal = _Rehearsal(poses, timing, speed_limit)
    count = poses.counts[0]
    allowed = np.zeros((count, count), dtype=np.bool_)
    for first in range(count):
        start = rehearsal.after(first)
        for last in range(count):
            allowed[first, last] = rehearsal.step(start, last)
    allowed[STANDING, STANDING] = False
    return allowed


class _Rehearsal:
    """A walk of the plan alone."""

    def __init__(self, poses: StridePoses, timing: Timing, speed_limit: float) -> None:
        legs = legs_of(poses.biped)
        times = step_times(poses.biped, timing, poses.hip_height, _PERIOD_S)
        self._walk = StrideWalk(legs, derive_gains(legs), times)
        self._poses = poses
        self._most_turn = _ANGLE_HEADROOM * poses.biped.joint_angle_limit
        self._most_speed = _SPEED_HEADROOM * speed_limit
        self._joints: Array = self._walk.stand
        self._fits = True
        self._landed = 0.0, 0.0

    def after(self, stride: int) -> Snapshot:
        """Walk a stride until it repeats itself; return the state at its end."""
        walk = self._walk
        walk.reset()
        self._joints = walk.stand
        walk.begin_shift(left_support=True)
        while not walk.wants_stride:
            self._tick()
        if stride != STANDING:
            for _ in range(_STEADY_STEPS):
                self._make(stride)
        return walk.snapshot()

    def step(self, start: Snapshot, stride: int) -> bool:
        """Make one step from a state; return whether plan and joints allow it."""
        self._walk.restore(start)
        self._joints = self._walk.reference
        self._fits = True
        self._make(stride)
        goal = self._walk.goal
        off = np.hypot(self._landed[0] - goal.length, self._landed[1] + goal.width)
        return bool(self._fits and off <= _MOVED * self._poses.biped.leg_length)

    def _make(self, stride: int) -> None:
        walk = self._walk
        walk.begin_step(self._poses.goal(0, 0, stride))
        while walk.state.phase not in (SETTLE, STAND):
            self._tick()
            if walk.state.phase == DOUBLE:
                self._landed = walk.state.landing.x, walk.state.landing.y
            if walk.wants_stride:
                walk.exchange(self._joints)
                break

    def _tick(self) -> None:
        walk, before = self._walk, self._joints
        rates = (walk.reference - before) / _PERIOD_S
        self._joints = walk.reference
        still = np.zeros(3)
        upright = np.array([0.0, 0.0, 9.81])
        walk.advance(Sensors(0.0, self._joints, rates, still, upright))
        speed = np.abs(walk.reference - self._joints).max() / _PERIOD_S
        turn = np.abs(walk.reference).max()
        if walk.state.phase != SHIFT:
            held = turn <= self._most_turn and speed <= self._most_speed
            self._fits &= bool(held and self._knees() >= _STRAIGHTEST)

    def _knees(self) -> float:
        """Least bend of a knee [rad]: a leg out of reach is a straight one."""
        return float(self._walk.reference[[3, 9]].min())
