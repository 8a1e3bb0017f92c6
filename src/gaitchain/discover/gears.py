"""Gears: motors that turn a leg's joint by way of a joint of their own. Ours.

Some files model a motor beside the joint that it turns, and couple the two by an
equality, q = a + r q_motor. Walking needs a servo at the joint itself: the actuator is
moved there, geared by 1 / r, with the rotor's inertia and friction as the joint feels
them, and the motor's joint follows.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.discover.ranges import BY_JOINT

_EQ = mujoco.mjtEq
_HINGE = mujoco.mjtJoint.mjJNT_HINGE


class _Gear(NamedTuple):
    """A motor's joint, what it turns, and the equality that ties them."""

    motor: Any
    turned: Any
    equality: Any
    offset: float
    """a of q - q_0 = a + r (q_motor - q_motor,0), as the equality has it [rad]."""
    ratio: float
    """r of it."""

    @property
    def shift(self) -> float:
        """The a of q = a + r q_motor, of absolute angles [rad]."""
        return float(self.turned.ref + self.offset - self.ratio * self.motor.ref)


def fold_gears(spec: Any) -> list[str]:
    """Move actuators from the motors behind gears to the joints that they turn.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.

    Returns:
        A note for each gear.
    """
    notes = []
    for tie in [e for e in spec.equalities if e.type == _EQ.mjEQ_JOINT and e.active]:
        gear = _gear_of(spec, tie)
        if gear is not None:
            notes.append(_told(gear))
            _fold(spec, gear)
    return notes


def _told(gear: _Gear) -> str:
    angle = f"(target - {gear.shift:.4g})" if gear.shift else "target"
    return (
        f"{gear.turned.name} is turned by {gear.motor.name} through a gear of "
        f"{gear.ratio:.4g}: targets are those of {gear.turned.name}; the motor's are "
        f"{angle} / {gear.ratio:.4g}."
    )


def _gear_of(spec: Any, tie: Any) -> _Gear | None:
    """Return the gear that an equality stands for, if it is one."""
    joints = [spec.joint(name) if name else None for name in (tie.name1, tie.name2)]
    offset, ratio, *curved = (float(a) for a in tie.data[:5])
    if None in joints or ratio == 0.0 or any(curved) or not np.isfinite(offset + ratio):
        return None
    follower, leader = joints
    if _is_motor(spec, leader) and not driven_by(spec, follower):
        return _Gear(leader, follower, tie, offset, ratio)
    if _is_motor(spec, follower) and not driven_by(spec, leader):
        return _Gear(follower, leader, tie, -offset / ratio, 1.0 / ratio)
    return None


def _is_motor(spec: Any, joint: Any) -> bool:
    """Whether a joint is driven, and nothing but its own body moves with it."""
    body = joint.parent
    alone = len(body.joints) == 1 and not body.find_all(mujoco.mjtObj.mjOBJ_BODY)
    return joint.type == _HINGE and alone and bool(driven_by(spec, joint))


def driven_by(spec: Any, joint: Any) -> list[Any]:
    """Return the actuators of a joint of a `mujoco.MjSpec`."""
    own = [a for a in spec.actuators if a.target == joint.name]
    return [a for a in own if a.trntype in BY_JOINT]


def _fold(spec: Any, gear: _Gear) -> None:
    motor, turned, ratio = gear.motor, gear.turned, gear.ratio
    for actuator in driven_by(spec, motor):
        actuator.target = turned.name
        actuator.gear = np.asarray(actuator.gear) / ratio
    turned.armature += motor.armature / ratio**2
    turned.damping = np.asarray(turned.damping) + np.asarray(motor.damping) / ratio**2
    turned.frictionloss += motor.frictionloss / abs(ratio)
    if any(motor.actfrcrange) and not any(turned.actfrcrange):
        turned.actfrcrange = np.sort(np.asarray(motor.actfrcrange) / ratio)
    if any(motor.range) and not any(turned.range):
        turned.range = np.sort(gear.shift + ratio * np.asarray(motor.range))
    motor.armature, motor.frictionloss = 0.0, 0.0
    motor.damping = np.zeros_like(np.asarray(motor.damping))
    gear.equality.name1, gear.equality.name2 = motor.name, turned.name
    data = np.array(gear.equality.data)
    data[:2] = -gear.offset / ratio, 1.0 / ratio
    gear.equality.data = data
