"""Links that overlap as a robot stands. Ours.

A collision shape is often larger than its link: the convex hull of a mesh reaches into
the next link but one, or a hand into the thigh that it hangs beside. Links of the robot
itself do not overlap where it stands, so contacts between them there are not its own.
"""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

_SCALAR = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
_BODY = "gaitchain_body_{}"


def exclude_overlaps(
    spec: Any, positions: Mapping[str, float]
) -> tuple[tuple[str, str], ...]:
    """Let links pass through each other that overlap in a pose.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.
        positions: of its joints by name, hinges [rad], slides [m]; all others are where
            the file has them.

    Returns:
        Names of the two bodies of each such pair.
    """
    for body in spec.bodies[1:]:
        body.name = body.name or _BODY.format(body.id)
    model = spec.compile()
    data = mujoco.MjData(model)
    for joint in map(model.joint, range(model.njnt)):
        if joint.type[0] in _SCALAR and joint.name in positions:
            data.qpos[joint.qposadr[0]] = positions[joint.name]
    mujoco.mj_fwdPosition(model, data)
    deep = data.contact.geom[data.contact.dist < 0.0]
    bodies = np.unique(np.sort(model.geom_bodyid[deep], axis=1), axis=0)
    pairs = tuple((model.body(a).name, model.body(b).name) for a, b in bodies)
    for one, other in pairs:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    return pairs
