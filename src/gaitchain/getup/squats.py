"""Squats: poses in which a robot rests on both feet, from the stand down. Ours.

A robot that rises through them stays in balance at each moment, so that rising can be
slow, and comes out alike from wherever it begins.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.optimize import least_squares

from gaitchain.backends.model import ModelBackend
from gaitchain.getup.symmetry import Pair
from gaitchain.messages import Array

_COUNT = 13  # poses, the standing one among them
_BENT = 0.97  # of the knees' range, at most
_OFF = 0.02  # of the CoM's height: how far the CoM may be from where it stands
_UPRIGHT = 0.005  # what the trunk's tilt counts beside the CoM's place [1/rad]


class Pitches(NamedTuple):
    """The three pairs of joints by which both legs bend."""

    hip: Pair
    knee: Pair
    ankle: Pair


class Squats:
    """Poses from the standing one to the deepest squat.

    At each bend of the knees the soles are flat, the CoM is where it is over the feet
    in the stand, and the trunk as upright as hips and ankles allow.
    """

    def __init__(
        self,
        backend: ModelBackend,
        stand: Array,
        limits: tuple[Array, Array],
        feet: list[int],
        pitches: Pitches | None,
    ) -> None:
        """Find them.

        Args:
            backend: the robot, standing.
            stand: (n,) angles of the stand [rad].
            limits: of the joints, (n,) each [rad].
            feet: bodies of both.
            pitches: of the legs; without them the stand is the only squat.
        """
        self._model, self._data = backend.model, mujoco.MjData(backend.model)
        self._data.qpos[:] = backend.data.qpos
        joints = list(backend.in_model.joints)
        self._at = backend.model.jnt_qposadr[joints]
        self._base, self._feet = backend.in_model.base, feet
        self._stand, self._limits = stand, limits
        self._put(stand)
        self._flat = self._data.xmat[feet[0]].reshape(3, 3).copy()
        self._com, self._trunk = self._measured(stand)
        rows = [stand] if pitches is None else self._all(pitches)
        self._rows = np.array(rows)
        sole = float(backend.data.xpos[feet, 2].mean())
        heights = sole + np.array([self._height(row) for row in rows])
        self._high = (heights / heights[0])[::-1]

    def at(self, part: float) -> Array:
        """Return the squat of a part of the deepest one's bend, (n,) [rad]."""
        place = float(np.clip(part, 0.0, 1.0)) * (len(self._rows) - 1)
        below = min(int(place), max(len(self._rows) - 2, 0))
        above = min(below + 1, len(self._rows) - 1)
        first, second = self._rows[below], self._rows[above]
        return np.asarray(first + (place - below) * (second - first))

    def part_of(self, high: float) -> float:
        """Return the part of the squat whose CoM is that high, of a stand's height."""
        parts = np.linspace(1.0, 0.0, len(self._high))
        return float(np.interp(high, self._high, parts))

    def _all(self, pitches: Pitches) -> list[Array]:
        """Return the squats of that way of bending the knees which leads deeper."""
        knee = pitches.knee.left
        begin = self._stand[knee]
        ends = [begin + _BENT * (limit[knee] - begin) for limit in self._limits]
        ways = [self._down(pitches, end) for end in ends]
        return min(ways, key=lambda rows: self._height(rows[-1]))

    def _down(self, pitches: Pitches, end: float) -> list[Array]:
        """Return the squats until the knees end, none is in balance, or none lower."""
        rows = [self._stand]
        for bend in np.linspace(self._stand[pitches.knee.left], end, _COUNT)[1:]:
            row = self._squat(pitches, bend, rows[-1])
            if row is None or self._height(row) >= self._height(rows[-1]):
                break
            rows.append(row)
        return rows

    def _height(self, angles: Array) -> float:
        """Return that of the CoM above the feet, where soles are flat [m]."""
        return float(self._measured(angles)[0][2])

    def _squat(self, pitches: Pitches, bend: float, last: Array) -> Array | None:
        """Return the squat at a bend of the knees; None where none is in balance."""
        knees = self._moved(last, pitches.knee, bend)
        moved = [pitches.hip.left, pitches.ankle.left]

        def bent(angles: Array) -> Array:
            hips = self._moved(knees, pitches.hip, angles[0])
            return self._moved(hips, pitches.ankle, angles[1])

        def off(angles: Array) -> tuple[float, float]:
            com, trunk = self._measured(bent(angles))
            tilt = trunk @ self._trunk.T
            ahead = (com[0] - self._com[0]) / self._com[2]
            return ahead, _UPRIGHT * float(np.arctan2(tilt[0, 2], tilt[2, 2]))

        span = tuple(limit[moved] for limit in self._limits)
        begin = np.clip(last[moved], span[0] + 1e-6, span[1] - 1e-6)
        found = least_squares(off, begin, bounds=span)
        return bent(found.x) if abs(found.fun[0]) < _OFF else None

    def _moved(self, angles: Array, pair: Pair, angle: float) -> Array:
        moved = angles.copy()
        moved[pair.left] = angle
        change = angle - self._stand[pair.left]
        moved[pair.right] = self._stand[pair.right] + pair.sign * change
        return moved

    def _measured(self, angles: Array) -> tuple[Array, Array]:
        """Return the CoM from between the feet and the trunk, where soles are flat."""
        self._put(angles)
        turn = self._flat @ self._data.xmat[self._feet[0]].reshape(3, 3).T
        between = self._data.xpos[self._feet].mean(axis=0)
        com = turn @ (self._data.subtree_com[self._base] - between)
        return com, turn @ self._data.xmat[self._base].reshape(3, 3)

    def _put(self, angles: Array) -> None:
        self._data.qpos[self._at] = angles
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
