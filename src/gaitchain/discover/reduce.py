"""Reduce a full robot to its legs and to the five-link biped.

Distances are measured in the rest pose, with the legs' joints at 0 and all others as
in the standing pose, in the pelvis frame: origin between the hip pitch axes, x ahead,
y left, z up.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.discover.findings import Findings, FoundLeg, FoundSole
from gaitchain.discover.ranges import joint_range
from gaitchain.discover.sole import corners_of
from gaitchain.messages import Array
from gaitchain.robot.leg_model import DECIMALS, LegModel, Soles
from gaitchain.robot.reduced_biped import ReducedBiped, check_units
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import subtree

_FASTEST = 30.0  # rad/s: of a servo whose file gives no speed
_THICKNESS, _TRUNK_DEPTH = 0.15, 0.3  # of leg and hips: boxes that are only drawn
_LEAST = 0.02  # m: of a length that is only drawn


def reduce(model: Any, found: Findings, name: str, origin: str = "") -> Robot:
    """Reduce a robot.

    Args:
        model: the robot alone, compiled.
        found: its legs, soles, standing pose and servos.
        name: of the robot.
        origin: what messages call it, if not by its name.

    Returns:
        The robot: its legs, and the biped that they reduce to.

    Raises:
        RobotFileError: the robot is so large or heavy that its file must be in mm or
            g.
    """
    rest = RestPose(model, found)
    legs = [rest.leg(leg) for leg in found.legs]
    full = _leg_model(rest, legs)
    reduced = _reduced(rest, legs, full, name)
    check_units(reduced, origin or name)
    return Robot(reduced, full, boxes=False)


def _leg_model(rest: RestPose, legs: list[RestLeg]) -> LegModel:
    found, model, trunk = rest.found, rest.model, rest.trunk()
    names = (*found.left.joints, *found.right.joints)
    servos = [found.servos[name] for name in names]
    dofs = [model.joint(name).dofadr[0] for name in names]
    ranges = np.array([joint_range(model, model.joint(name).id) for name in names])
    speed = np.array([s.speed_limit for s in servos])
    damping = np.array([s.damping for s in servos])
    held = {n: angle for n, angle in found.stand.items() if n not in names}
    return LegModel(
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
        damping=damping,
        joint_damping=np.minimum(model.dof_damping[dofs], damping),
        torque_limit=[s.torque_limit for s in servos],
        speed_limit=np.minimum(speed, _FASTEST),
        armature=[s.armature for s in servos],
        friction_loss=model.dof_frictionloss[dofs],
        stand=[found.stand[name] for name in names],
        base_at=rest.base_at,
        base_turn=rest.base_turn,
        held=held,
        soles=_tapered([leg.sole for leg in found.legs]),
    )


def _tapered(soles: list[FoundSole]) -> Soles:
    """Return the corners of soles that taper; nothing if a rectangle does for them."""
    if not any(sole.tapers for sole in soles):
        return ()
    corners = [np.round(corners_of(sole.outline), DECIMALS) + 0.0 for sole in soles]
    return tuple(tuple((x, y) for x, y in sole.tolist()) for sole in corners)


def _from_joint(leg: RestLeg) -> list[Array]:
    """CoMs of the links, each from its joint."""
    return [
        link.com - centre if link.mass > 0.0 else np.zeros(3)
        for link, centre in zip(leg.links, leg.centres, strict=True)
    ]


def _reduced(
    rest: RestPose, legs: list[RestLeg], full: LegModel, name: str
) -> ReducedBiped:
    found, knee = rest.found, full.knee
    left, soles = legs[0], [leg.sole for leg in found.legs]
    femur = _across(left.centres[knee] - left.centres[left.hip], left.axes[knee])
    crus = _across(left.centres[-1] - left.centres[knee], left.axes[knee])
    masses = full.link_mass.mean(axis=0)
    front, rear = min(s.front for s in soles), max(s.rear for s in soles)
    width = 2.0 * min(s.half_width for s in soles)
    stance = _stance(rest)
    return ReducedBiped(
        name=name,
        crus_length=crus,
        femur_length=femur,
        trunk_length=max(2.0 * float(full.trunk_com[2]), _LEAST),
        ankle_height=_ankle_height(rest, legs),
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
    )


def _across(way: Array, axis: Array) -> float:
    """Length of a way across an axis."""
    return float(np.linalg.norm(way - (way @ axis) * axis))


def _ankle_height(rest: RestPose, legs: list[RestLeg]) -> float:
    """Mean height of the last joints over the soles [m]."""
    heights = []
    for leg, found in zip(legs, rest.found.legs, strict=True):
        foot = rest.data.body(found.sole.body)
        turn = foot.xmat.reshape(3, 3)
        sole = rest.place(foot.xpos + turn @ found.sole.origin)
        heights.append(float((leg.ankle - sole) @ leg.sole[:, 2]))
    return float(np.mean(heights))


def _stance(rest: RestPose) -> float:
    """Distance between the ankle points of the standing robot [m]."""
    data = mujoco.MjData(rest.model)
    for joint, angle in rest.found.stand.items():
        data.joint(joint).qpos = angle
    mujoco.mj_kinematics(rest.model, data)
    points = []
    for leg in rest.found.legs:
        foot = data.body(leg.sole.body)
        points.append(foot.xpos + foot.xmat.reshape(3, 3) @ leg.sole.origin)
    left = rest.base_turn[:, 1]
    return float(
        data.body(rest.found.base).xmat.reshape(3, 3).T @ (points[0] - points[1]) @ left
    )


class RigidLink(NamedTuple):
    """Bodies that move as one; CoM and inertia in the pelvis frame."""

    mass: float
    com: Array
    inertia: Array


class RestLeg(NamedTuple):
    """A leg with its joints at 0, in the pelvis frame."""

    centres: Array
    axes: Array
    links: list[RigidLink]
    ankle: Array
    """Ankle point: over the sole's origin, at the height of the last joint."""
    sole: Array
    """(3, 3) axes of the sole."""
    hip: int
    """Index of the hip pitch joint."""


class RestPose:
    """The robot with its legs' joints at 0."""

    def __init__(self, model: Any, found: Findings) -> None:
        self.model, self.found = model, found
        self.data = mujoco.MjData(model)
        own = {name for leg in found.legs for name in leg.joints}
        for joint, angle in found.stand.items():
            self.data.joint(joint).qpos = 0.0 if joint in own else angle
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        base = self.data.body(found.base)
        left = np.cross(found.up, found.forward)
        own_axes = np.column_stack([found.forward, left, found.up])
        self.base_turn = own_axes
        self._axes = base.xmat.reshape(3, 3) @ own_axes
        self._origin = np.mean([self._hip(leg) for leg in found.legs], axis=0)
        inverse = base.xmat.reshape(3, 3).T
        self.base_at = inverse @ (self._origin - base.xpos)

    def place(self, point: Array) -> Array:
        """Give a point of the world in the pelvis frame."""
        return np.asarray((point - self._origin) @ self._axes)

    def turn(self, rotation: Array) -> Array:
        """Give a rotation of the world in the pelvis frame."""
        return np.asarray(self._axes.T @ rotation)

    def leg(self, leg: FoundLeg) -> RestLeg:
        """Collect a leg."""
        joints = [self.data.joint(name) for name in leg.joints]
        sole, foot = leg.sole, self.data.body(leg.sole.body)
        turn = foot.xmat.reshape(3, 3)
        centres = np.array([self.place(joint.xanchor) for joint in joints])
        axes = np.array([self._axes.T @ joint.xaxis for joint in joints])
        level = self.turn(turn @ sole.rotation)
        point = self.place(foot.xpos + turn @ sole.origin)
        rise = float((centres[-1] - point) @ level[:, 2])
        return RestLeg(
            centres=centres,
            axes=axes,
            links=[self._join(bodies) for bodies in self.link_bodies(leg)],
            ankle=point + rise * level[:, 2],
            sole=level,
            hip=hip_pitch(axes, leg.knee),
        )

    def trunk(self) -> RigidLink:
        """Put together all that is no leg."""
        return self._join(self.trunk_bodies())

    def trunk_bodies(self) -> set[int]:
        """Return the bodies that are no leg."""
        first = [self.model.joint(leg.joints[0]).bodyid[0] for leg in self.found.legs]
        legs = {body for top in first for body in subtree(self.model, int(top))}
        root = self.model.body(self.found.base).id
        return set(subtree(self.model, root)) - legs

    def link_bodies(self, leg: FoundLeg) -> list[set[int]]:
        """Return, for each joint, the bodies it moves and the next one does not."""
        tops = [int(self.model.joint(name).bodyid[0]) for name in leg.joints]
        below = [set(subtree(self.model, top)) for top in tops] + [set()]
        return [own - beyond for own, beyond in pairwise(below)]

    def _hip(self, leg: FoundLeg) -> Array:
        joints = [self.data.joint(name) for name in leg.joints]
        hip = hip_pitch(np.array([joint.xaxis for joint in joints]), leg.knee)
        return np.array(joints[hip].xanchor)

    def _join(self, bodies: set[int]) -> RigidLink:
        """Add up masses and inertias."""
        model, data = self.model, self.data
        rows = sorted(bodies)
        masses = model.body_mass[rows]
        mass = float(masses.sum())
        if mass <= 0.0:
            return RigidLink(0.0, np.zeros(3), np.zeros((3, 3)))
        places = np.array([self.place(data.xipos[b]) for b in rows])
        com = masses @ places / mass
        inertia = np.zeros((3, 3))
        for body, own, at in zip(rows, masses, places - com, strict=True):
            axes = self.turn(data.ximat[body].reshape(3, 3))
            inertia += axes @ np.diag(model.body_inertia[body]) @ axes.T
            inertia += own * (at @ at * np.eye(3) - np.outer(at, at))
        return RigidLink(mass, com, inertia)


def hip_pitch(axes: Array, knee: int) -> int:
    """Return the index of the hip joint whose axis is most parallel to the knee's."""
    return int(np.argmax(np.abs(axes[:knee] @ axes[knee])))
