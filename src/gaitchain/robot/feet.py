"""Where the feet are, seen from the pelvis, for what watches a robot. In NumPy.

What drives it locates its legs by `balance.leg_kinematics.posture`, machine code that
takes half a second to load: too long for a process that draws or logs.
"""

from typing import NamedTuple

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel


class Feet(NamedTuple):
    """Both feet in the pelvis frame, the left one first."""

    ankles: Array
    """(2, 3) [m]"""
    turns: Array
    """(2, 3, 3) rotations of the soles."""


class FootFinder:
    """Locates the feet of one robot."""

    def __init__(self, legs: LegModel) -> None:
        """Take the legs."""
        self._at, self._foot_at = legs.at[..., None], legs.foot_at[..., None]
        self._foot_turn = legs.foot_turn
        # (2, n, 3, 3) [a]x, whose row i is e_i x a.
        self._across = np.cross(np.eye(3), legs.axis[..., None, :])
        self._along = self._across @ self._across

    def find(self, joints: Array) -> Feet:
        """Locate the feet.

        Link by link of R = I + sin q [a]x + (1 - cos q) [a]x^2, Rodrigues' formula.

        Args:
            joints: (2 n,) joint angles [rad].
        """
        angles = np.reshape(joints, (2, -1, 1, 1))
        turns = np.eye(3) + np.sin(angles) * self._across
        turns += (1.0 - np.cos(angles)) * self._along
        turn, at = turns[:, 0], self._at[:, 0]
        for joint in range(1, turns.shape[1]):
            at = at + turn @ self._at[:, joint]
            turn = turn @ turns[:, joint]
        at = at + turn @ self._foot_at
        return Feet(at[..., 0], turn @ self._foot_turn)
