"""The actuators of a user's own MuJoCo model as servos of its joints. Ours."""

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array

BY_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""Transmissions of actuators that drive one joint."""
_STILL = int(mujoco.mjtDyn.mjDYN_NONE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_OF_SET_POINTS = tuple(
    int(getattr(mujoco.mjtDyn, f"mjDYN_{kind}"))
    for kind in ("FILTER", "FILTEREXACT", "PID")
)
_PID = int(mujoco.mjtGain.mjGAIN_PID)
_FIXED, _AFFINE = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_AFFINE)
_SAME = 1e-6
# Of damping: a file may give it as a damping ratio, so that it goes with the errors of
# the links.
_ALIKE = 0.2


class Servo(NamedTuple):
    """A joint's servo, SI units at the joint."""

    stiffness: float
    damping: float
    """Without that of the joint."""
    limit: float
    """Of its torque or force; infinite if it has none."""

    def is_like(self, other: "Servo", passive: float) -> bool:
        """Return whether two servos are the same, on a joint with its own damping."""
        return (
            math.isclose(self.stiffness, other.stiffness, rel_tol=_SAME)
            and math.isclose(self.limit, other.limit, rel_tol=_SAME)
            and math.isclose(
                self.damping + passive, other.damping + passive, rel_tol=_ALIKE
            )
        )


def actuator_name(model: Any, actuator: int) -> str:
    """Return what messages call an actuator: its name, or that of what it drives."""
    name = str(model.actuator(actuator).name)
    if not name and model.actuator_trntype[actuator] in BY_JOINT:
        return f"of joint {model.joint(model.actuator_trnid[actuator, 0]).name!r}"
    return repr(name or actuator)


def joint_stiffness(model: Any, actuator: int) -> float:
    """Return a position servo's stiffness at the joint; 0 for other actuators."""
    return _bias(model, actuator, 1)


def joint_servo(model: Any, actuators: Array) -> Servo:
    """Return what a joint's actuators are together."""
    stiffness = [joint_stiffness(model, actuator) for actuator in actuators]
    return Servo(
        stiffness=float(sum(stiffness)),
        damping=float(sum(_bias(model, actuator, 2) for actuator in actuators)),
        limit=_torque_limit(model, actuators),
    )


class SetPoints(NamedTuple):
    """How servos are told joint angles: scale * angle + offset."""

    scale: Array
    """(n,) set-point by joint angle; not 1 where there are gears, degrees or shares of
    a range."""
    offset: Array
    """(n,) set-point of the joint's angle 0."""

    def of(self, angles: Array) -> Array:
        """Return the set-points of joint angles (n,) [rad]."""
        return np.asarray(self.scale * angles + self.offset)


def set_points(model: Any, actuators: Array) -> SetPoints:
    """Return at which set-points servos hold joint angles.

    Args:
        model: the `mujoco.MjModel`.
        actuators: (n,) position servos. Their torque is gain * set-point + constant -
            held * length, where the length is the gear times the joint's angle.

    Raises:
        CommandError: a set-point is no angle.
    """
    rates = model.actuator_dyntype[actuators] == _INTEGRATOR
    if rates.any():
        name = actuator_name(model, int(actuators[np.argmax(rates)]))
        raise CommandError(
            f"the model's actuator {name} takes a speed, not an angle; make it a "
            "<position/>"
        )
    constant, held = model.actuator_biasprm[actuators, :2].T * [[1.0], [-1.0]]
    gains = model.actuator_gainprm[actuators, 0]
    gains = np.where(gains, gains, held)  # a PID has none: its set-points are angles
    gears = model.actuator_gear[actuators, 0]
    return SetPoints(gears * (held / gains), -constant / gains)


def make_servo(model: Any, joint: int, actuators: Array, servo: Servo) -> None:
    """Turn a joint's actuators into one servo whose set-point is the joint's angle.

    torque = stiffness (target - angle) - damping rate, at the joint.

    Args:
        model: changed in place.
        joint: the joint.
        actuators: of it; nothing is left of all but the stiffest.
        servo: what they become.

    Raises:
        CommandError: the actuator turns nothing, or has dynamics that such a servo has
            not.
    """
    first = max(actuators, key=lambda a: (joint_stiffness(model, a), _gear(model, a)))
    _check_memory(model, first, servo)
    gear = float(model.actuator_gear[first, 0])
    if gear == 0.0:
        raise CommandError(
            f"the model's actuator {actuator_name(model, first)} turns nothing with "
            "gear 0; give it another one, MuJoCo's default is 1"
        )
    is_pid = model.actuator_gaintype[first] == _PID  # has its gains in its bias alone
    for part in (model.actuator_gainprm, model.actuator_biasprm):
        part[actuators] = 0.0
    model.actuator_gaintype[actuators] = _FIXED  # of the others nothing is left
    model.actuator_biastype[actuators] = _AFFINE
    if is_pid:
        model.actuator_gaintype[first] = _PID
    else:
        model.actuator_gainprm[first, 0] = servo.stiffness / gear
    bias = -servo.stiffness / gear**2, -servo.damping / gear**2
    model.actuator_biasprm[first, 1:3] = bias
    model.actuator_ctrllimited[first] = False
    if math.isfinite(servo.limit):
        both = np.array([-1.0, 1.0]) * servo.limit
        model.actuator_forcelimited[first] = True
        model.actuator_forcerange[first] = both / abs(gear)
    if (np.abs(model.jnt_actfrcrange[joint]) < servo.limit).any():
        model.jnt_actfrclimited[joint] = False  # the servo's own limit holds


def _check_memory(model: Any, actuator: int, servo: Servo) -> None:
    """Refuse dynamics that a servo with other gains would not have."""
    kind = int(model.actuator_dyntype[actuator])
    if kind == _STILL or (kind in _OF_SET_POINTS and joint_stiffness(model, actuator)):
        return
    raise CommandError(
        f"the model's actuator {actuator_name(model, actuator)} has dynamics of its "
        f"own and not the library's gains; give it {servo.stiffness:.4g} N m/rad, "
        f"{servo.damping:.4g} N m s/rad and a limit of {servo.limit:.4g} N m, or make "
        "it a <motor/>"
    )


def _gear(model: Any, actuator: int) -> float:
    return abs(float(model.actuator_gear[actuator, 0]))


def _bias(model: Any, actuator: int, order: int) -> float:
    """Return the stiffness (order 1) or damping (2) of an actuator at the joint."""
    if model.actuator_biastype[actuator] != _AFFINE:
        return 0.0
    held = max(-float(model.actuator_biasprm[actuator, order]), 0.0)
    return held * _gear(model, actuator) ** 2


def _torque_limit(model: Any, actuators: Array) -> float:
    """Return the torque limit of a joint's servo, infinite if it has none.

    Where some actuators take set-points, others beside them only damp.
    """
    servos = [actuator for actuator in actuators if joint_stiffness(model, actuator)]
    limit = sum(_force(model, actuator) for actuator in servos or actuators)
    joint = model.actuator_trnid[actuators[0], 0]
    if model.jnt_actfrclimited[joint]:
        limit = min(limit, float(np.abs(model.jnt_actfrcrange[joint]).min()))
    return float(limit)


def _force(model: Any, actuator: int) -> float:
    """Return an actuator's torque limit at the joint, infinite if it has none."""
    force = math.inf
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).min())
    if model.actuator_ctrllimited[actuator] and not joint_stiffness(model, actuator):
        most = float(np.abs(model.actuator_ctrlrange[actuator]).min())
        force = min(force, abs(float(model.actuator_gainprm[actuator, 0])) * most)
    return _gear(model, actuator) * force
