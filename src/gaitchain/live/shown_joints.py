"""The joints of a robot as they are drawn, where some were not measured."""

import numpy as np

from gaitchain.live.messages import Telemetry
from gaitchain.messages import Array


def shown_joints(telemetry: Telemetry, stand: Array) -> Array:
    """Return joint angles (2 n,), of the target or a stand where unknown [rad].

    Args:
        telemetry: of now.
        stand: (2 n,) standing pose [rad].
    """
    joints = stand
    for angles in (telemetry.joint_target, telemetry.joint_position):
        values = np.array(angles, dtype=np.float64)
        if values.shape == joints.shape:
            joints = np.where(np.isfinite(values), values, joints)
    return joints
