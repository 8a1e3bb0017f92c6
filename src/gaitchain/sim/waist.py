"""An upper body on a spring, between it and the hips. Ours.

A simulated trunk is rigid; that of a robot bends at the waist, in its arms and its
frame, most of all where a soft servo holds the waist. The trunk is cut in two parts of
the same mass, CoM and inertia together, joined by a roll and a pitch hinge.
"""

import math
from typing import Any

import mujoco
import numpy as np

from gaitchain.messages import GRAVITY, Array
from gaitchain.sim.rotation import quaternion
from gaitchain.sim.world import World

_UPPER = 0.8  # of the trunk's mass: what is above the waist
_HEIGHT = 0.25  # of the trunk's CoM above the hips: that of the waist
_DEPTH = 0.1  # of the leg, at least: the waist below the trunk's CoM
_ROUND = 0.4  # of the upper body's lever: radius of the lower part, a sphere
_DAMPING = 0.1  # damping ratio of the upper body on its spring
_LEAST = 0.1  # of the trunk's moments: the least ones of the upper part
_BODY = 1.0 + 1e-6  # no body has a moment larger than the sum of the others
AXES = {"waist_roll": (1.0, 0.0, 0.0), "waist_pitch": (0.0, 1.0, 0.0)}
"""Hinges of a waist that gives way; they come after the legs' joints."""


def trunk_parts(world: World) -> dict[str, float]:
    """Return the bodies of the trunk by name, each with its part of the mass."""
    if math.isinf(world.waist):
        return {"trunk": 1.0}
    return {"trunk": 1.0 - _UPPER, "upper": _UPPER}


def split_trunk_at_waist(trunk: Any, leg: float, world: World) -> None:
    """Cut the trunk in two parts, if the world's waist gives way.

    Args:
        trunk: the body with the free joint, all of its mass in place and its legs
            attached.
        leg: length of a leg [m]. A waist is below the trunk's CoM, by part of the leg
            where that CoM is near the hips or below them.
        world: gives the stiffness.
    """
    if math.isinf(world.waist):
        return
    whole, com = _inertia_of(trunk), np.array(trunk.ipos)
    lower, upper = (1.0 - _UPPER) * trunk.mass, _UPPER * trunk.mass
    height = min(_HEIGHT * com[2], com[2] - _DEPTH * leg)
    waist = np.array([com[0], com[1], height])
    above = (com - (1.0 - _UPPER) * waist) / _UPPER - waist
    ball = 0.4 * lower * (_ROUND * above[2]) ** 2 * np.eye(3)
    rest = (
        whole - ball - _moved(lower, waist - com) - _moved(upper, waist + above - com)
    )
    body = trunk.add_body(name="upper", pos=waist)
    _set(trunk, lower, waist, ball)
    moments, axes = np.linalg.eigh(rest)
    moments = np.maximum(moments, _LEAST * np.linalg.eigvalsh(whole).min())
    # What a payload adds in one point may be more than the cut leaves of the inertia.
    moments[0] = max(moments[0], _BODY * (moments[2] - moments[1]))
    _set(body, upper, above, axes @ np.diag(moments) @ axes.T)
    stiffness = world.waist * upper * GRAVITY * float(above[2])
    about = _inertia_of(body) + _moved(upper, above)
    for i, (name, axis) in enumerate(AXES.items()):
        damping = 2.0 * _DAMPING * math.sqrt(stiffness * about[i, i])
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            stiffness=[stiffness, 0.0, 0.0],
            damping=[damping, 0.0, 0.0],
        )


def _inertia_of(body: Any) -> Array:
    """Return a body's inertia about its CoM, (3, 3), in its frame [kg m^2]."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, np.asarray(body.iquat, dtype=float))
    axes = turn.reshape(3, 3)
    return np.asarray(axes @ np.diag(body.inertia) @ axes.T)


def _moved(mass: float, by: Array) -> Array:
    """Return what a mass off the CoM adds to the inertia about it, (3, 3)."""
    return np.asarray(mass * (by @ by * np.eye(3) - np.outer(by, by)))


def _set(body: Any, mass: float, com: Array, inertia: Array) -> None:
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    body.mass, body.ipos, body.inertia = mass, com, moments
    body.iquat, body.explicitinertial = quaternion(axes), True
