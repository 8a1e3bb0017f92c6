"""Convert joint angles to servo counts and back: signs, offsets, limits. No I/O."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.servos.calibration import TURN_DEG, JointCalibration
from gaitchain.backends.servos.make import Make
from gaitchain.backends.servos.table import COUNTS, DEG_PER_COUNT
from gaitchain.messages import Array

Counts = NDArray[np.int64]
_RAD_PER_COUNT = math.radians(DEG_PER_COUNT)
_TURN = 2.0 * math.pi


class ServoAngles:
    """The conversion for the joints of one bus, in the order of the arrays (n,)."""

    def __init__(self, joints: Sequence[JointCalibration], make: Make) -> None:
        """Compute signs, offsets and limits from the joints' calibrations."""
        self._rad_s_per_count = make.rad_s_per_count
        self.sign: Array = np.array([float(joint.sign) for joint in joints])
        self.lower: Array = np.radians([joint.lower for joint in joints])
        self.upper: Array = np.radians([joint.upper for joint in joints])
        self._zero = np.radians([joint.offset for joint in joints])
        self._middle = 0.5 * (self.lower + self.upper)
        ranges = np.array([joint.servo_range for joint in joints]).reshape(-1, 2)
        # Round inward, so that no count lies outside the limits.
        low, high = ranges.T / DEG_PER_COUNT
        self.lowest: Counts = np.ceil(low - 1e-6).astype(np.int64)
        self.highest: Counts = np.floor(high + 1e-6).astype(np.int64)
        self.narrow(np.zeros(len(joints)), np.full(len(joints), COUNTS - 1))

    def narrow(self, lowest: Array, highest: Array) -> None:
        """Narrow the limits to the servos' own position limits (n,) in counts."""
        self.lowest = np.maximum(self.lowest, lowest.astype(np.int64))
        self.highest = np.minimum(self.highest, highest.astype(np.int64))

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper ends (n,) of the joint angles that goals can have [rad]."""
        ends = np.array([self.lowest, self.highest]) * _RAD_PER_COUNT - self._zero
        low, high = np.sort(self.sign * ends, axis=0)
        return np.asarray(low), np.asarray(high)

    def positions(self, counts: Array) -> Array:
        """Return joint angles (n,) [rad] from positions in counts; NaN stays NaN.

        A limp servo that is turned past its zero counts beyond one turn, so the turn
        nearest to the joint's range is taken.
        """
        return np.asarray(
            self._unturned(counts) - _TURN * self._turns(counts), dtype=float
        )

    def beyond_zero(self, counts: Array) -> NDArray[np.bool_]:
        """Return which servos (n,) are not in the one turn that goals are of.

        In position mode a servo does not turn over its zero: from such a position it
        would turn all the way round to its goal.
        """
        outside = (counts < 0) | (counts >= COUNTS)
        return np.asarray(outside | (self._turns(counts) != 0.0))

    def _unturned(self, counts: Array) -> Array:
        return np.asarray(self.sign * (counts * _RAD_PER_COUNT - self._zero))

    def _turns(self, counts: Array) -> Array:
        return np.round((self._unturned(counts) - self._middle) / _TURN)

    def velocities(self, counts: Array) -> Array:
        """Return joint velocities (n,) [rad/s] from velocities in counts."""
        return np.asarray(self.sign * counts * self._rad_s_per_count)

    def goals(self, position: Array) -> Counts:
        """Return goals (n,) in counts, clipped to the limits, of joint angles [rad].

        The angles must be finite.
        """
        counts = np.round((self._zero + self.sign * position) / _RAD_PER_COUNT)
        return np.clip(counts, self.lowest, self.highest).astype(np.int64)


def shortest_turn_deg(start: Array, end: Array) -> Array:
    """Return the signed shortest turn between two positions in counts [deg]."""
    turned = (end - start) * DEG_PER_COUNT
    half = TURN_DEG / 2.0
    return np.asarray((turned + half) % TURN_DEG - half)
