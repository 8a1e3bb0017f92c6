"""Where the trunk is by legs and gyro, from where it stood: odometry. Ours.

The part of a sole that bears weight stands still while it does, so the trunk moves over
the ground by what that part seems to move backward, seen from the trunk:
dp = R(t - dt) c(t - dt) - R(t) c(t), c the same point of the sole in both. That holds
for a foot that rolls over an edge or turns about itself, and the place never jumps when
the support changes. A foot that slides is what this cannot see: the usual slide, which
the library has learned, is added, and the rest is drift.

While both feet are planned on the ground the landing one may still be in the air, and
slides as it lands, so only the other one counts. After that the lower of the two does,
for as long again: a foot that lands late does not stand yet.
"""

import math

import numpy as np

from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import Attitude
from gaitchain.balance.support_foot import TIPPED
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import Support
from gaitchain.messages import Array
from gaitchain.walker.odometry import Odometry
from gaitchain.walker.place import ORIGIN, Place

_SMOOTH_S = 0.03  # time constant of the velocity
# Drift of RES, OP3, T1 and Talos in simulation, by benchmarks/odometry_drift.py --seed
# 7: root mean squares over robots and worlds. Errors keep their sign: they grow with
# the way, not with its root.
SCALE = 0.008
"""Of the way, as a part of it."""
ASIDE = 0.005
"""Across the way, as a part of it, besides what the heading does."""
VEER = math.radians(0.1)
"""Of the heading, by each metre [rad/m]."""
TURN_SCALE = 0.007
"""Of the heading, as a part of the angle turned."""
FACING = math.radians(0.1)
"""Of the heading before the first step [rad]."""
STANDING = 0.005
"""Of the place before the first step: how well the soles are known to stand [m]."""
# Root mean squares of 48 falls of OP3 in its own model, which was pushed from all
# sides as it stood or walked; with a gyro of 0.01 rad/s bias and noise.
FALL = 0.9
"""Of the place after a fall and a way up, as a part of the leg, along each axis."""
FALL_GYRO = math.radians(1.6)
"""Of the heading after that, by the gyro [rad]."""
FALL_YAW = math.radians(55.0)
"""The same without one: it turned by as much [rad]."""
_SOURCES = 4  # of drift
_STANDS = {
    Support.LEFT_SINGLE: 0,
    Support.LEFT_TO_RIGHT: 0,
    Support.RIGHT_SINGLE: 1,
    Support.RIGHT_TO_LEFT: 1,
}
_DOUBLE = (Support.LEFT_TO_RIGHT, Support.RIGHT_TO_LEFT)


class LegOdometry:
    """Adds up the way of the trunk, one control period at a time."""

    def __init__(
        self, library: GaitLibrary, period_s: float, at: Place = ORIGIN
    ) -> None:
        """Stand at a place.

        Args:
            library: the robot, and how its feet slide.
            period_s: between two calls of `update` [s].
            at: where the middle between the feet is, and the heading.
        """
        robot = library.robot
        self._leg = robot.reduced.leg_length
        self._legs, self._period_s = legs_of(robot), period_s
        self._slide, self._step_s = library.slides.trunk, library.timing.step
        self._stand = np.asarray(robot.legs.stand, dtype=float)
        self._part = period_s / (period_s + _SMOOTH_S)
        self._of_step = period_s / (period_s + self._step_s)
        self.reset(at)

    def reset(self, at: Place = ORIGIN) -> None:
        """Stand at a place, by default the origin, and know it exactly."""
        self._distance = 0.0
        # How the place and heading change with what may be off: scale, veer, turns,
        # what moves the trunk aside, and x, y and heading where a fall ended.
        self._effect = np.zeros((_SOURCES + 3, 3))
        self._begin(at)

    def rise(self, yaw: float | None) -> None:
        """Stand again, where the robot fell: the feet's middle is that of before.

        Args:
            yaw: heading now; None where nothing measured it, then that of before [rad].
        """
        x, y, _ = (self._place + self._ankles.mean(axis=0)).tolist()
        turned = FALL_YAW if yaw is None else FALL_GYRO
        off = np.array([FALL * self._leg, FALL * self._leg, turned])
        falls = self._effect[_SOURCES:]
        # Errors of falls are independent; three rows say the same of all of them.
        both = falls.T @ falls + np.diag(off**2)
        self._effect[_SOURCES:] = np.linalg.cholesky(both).T
        self._begin(Place(x, y, self._attitude.yaw if yaw is None else yaw))

    def _begin(self, at: Place) -> None:
        """Stand with the middle between the feet at a place."""
        self._place, self._velocity = np.zeros(3), np.zeros(3)
        self._step_way = np.zeros(2)  # usual of a step now, in the trunk's heading
        self._both = self._late = 0  # periods
        self._attitude = Attitude(yaw=at.yaw)
        self._pivots, self._turn = np.zeros((2, 3)), np.eye(3)
        feet, ankles = self._located(self._stand, self._attitude)
        self._place[:2] = (at.x, at.y) - ankles[:, :2].mean(axis=0)
        self._settle(feet, ankles)

    def update(
        self,
        joints: Array,
        attitude: Attitude,
        support: Support | None,
        *,
        stepping: bool = True,
    ) -> None:
        """Go on by one control period.

        Args:
            joints: (2 n,) measured [rad].
            attitude: of the trunk.
            support: planned; None while the robot stands.
            stepping: whether it makes a step: feet slide when they land.
        """
        before, yaw = self._points, self._attitude.yaw
        rotations, ankles = self._located(joints, attitude)
        now = ankles + np.einsum("fij,fj->fi", rotations, self._pivots)
        way = (before - now)[self._standing(support, now[:, 2])].mean(axis=0)
        if stepping and support is not None:
            way[:2] += self._slid(way[:2], attitude.yaw)
        else:
            self._step_way[:] = 0.0
        self._attitude = attitude
        height = self._place[2]
        self._place[:2] += way[:2]
        self._settle(rotations, ankles)
        way[2] = self._place[2] - height
        self._velocity += self._part * (way / self._period_s - self._velocity)
        self._grow(way[:2], attitude.yaw - yaw)

    @property
    def latest(self) -> Odometry:
        """Where the trunk is now."""
        a = self._attitude
        cov = self._effect.T @ self._effect
        cov[0, 0] += STANDING**2
        cov[1, 1] += STANDING**2
        cov[2, 2] += FACING**2
        velocity = self._turn.T @ self._velocity
        x, y, z = self._place.tolist()
        vx, vy, vz = velocity.tolist()
        return Odometry(
            (x, y, z),
            (a.roll, a.pitch, a.yaw),
            (vx, vy, vz),
            tuple(cov[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)].tolist()),
            self._distance,
        )

    def _slid(self, way: Array, yaw: float) -> Array:
        """Return what the feet usually slide in a period [m].

        By the way of a step, smoothed so that the sway within a stride is none.
        """
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn, steps = np.array([[cos, -sin], [sin, cos]]), self._period_s / self._step_s
        self._step_way += self._of_step * (way @ turn / steps - self._step_way)
        return np.asarray(steps * (turn @ self._slide.of_step(*self._step_way)))

    def _standing(self, support: Support | None, heights: Array) -> list[int]:
        """Return which feet stand still: 0 left, 1 right."""
        if support is None:
            self._both = self._late = 0
            return [0, 1]
        if support in _DOUBLE:
            self._both += 1
            self._late = self._both
        else:
            self._both = 0
            if self._late:
                self._late -= 1
                return [int(heights.argmin())]
        return [_STANDS[support]]

    def _located(self, joints: Array, attitude: Attitude) -> tuple[Array, Array]:
        """Return the feet's rotations and ankles from the pelvis, axes of the floor."""
        turn = rotation(attitude.yaw, attitude.pitch, attitude.roll)
        found = posture(self._legs, joints)
        self._turn = turn
        return turn @ found.feet, found.ankles @ turn.T

    def _settle(self, feet: Array, ankles: Array) -> None:
        """Take the parts of the soles that bear weight from now on, and the height."""
        legs = self._legs
        ahead = np.clip(-feet[:, 2, 0] / TIPPED, -1.0, 1.0)
        left = np.clip(-feet[:, 2, 1] / TIPPED, -1.0, 1.0)
        self._pivots[:, 0] = 0.5 * (1.0 + ahead) * legs.sole_front
        self._pivots[:, 0] += 0.5 * (1.0 - ahead) * legs.sole_rear
        self._pivots[:, 1] = left * legs.sole_half_width
        self._pivots[:, 2] = -legs.ankle_height
        self._points = ankles + np.einsum("fij,fj->fi", feet, self._pivots)
        self._place[2] = -self._points[:, 2].min()
        self._ankles = ankles

    def _grow(self, way: Array, turned: float) -> None:
        """Let the errors grow: d(x, y) = R(yaw) way, d yaw; each with its own rate."""
        length = float(np.hypot(*way))
        self._distance += length
        sideways = np.array([-way[1], way[0]])
        self._effect[:, :2] += self._effect[:, 2:] * sideways
        self._effect[0, :2] += SCALE * way
        self._effect[3, :2] += ASIDE * sideways
        self._effect[1, 2] += VEER * length
        self._effect[2, 2] += TURN_SCALE * turned
