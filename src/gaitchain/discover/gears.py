"""Gears: motors that turn a leg's joint by way of a joint of their own. Ours.

Some files model a motor beside the joint that it turns, and couple the two by an
equality, q = a + r q_motor. Walking needs a servo at the joint itself: the actuator is
moved there, geared by 1 / r, with the rotor's inertia and friction as the joint feels
them, and the motor's joint follows. An equality that keeps the length of a fixed tendon
over both joints, as of a belt, says the same, and is written so first.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.discover.notes import Doubt
from gaitchain.discover.ranges import inherit_range, is_limited
from gaitchain.discover.tendons import is_over_joint
from gaitchain.messages import Array

_EQ = mujoco.mjtEq
_AFFINE = mujoco.mjtBias.mjBIAS_AFFINE
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
        A note for each gear, and a doubt for each motor that turns a joint otherwise.
    """
    notes: list[str] = []
    _write_as_joints(spec)
    for tie in [e for e in spec.equalities if e.type == _EQ.mjEQ_JOINT and e.active]:
        pair = _driven_pair(spec, tie)
        gear = pair and _gear_of(tie, *pair)
        if gear:
            notes.append(_told(gear))
            _fold(spec, gear)
        elif pair and any(tie.data[2:5]):
            notes.append(_doubted(*pair))
    return notes


def _write_as_joints(spec: Any) -> None:
    """Turn equalities of fixed tendons that tie two joints into those of joints."""
    tendons = {tendon.name: tendon for tendon in spec.tendons}
    for tie in [e for e in spec.equalities if e.type == _EQ.mjEQ_TENDON]:
        own = [tendons[name] for name in (tie.name1, tie.name2) if name in tendons]
        parts = [part for tendon in own for part in tendon.path]
        if len(parts) != 2 or not all(map(is_over_joint, parts)):
            continue
        one, other = (float(part.coef) for part in parts)
        curve = np.array(tie.data[:5])
        if len(own) == 1:  # over both: its length is kept
            curve = np.array([curve[0], -1.0, 0.0, 0.0, 0.0])
        data = np.array(tie.data)
        data[:5] = curve * other ** np.arange(5) / one
        tie.type, tie.objtype = _EQ.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
        tie.data = data
        tie.name1, tie.name2 = (part.target.name for part in parts)


def _doubted(motor: Any, turned: Any) -> Doubt:
    return Doubt(
        f"{turned.name} is coupled to {motor.name} by a curve, which is no gear, and "
        "is held: an equality of a constant ratio would let walking turn it."
    )


def _told(gear: _Gear) -> str:
    angle = f"(target - {gear.shift:.4g})" if gear.shift else "target"
    return (
        f"{gear.turned.name} is turned by {gear.motor.name} through a gear of "
        f"{gear.ratio:.4g}: targets are those of {gear.turned.name}; the motor's are "
        f"{angle} / {gear.ratio:.4g}."
    )


def _driven_pair(spec: Any, tie: Any) -> tuple[Any, Any] | None:
    """Return the motor's joint and the one that it turns, if an equality ties such."""
    joints = [spec.joint(name) if name else None for name in (tie.name1, tie.name2)]
    if None in joints:
        return None
    for motor, turned in (joints[::-1], joints):
        if _is_motor(spec, motor) and not driven_by(spec, turned):
            return motor, turned
    return None


def _gear_of(tie: Any, motor: Any, turned: Any) -> _Gear | None:
    """Return the gear that an equality stands for, if its ratio is constant."""
    offset, ratio, *curved = (float(a) for a in tie.data[:5])
    if ratio == 0.0 or any(curved) or not np.isfinite(offset + ratio):
        return None
    if tie.name1 == turned.name:
        return _Gear(motor, turned, tie, offset, ratio)
    return _Gear(motor, turned, tie, -offset / ratio, 1.0 / ratio)


def _is_motor(spec: Any, joint: Any) -> bool:
    """Whether a joint is driven, and no other joint moves with it."""
    body = joint.parent
    below = body.find_all(mujoco.mjtObj.mjOBJ_BODY)  # a pulley is welded to it
    alone = len(body.joints) == 1 and not any(child.joints for child in below)
    return joint.type == _HINGE and alone and bool(driven_by(spec, joint))


def driven_by(spec: Any, joint: Any) -> list[Any]:
    """Return the actuators of a joint of a `mujoco.MjSpec`."""
    own = [a for a in spec.actuators if a.target == joint.name]
    return [a for a in own if a.trntype in BY_JOINT]


def _fold(spec: Any, gear: _Gear) -> None:
    motor, turned, ratio = gear.motor, gear.turned, gear.ratio
    for actuator in driven_by(spec, motor):
        _move(actuator, gear)
    turned.armature += motor.armature / ratio**2
    turned.damping = np.asarray(turned.damping) + np.asarray(motor.damping) / ratio**2
    turned.frictionloss += motor.frictionloss / abs(ratio)
    if is_limited(motor.actfrclimited, motor.actfrcrange):
        ends = np.asarray(motor.actfrcrange) / ratio
        _narrow(turned, "actfrcrange", "actfrclimited", ends)
    if is_limited(motor.limited, motor.range):
        ends = gear.shift + ratio * np.asarray(motor.range)
        _narrow(turned, "range", "limited", ends)
    motor.armature, motor.frictionloss = 0.0, 0.0
    motor.damping = np.zeros_like(np.asarray(motor.damping))
    gear.equality.name1, gear.equality.name2 = motor.name, turned.name
    data = np.array(gear.equality.data)
    data[:2] = -gear.offset / ratio, 1.0 / ratio
    gear.equality.data = data


def _move(actuator: Any, gear: _Gear) -> None:
    """Put an actuator of the motor on what it turns; its controls stay what they are.

    Where the motor is at 0 the joint is at the shift, by which the actuator's length
    grows: what it held at a length, it holds at that much more.
    """
    inherit_range(actuator, gear.motor.range)
    actuator.target = gear.turned.name
    actuator.gear = np.asarray(actuator.gear) / gear.ratio
    if actuator.biastype == _AFFINE:
        longer = actuator.gear[0] * gear.shift
        actuator.biasprm[0] -= actuator.biasprm[1] * longer


def _narrow(joint: Any, span: str, limited: str, ends: Array) -> None:
    """Limit a joint to a span within its own, unless that would leave nothing."""
    low, high = float(ends.min()), float(ends.max())
    if is_limited(getattr(joint, limited), getattr(joint, span)):
        least, most = getattr(joint, span)
        low, high = max(low, least), min(high, most)
    if low < high:
        setattr(joint, span, [low, high])
        setattr(joint, limited, mujoco.mjtLimited.mjLIMITED_TRUE)
