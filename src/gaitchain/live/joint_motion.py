"""Slow moves from pose to pose, and the limits of joint targets."""

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel

SLOW = 0.5
"""How fast joints go to the standing pose when nobody balances [rad/s]."""
_COUNT = np.radians(0.1)  # servos' limits are rounded inward to their counts


class SmoothMove:
    """A move of all joints in one time, from rest to rest, within a speed."""

    def __init__(self, start: Array, end: Array, speed: float = SLOW) -> None:
        """Plan the move.

        Args:
            start: (2 n,) [rad].
            end: (2 n,) [rad].
            speed: of the joint that has to go furthest, at most [rad/s].
        """
        self._start, self._change = np.array(start), end - start
        self._duration_s = max(1.5 * float(np.abs(self._change).max()) / speed, 1e-9)

    def at(self, time_s: float) -> Array:
        """Return the joint angles so long after the start (2 n,) [rad]."""
        part = min(max(time_s / self._duration_s, 0.0), 1.0)
        return np.asarray(self._start + self._change * part**2 * (3.0 - 2.0 * part))

    def done(self, time_s: float) -> bool:
        """Return whether the end is reached."""
        return time_s >= self._duration_s


class JointLimiter:
    """Keep targets, as encoders show them, inside the joints' ranges and speeds."""

    def __init__(
        self,
        legs: LegModel,
        period_s: float,
        servos: tuple[Array, Array] | None = None,
        offset: Array | float = 0.0,
    ) -> None:
        """Take a robot's limits.

        Args:
            legs: names, ranges and speeds of the joints.
            period_s: control period [s].
            servos: (2 n,) lower and upper ends of what its servos take [rad]; None
                where they take any angle.
            offset: (2 n,) what encoders show more than the joints' angles [rad].
        """
        self._offset = np.broadcast_to(offset, np.shape(legs.lower))
        self._lower, self._upper = legs.lower + offset, legs.upper + offset
        if servos is not None:  # which would cut targets without a word
            self._lower = np.maximum(self._lower, servos[0])
            self._upper = np.minimum(self._upper, servos[1])
        self._most = np.asarray(legs.speed_limit) * period_s
        self._names = legs.joint_names

    def limit(self, target: Array, before: Array) -> tuple[Array, str]:
        """Return the target inside the limits, and which joint was limited.

        Args:
            target: (2 n,) [rad].
            before: (2 n,) target of the period before [rad].
        """
        target = np.where(np.isfinite(target), target, before)
        # A joint that begins outside its range comes back in at its speed, too.
        low, high = np.minimum(self._lower, before), np.maximum(self._upper, before)
        kept = np.clip(target, low, high)
        kept = np.clip(kept, before - self._most, before + self._most)
        return kept, self.beyond(target)

    def beyond(self, target: Array) -> str:
        """Return which joint a target (2 n,) would take out of its range [rad]."""
        off = np.maximum(self._lower - target, target - self._upper)
        if not (off > _COUNT).any():
            return ""
        joint = int(np.argmax(off > _COUNT))
        shown = np.array([target[joint], self._lower[joint], self._upper[joint]])
        angle, lower, upper = np.degrees(shown - self._offset[joint])
        return (
            f"{self._names[joint]} was to go to {angle:.0f} deg, "
            f"its range is {lower:.0f} to {upper:.0f}"
        )
