"""A full robot in MuJoCo, built from its leg model: moving legs on a rigid trunk.

Each leg link has the robot's mass and inertia and is drawn as a capsule. Only soles
and trunk collide with the floor.
"""

from typing import Any

import mujoco
import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import FOOT, SIDES, has_own_body, link_part
from gaitchain.sim.rotation import quaternion
from gaitchain.sim.scene import add_servo, half_sides
from gaitchain.sim.world import World

_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6  # kg, kg m^2; of a massless link
_DIAGONAL = 1e-9  # of the largest moment; smaller products of inertia count as 0
_THICK, _THIN = 0.07, 0.01  # of the leg length: radius and least length of a capsule
_SOLE = 0.3  # of the ankle height: thickness of the sole's box
_COLOURS = {
    "trunk": (0.2, 0.42, 0.7, 1),
    "link": (0.75, 0.77, 0.8, 1),
    "sole": (0.9, 0.5, 0.15, 1),
}


def add_skeleton(spec: Any, trunk: Any, robot: Robot, world: World) -> None:
    """Add trunk and legs of a full robot.

    Args:
        spec: the scene.
        trunk: the body with the free joint; its frame is the pelvis frame.
        robot: the robot.
        world: servos and link errors.
    """
    full = robot.legs
    _set_inertia(trunk, full.trunk_mass, full.trunk_com, full.trunk_inertia, world)
    box = half_sides(trunk.mass, trunk.inertia)
    trunk.mass += world.payload * full.mass
    _add_geom(
        trunk,
        "trunk",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=box,
        pos=trunk.ipos,
        quat=trunk.iquat,
    )
    for leg in range(len(SIDES)):
        _add_leg(spec, trunk, robot, leg, world)


def _add_leg(spec: Any, body: Any, robot: Robot, leg: int, world: World) -> None:
    full, side = robot.legs, SIDES[leg]
    for j in range(full.leg_joints):
        if has_own_body(full, leg, j):
            body = body.add_body(name=f"{side}_{link_part(j)}", pos=full.at[leg, j])
        add_servo(spec, body, full, leg * full.leg_joints + j, world)
        if j + 1 == full.leg_joints or has_own_body(full, leg, j + 1):
            mass, inertia = full.link_mass[leg, j], full.inertia[leg, j]
            _set_inertia(body, mass, full.com[leg, j], inertia, world)
            _add_capsule(body, robot, leg, j)
    _add_sole(body, robot, leg)


def _set_inertia(
    body: Any, mass: float, com: Array, inertia: Array, world: World
) -> None:
    moments, axes = np.diag(inertia), np.eye(3)
    if np.abs(inertia - np.diag(moments)).max() > _DIAGONAL * moments.max(initial=0.0):
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
    body.mass = max(float(mass), _LEAST_MASS) * world.mass
    body.inertia = np.maximum(moments, _LEAST_INERTIA) * world.mass
    body.ipos, body.iquat = com, quaternion(axes)
    body.explicitinertial = True


def _add_capsule(body: Any, robot: Robot, leg: int, j: int) -> None:
    """Draw a link from its joint to the next one."""
    if j + 1 >= robot.legs.leg_joints:
        return
    end = np.array(robot.legs.at[leg, j + 1])
    if np.linalg.norm(end) < _THIN * robot.reduced.leg_length:
        return
    radius = _THICK * robot.reduced.leg_length
    _add_geom(
        body,
        f"{body.name}_capsule",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0.0, 0.0, 0.0, *end],
        size=[radius, 0.0, 0.0],
    )


def _add_sole(body: Any, robot: Robot, leg: int) -> None:
    """Add the foot body at the ankle point, with the sole below it."""
    full, side = robot.legs, SIDES[leg]
    turn = quaternion(full.foot_turn[leg])
    foot = body.add_body(name=f"{side}_{FOOT}", pos=full.foot_at[leg], quat=turn)
    below, half = -robot.reduced.ankle_height, 0.5 * _SOLE * robot.reduced.ankle_height
    box = _add_geom(
        foot,
        f"{side}_foot_box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5 * robot.reduced.sole_length, 0.5 * robot.reduced.sole_width, half],
        pos=[robot.reduced.sole_offset, 0.0, below + half],
    )
    if full.soles:  # it is drawn, and stands on its corners
        box.conaffinity = 0
    for i, (x, y) in enumerate(full.soles[leg] if full.soles else ()):
        _add_geom(
            foot,
            f"{side}_corner_{i + 1}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[half, 0.0, 0.0],
            pos=[x, y, below + half],
        )


def _add_geom(body: Any, name: str, **shape: Any) -> Any:
    foot = body.name.endswith(FOOT)
    kind = "sole" if foot else name if name == "trunk" else "link"
    return body.add_geom(
        name=name if kind == "sole" else f"{name}_geom",
        rgba=_COLOURS[kind],
        mass=0.0,
        friction=[0.0, 0.0, 0.0],  # MuJoCo takes the larger of two: the floor's
        contype=0,  # no contact between links; a capsule would reach below its sole
        conaffinity=int(kind != "link"),
        **shape,
    )
