"""Ranges of joints: their own, and of what their position servos can be told."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT

_AFFINE = int(mujoco.mjtBias.mjBIAS_AFFINE)
_PID = int(mujoco.mjtGain.mjGAIN_PID)
_INTEGRATOR = mujoco.mjtDyn.mjDYN_INTEGRATOR
_LIMITED = mujoco.mjtLimited
_SAME = 0.01  # rad: ends less far apart, as 3.14 and pi, are the same


def joint_range(model: Any, joint: int) -> tuple[float, float]:
    """Return between which positions a joint can be sent.

    Half a turn to either side where it has no range; no further than its position
    servos' set-points, unless these leave nothing of it.

    Args:
        model: the `mujoco.MjModel`.
        joint: id of a hinge or slide.
    """
    low, high = own_range(model, joint)
    for least, most in _set_points(model, joint):
        if max(low, least) < min(high, most):
            low = least if least > low + _SAME else low
            high = most if most < high - _SAME else high
    return low, high


def own_range(model: Any, joint: int) -> tuple[float, float]:
    """Return a joint's range, half a turn to either side where it has none."""
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint]
        return float(low), float(high)
    at = float(model.qpos0[model.jnt_qposadr[joint]])
    return at - np.pi, at + np.pi


def is_narrowed(model: Any, joint: int) -> bool:
    """Whether a joint's position servos cannot be sent over all of its range."""
    return joint_range(model, joint) != own_range(model, joint)


def _set_points(model: Any, joint: int) -> Iterator[tuple[float, float]]:
    """Yield the joint's positions at both ends of each position servo's set-point."""
    of_joint = np.isin(model.actuator_trntype, BY_JOINT)
    of_joint &= model.actuator_trnid[:, 0] == joint
    affine = model.actuator_biastype == _AFFINE
    for a in np.flatnonzero(of_joint & affine & model.actuator_ctrllimited):
        constant, slope = model.actuator_biasprm[a, :2]
        gear = model.actuator_gear[a, 0]
        if slope >= 0.0 or gear == 0.0:
            continue
        # A PID has its gain in its bias alone: set-points are lengths.
        pid = model.actuator_gaintype[a] == _PID
        gain = -slope if pid else model.actuator_gainprm[a, 0]
        ends = (gain * model.actuator_ctrlrange[a] + constant) / (-slope * gear)
        yield float(ends.min()), float(ends.max())


def is_limited(limited: Any, span: Any) -> bool:
    """Return whether a span of a `mujoco.MjSpec` limits, (2,), with its flag."""
    auto = limited == _LIMITED.mjLIMITED_AUTO and span[0] < span[1]
    return bool(limited == _LIMITED.mjLIMITED_TRUE or auto)


def inherit_range(actuator: Any, span: Any) -> None:
    """Give an actuator of a `mujoco.MjSpec` the range that it inherits, if it does.

    Args:
        actuator: changed in place; on what it is put next it has the same range.
        span: (2,) range of what it is on.
    """
    if not actuator.inheritrange:
        return
    middle, half = np.mean(span), 0.5 * np.ptp(span)
    ends = middle + actuator.inheritrange * half * np.array([-1, 1])
    if actuator.dyntype == _INTEGRATOR:
        actuator.actrange = ends
    else:
        actuator.ctrlrange = ends
    actuator.inheritrange = 0.0
