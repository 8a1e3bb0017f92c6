"""What a robot's file says of its actuators, joint by joint."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

_BY_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


@dataclass(frozen=True)
class Actuation:
    """What a joint's actuators say."""

    kind: str
    """"position", "motor" or "none"."""
    stiffness: float = 0.0
    """[N m/rad]"""
    damping: float = 0.0
    """Of actuators and joint [N m s/rad]."""
    limit: float = np.inf
    """[N m]"""
    speed: float = np.inf
    """Of set-points [rad/s]."""


def read_actuators(model: Any, joint: int) -> Actuation:
    """Sum up what the actuators of a joint say.

    Args:
        model: the compiled robot.
        joint: id of the joint.
    """
    limit = float(np.abs(model.jnt_actfrcrange[joint]).min())
    limit = limit if model.jnt_actfrclimited[joint] else np.inf
    stiffness = damping = 0.0
    speed, force, kind = np.inf, 0.0, "none"
    for a in range(model.nu):
        if model.actuator_trntype[a] not in _BY_JOINT:
            continue
        if model.actuator_trnid[a, 0] != joint:
            continue
        gear = abs(float(model.actuator_gear[a, 0]))
        affine = model.actuator_biastype[a] == int(mujoco.mjtBias.mjBIAS_AFFINE)
        held = -float(model.actuator_biasprm[a, 1]) if affine else 0.0
        if held > 0.0:
            stiffness += held * gear**2
            kind = "position"
        elif kind == "none":
            kind = "motor"
        damping += gear**2 * (-float(model.actuator_biasprm[a, 2]) if affine else 0.0)
        if model.actuator_dyntype[a] == int(mujoco.mjtDyn.mjDYN_PID):
            slew = float(model.actuator_dynprm[a, 1])
            speed = slew / gear if slew > 0.0 else speed
        force += gear * _force(model, a, held > 0.0)
    if kind != "none":
        limit = min(limit, force)
    damping += float(model.dof_damping[model.jnt_dofadr[joint]])
    return Actuation(kind, stiffness, damping, limit, speed)


def _force(model: Any, actuator: int, position: bool) -> float:
    """Return an actuator's largest force, infinite where nothing bounds it."""
    force = np.inf
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).min())
    fixed = model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED)
    if model.actuator_ctrllimited[actuator] and fixed and not position:
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        force = min(
            force, gain * float(np.abs(model.actuator_ctrlrange[actuator]).min())
        )
    return force
