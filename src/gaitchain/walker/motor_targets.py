"""Joint targets in the form that motor drivers take. Ours.

A position servo of stiffness kp and damping kv on a joint with damping d, sent
q_target = q_ref + (tau + (kv + d) q'_ref) / kp, pushes as a driver does that is given
q_ref, q'_ref, tau + d q'_ref, kp and kd = kv. A motor that turns at w with the load
has (1 - w / w_0) of its torque left, up to its no-load speed w_0.
"""

import numpy as np

from gaitchain.balance.feedforward import Effort
from gaitchain.messages import Array, MotorTargets
from gaitchain.robot.leg_model import LegModel

NO_LOAD = 1.5
"""No-load speed over the speed limit: of the slowest servos that training has."""


class MotorForm:
    """Makes `MotorTargets` of the targets of position servos."""

    def __init__(self, legs: LegModel) -> None:
        """Take the servos' gains and limits."""
        self._stiffness, self._passive = legs.stiffness, legs.joint_damping
        self._damping, self._limit = (
            legs.damping - legs.joint_damping,
            legs.torque_limit,
        )
        self._no_load = NO_LOAD * legs.speed_limit
        self._none = np.zeros(len(legs.joint_names))

    def made(self, position: Array, effort: Effort | None) -> MotorTargets:
        """Return targets for motor drivers.

        Args:
            position: (2 n,) targets of position servos [rad].
            effort: that they include; None where they are angles alone, as those of
                key poses and of a robot that stands.
        """
        velocity, torque = self._none, self._none
        if effort is not None:
            velocity = effort.velocity
            torque = effort.torque + self._passive * velocity
        ahead = (torque + self._damping * velocity) / self._stiffness
        return MotorTargets(
            position=position - ahead,
            velocity=velocity,
            torque=self._limited(torque, velocity),
            stiffness=self._stiffness,
            damping=self._damping,
        )

    def _limited(self, torque: Array, velocity: Array) -> Array:
        """Return what of torques the motors have at these speeds."""
        with_load = np.maximum(velocity * np.sign(torque), 0.0)
        most = self._limit * np.maximum(1.0 - with_load / self._no_load, 0.0)
        return torque.clip(-most, most)
