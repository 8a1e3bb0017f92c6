"""Reduce a full robot to its legs' anatomy and to the five-link biped.

Distances are measured with the legs' joints at 0 and everything else as it stands, in
the pelvis frame: origin between the hip pitch axes, x ahead, y left, z up.
"""

from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.findings import Findings
from gaitchain.discover.rest_pose import Drawn, DrawnLeg
from gaitchain.errors import RobotFileError
from gaitchain.messages import Array
from gaitchain.robot.leg_model import Anatomy
from gaitchain.robot.reduced_biped import Biped

_FASTEST = 30.0  # rad/s: of a servo whose file gives no speed
_THICKNESS, _TRUNK_DEPTH = 0.15, 0.3  # of leg and hips: boxes that are only drawn
_LEAST = 0.02  # m: of a length that is only drawn


def reduce(model: Any, found: Findings, name: str) -> Biped:
    """Reduce a robot.

    Args:
        model: the robot alone, compiled.
        found: its legs, soles, standing pose and servos.
        name: of the robot.

    Returns:
        The reduced biped, its anatomy with it.

    Raises:
        RobotFileError: the legs have unequal numbers of joints.
    """
    if len(found.left.joints) != len(found.right.joints):
        raise RobotFileError(
            f"{name}: the legs have {len(found.left.joints)} and "
            f"{len(found.right.joints)} joints, they must have the same number; give "
            "legs.left and legs.right in a profile"
        )
    drawn = Drawn(model, found)
    legs = [drawn.leg(leg) for leg in found.legs]
    anatomy = _anatomy(drawn, legs)
    return _biped(drawn, legs, anatomy, name)


def _anatomy(drawn: Drawn, legs: list[DrawnLeg]) -> Anatomy:
    found, model, trunk = drawn.found, drawn.model, drawn.trunk()
    names = (*found.left.joints, *found.right.joints)
    servos = [found.servos[name] for name in names]
    ranges = np.array([_range(model, name) for name in names])
    speed = np.array([s.speed_limit for s in servos])
    held = {n: angle for n, angle in found.stand.items() if n not in names}
    return Anatomy(
        joint_names=names,
        knee=found.left.knee,
        at=[np.diff(leg.centres, axis=0, prepend=np.zeros((1, 3))) for leg in legs],
        axis=[leg.axes for leg in legs],
        com=[_from_joint(leg) for leg in legs],
        inertia=[[link.inertia for link in leg.links] for leg in legs],
        link_mass=[[link.mass for link in leg.links] for leg in legs],
        foot_at=[leg.ankle - leg.centres[-1] for leg in legs],
        foot_turn=[leg.sole for leg in legs],
        trunk_mass=trunk.mass,
        trunk_com=trunk.com,
        trunk_inertia=trunk.inertia,
        lower=ranges[:, 0],
        upper=ranges[:, 1],
        stiffness=[s.stiffness for s in servos],
        damping=[s.damping for s in servos],
        torque_limit=[s.torque_limit for s in servos],
        speed_limit=np.minimum(speed, _FASTEST),
        armature=[s.armature for s in servos],
        friction_loss=[_of_dof(model, "dof_frictionloss", name) for name in names],
        stand=[found.stand[name] for name in names],
        base_at=drawn.base_at,
        base_turn=drawn.base_turn,
        held=held,
    )


def _from_joint(leg: DrawnLeg) -> list[Array]:
    """CoMs of the links, each from its joint."""
    return [
        link.com - centre if link.mass > 0.0 else np.zeros(3)
        for link, centre in zip(leg.links, leg.centres, strict=True)
    ]


def _range(model: Any, name: str) -> tuple[float, float]:
    joint = model.joint(name)
    if not model.jnt_limited[joint.id]:
        return -np.pi, np.pi
    low, high = joint.range
    return float(low), float(high)


def _of_dof(model: Any, what: str, name: str) -> float:
    return float(getattr(model, what)[model.joint(name).dofadr[0]])


def _biped(drawn: Drawn, legs: list[DrawnLeg], full: Anatomy, name: str) -> Biped:
    found, knee = drawn.found, full.knee
    left, soles = legs[0], [leg.sole for leg in found.legs]
    femur = _across(left.centres[knee] - left.centres[left.hip], left.axes[knee])
    crus = _across(left.centres[-1] - left.centres[knee], left.axes[knee])
    masses = full.link_mass.mean(axis=0)
    front, rear = min(s.front for s in soles), max(s.rear for s in soles)
    width = 2.0 * min(s.half_width for s in soles)
    stance = _stance(drawn)
    return Biped(
        name=name,
        crus_length=crus,
        femur_length=femur,
        trunk_length=max(2.0 * float(full.trunk_com[2]), _LEAST),
        ankle_height=_ankle_height(drawn, legs),
        hip_width=stance,
        sole_length=front - rear,
        sole_width=width,
        sole_offset=0.5 * (front + rear),
        leg_thickness=_THICKNESS * (femur + crus),
        trunk_depth=max(_TRUNK_DEPTH * stance, _LEAST),
        trunk_width=max(stance, _LEAST),
        crus_mass=float(masses[knee:-1].sum()),
        femur_mass=float(masses[:knee].sum()),
        trunk_mass=full.trunk_mass,
        foot_mass=float(masses[-1]),
        joint_angle_limit=float(np.abs([full.lower, full.upper]).max()),
        joint_speed_limit=float(full.speed_limit.min()),
        joint_torque_limit=float(full.torque_limit.max()),
        servo_stiffness=float(full.stiffness.mean()),
        servo_damping=float(full.damping.mean()),
        joint_armature=float(full.armature.mean()),
        sources={},
        anatomy=full,
    )


def _across(way: Array, axis: Array) -> float:
    """Length of a way across an axis."""
    return float(np.linalg.norm(way - (way @ axis) * axis))


def _ankle_height(drawn: Drawn, legs: list[DrawnLeg]) -> float:
    """Mean height of the last joints over the soles [m]."""
    heights = []
    for leg, found in zip(legs, drawn.found.legs, strict=True):
        foot = drawn.data.body(found.sole.body)
        turn = foot.xmat.reshape(3, 3)
        sole = drawn.place(foot.xpos + turn @ found.sole.origin)
        heights.append(float((leg.ankle - sole) @ leg.sole[:, 2]))
    return float(np.mean(heights))


def _stance(drawn: Drawn) -> float:
    """Distance between the ankle points of the standing robot [m]."""
    data = mujoco.MjData(drawn.model)
    for joint, angle in drawn.found.stand.items():
        data.joint(joint).qpos = angle
    mujoco.mj_kinematics(drawn.model, data)
    points = []
    for leg in drawn.found.legs:
        foot = data.body(leg.sole.body)
        points.append(foot.xpos + foot.xmat.reshape(3, 3) @ leg.sole.origin)
    left = drawn.base_turn[:, 1]
    return float(
        data.body(drawn.found.base).xmat.reshape(3, 3).T[0:3]
        @ (points[0] - points[1])
        @ left
    )
