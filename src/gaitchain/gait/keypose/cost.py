"""The planned cost of gaits (Eq. 3), batched: ZMP displacement and landing impact."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gaitchain.gait.keypose.impact import velocity_jump
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.motion import State, Timing, end_accelerations
from gaitchain.gait.zmp import desired_zmp, zmp
from gaitchain.messages import Array
from gaitchain.robot.kinematics import exchange_roles
from gaitchain.robot.robot import Robot

Gaits = NDArray[np.int64]
_CHUNK = 500  # gaits per batch: fastest when a batch fits the CPU cache


def saturate(displacement: ArrayLike, scale: float) -> Array:
    """Map a sum of squares to [0, 1]: aleph of Eq. 3, f = 1 - exp(-S / S0).

    Ours: the paper does not define aleph (row 8 of `docs/paper_map.md`). Beyond S = 37
    S0 the result rounds to exactly 1.

    Args:
        displacement: S >= 0.
        scale: S0 > 0, at which f = 0.63.

    Returns:
        Costs of the same shape.
    """
    return np.asarray(-np.expm1(-np.asarray(displacement, dtype=float) / scale))


def zmp_scale(robot: Robot) -> float:
    """Return S0 [m^2]: the ZMP half a sole's length off at all four key moments."""
    return 4.0 * (0.5 * robot.reduced.sole_length) ** 2


@dataclass(frozen=True)
class PlannedCost:
    """Eq. 3 on the planned motion, without physics."""

    poses: KeyPoses
    timing: Timing
    impact_weight: float = 0.1
    """Weight of the landing impact; with 0 the cost is Eq. 3 as printed."""
    impact_scale: float = 1.0
    """Velocity jump whose weighted square adds `impact_weight` S0 [rad/s]."""

    def __call__(self, gaits: Gaits) -> Array:
        """Compute the cost of each gait.

        Args:
            gaits: (..., 4) pose indices.

        Returns:
            (...) costs in [0, 1].
        """
        gaits = np.asarray(gaits)
        flat = gaits.reshape(-1, 4)
        parts = [
            self._displacement(flat[i : i + _CHUNK])
            for i in range(0, len(flat), _CHUNK)
        ]
        total = np.concatenate(parts) if parts else np.zeros(0)
        return saturate(total, zmp_scale(self.poses.robot)).reshape(gaits.shape[:-1])

    def key_states(self, gaits: Gaits) -> State:
        """Return the state phi = [q, dq, ddq] at each key moment.

        Ours: two Hermite segments have different accelerations at the key moment
        between them; their mean is used. kp_4 and kp_1 are joined as in a gait that
        repeats itself.

        Args:
            gaits: (G, 4) pose indices.

        Returns:
            Pose, velocity and acceleration, each (G, 4, 7).
        """
        layers = range(gaits.shape[-1])
        q = np.stack([self.poses.q[i][gaits[:, i]] for i in layers], axis=1)
        dq = np.stack([self.poses.dq[i][gaits[:, i]] for i in layers], axis=1)
        starts, ends = np.moveaxis(
            end_accelerations(np.array(self.timing.segments), q, dq), 2, 0
        )
        after = np.concatenate([starts, exchange_roles(starts[:, :1])], axis=1)
        before = np.concatenate([exchange_roles(ends[:, -1:]), ends], axis=1)
        return State(q, dq, 0.5 * (before + after))

    @cached_property
    def impact(self) -> Array:
        """Norm of the jump of the joint velocities at heel contact, (N_3, N_4) [rad/s].

        Ours: contact is assumed halfway between kp_3 and kp_4, where the planned foot
        descends fastest.
        """
        h = self.timing.double_support
        (q3, q4), (v3, v4) = self.poses.q[2:], self.poses.dq[2:]
        q3, v3 = q3[:, None], v3[:, None]
        middle = 0.5 * (q3 + q4) + h / 8.0 * (v3 - v4)
        velocity = 1.5 * (q4 - q3) / h - 0.25 * (v3 + v4)
        contact = State(middle, velocity, np.zeros_like(middle))
        jump = velocity_jump(self.poses.robot, contact)
        return np.asarray(np.linalg.norm(jump, axis=-1))

    def _displacement(self, gaits: Gaits) -> Array:
        robot, feet = self.poses.robot, self.poses.foot_x
        desired = desired_zmp(robot, feet[0][gaits[:, 0]], feet[3][gaits[:, 3]])
        total = ((zmp(robot, self.key_states(gaits)) - desired) ** 2).sum(axis=(1, 2))
        if self.impact_weight:
            jump = self.impact[gaits[:, 2], gaits[:, 3]] / self.impact_scale
            total = total + self.impact_weight * zmp_scale(robot) * jump**2
        return np.asarray(total)
