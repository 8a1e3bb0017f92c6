"""A robot's joint angles at the poses of its reduced biped. Ours.

Legs of boxes have them in closed form (`robot.joint_angles`). A robot that was read
from a file has legs of any make: its trunk stays upright, its soles level and straight
ahead, the ankle points are where the reduced pose has them, and inverse kinematics
finds the joints. The pelvis is moved along so that the standing robot's CoM, not its
hips, is over the middle of the soles.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_ik import leg_joints
from gaitchain.balance.leg_kinematics import (
    Legs,
    com_from_pelvis,
    legs_of,
    posture,
)
from gaitchain.messages import Array
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import POINTS, points
from gaitchain.robot.robot import Robot

_HIPS = [POINTS.index("support_hip"), POINTS.index("swing_hip")]
_ANKLES = [POINTS.index("support_ankle"), POINTS.index("swing_ankle")]
_MIRROR = np.array([1.0, -1.0, 1.0])
_OFF_LEGS, _OFF_RAD = 0.01, 0.05  # that a foot may be off its place
_SWEEPS = 3  # to find the pelvis whose CoM is over the soles


class Placed(NamedTuple):
    """Joint angles of poses, and how far the feet are off them."""

    angles: Array
    """(..., 2 n) [rad]."""
    off_m: Array
    """(...) the further foot is from its place [m]."""
    off_rad: Array
    """(...) the more tilted or turned foot is from level and ahead [rad]."""


class PoseJoints:
    """Turns poses of the reduced biped into joint angles of its robot."""

    def __init__(self, robot: Robot) -> None:
        """Find where the pelvis has to be over the feet; the trunk stays upright."""
        self.robot, self._legs = robot, legs_of(robot)
        self.ahead = 0.0
        """Pelvis ahead of the reduced biped's hips [m]; 0 for boxes."""
        if not robot.of_boxes:
            self.ahead = self._balanced_pelvis()

    def angles(self, q: Array, left_support: bool) -> Array:
        """Return the joint angles of poses.

        Args:
            q: (..., 7) reduced pose [rad], with the trunk upright.
            left_support: whether the left leg is the support leg.

        Returns:
            (..., 2 n) joint angles, the left leg's first [rad].
        """
        if self.robot.of_boxes:
            return joint_angles(q, left_support)
        return self.place(q, left_support).angles

    def reached(self, q: Array, left_support: bool) -> Array:
        """Return the joint angles of poses, NaN where a leg cannot place its foot.

        Arguments are those of `angles`.
        """
        if self.robot.of_boxes:
            return joint_angles(q, left_support)
        angles, off_m, off_rad = self.place(q, left_support)
        far = _OFF_LEGS * self._legs.leg
        held = (off_m <= far) & (off_rad <= _OFF_RAD)
        return np.where(held[..., None], angles, np.nan)

    def place(self, q: Array, left_support: bool) -> Placed:
        """Return the joint angles of poses, and how far the feet are off them.

        Arguments are those of `angles`.
        """
        targets = self._ankles(q, left_support).reshape(-1, 2, 3)
        angles, off_m, off_rad = _solve(self._legs, np.ascontiguousarray(targets))
        shape = q.shape[:-1]
        return Placed(
            angles.reshape(*shape, -1), off_m.reshape(shape), off_rad.reshape(shape)
        )

    def _ankles(self, q: Array, left_support: bool) -> Array:
        """Return the left and the right ankle in the pelvis frame, (..., 2, 3) [m]."""
        at = points(self.robot.reduced, q)
        pelvis = at[..., _HIPS, :].mean(axis=-2, keepdims=True)
        ankles = at[..., _ANKLES, :] - pelvis
        ankles[..., 0] -= self.ahead
        placed = ankles if left_support else (ankles * _MIRROR)[..., ::-1, :]
        return np.asarray(placed)

    def _balanced_pelvis(self) -> float:
        """Return how far the pelvis is ahead as the CoM is over the soles' middle [m].

        The robot stands on both feet at the height of its own standing pose.
        """
        legs, soles = self._legs, self.robot.reduced.sole_offset
        stand = posture(legs, legs.start.copy())
        feet = stand.ankles.copy()
        ahead = 0.0
        for _ in range(_SWEEPS):
            feet[:, 0] = -ahead
            joints = _solve(legs, feet[None])[0][0]
            com = com_from_pelvis(legs, posture(legs, joints))
            ahead = float(soles - com[0])
        return ahead


@compiled
def _solve(legs: Legs, ankles: Array) -> tuple[Array, Array, Array]:
    """Place level feet; each pose is solved from the robot's standing pose.

    Args:
        legs: the robot.
        ankles: (N, 2, 3) ankle points in the pelvis frame [m].

    Returns:
        (N, 2 n) joint angles [rad], (N,) how far a foot is off [m] and [rad].
    """
    poses, count = ankles.shape[0], legs.link_mass.shape[1]
    angles = np.empty((poses, 2 * count))
    off_m, off_rad = np.zeros(poses), np.zeros(poses)
    level, start = np.eye(3), legs.start.copy()
    for n in range(poses):
        for leg in range(2):
            own = slice(count * leg, count * (leg + 1))
            angles[n, own] = leg_joints(legs, leg, ankles[n, leg], level, start[own])
        found = posture(legs, angles[n])
        for leg in range(2):
            for i in range(3):
                off = abs(found.ankles[leg, i] - ankles[n, leg, i])
                off_m[n] = max(off_m[n], off)
                for k in range(3):
                    tilt = abs(found.feet[leg, i, k] - level[i, k])
                    off_rad[n] = max(off_rad[n], tilt)
    return angles, off_m, off_rad
