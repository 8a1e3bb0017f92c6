"""The robot in MuJoCo: the boxes of a reduced biped, or a full robot's skeleton."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from gaitchain.robot.kinematics import link_boxes, link_inertias, link_masses
from gaitchain.robot.reduced_biped import ReducedBiped
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import BOXES, SIDES
from gaitchain.sim.looks import Look, add_shapes
from gaitchain.sim.scene import (
    add_imu,
    add_link_errors,
    add_servo,
    new_scene,
    shift_com,
)
from gaitchain.sim.skeleton import add_skeleton
from gaitchain.sim.waist import split_trunk_at_waist
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import draw_imu_place, draw_imu_tilt

# Indices into kinematics.LINKS, which are symmetric in support and swing.
_FOOT, _CRUS, _FEMUR, _TRUNK = 0, 1, 2, 3
_HELD = 1.5  # height of a trunk that is held, over that of a standing one
_COLOURS = {
    _FOOT: (0.9, 0.5, 0.15, 1),
    _CRUS: (0.75, 0.77, 0.8, 1),
    _FEMUR: (0.75, 0.77, 0.8, 1),
    _TRUNK: (0.2, 0.42, 0.7, 1),
}


def build_model(
    robot: Robot, world: World | None = None, looks: Sequence[Look] | None = None
) -> mujoco.MjModel:
    """Build the robot with its floor, position servos and sole sensors.

    Each leg joint is a position servo whose set-point follows at no more than the
    joint's speed limit, within the joint's range and torque.

    Args:
        robot: the robot; a full robot is built with all joints but those of the legs
            held still.
        world: floor, servos and link errors; the nominal world by default.
        looks: shapes in which it is drawn, see `looks.add_shapes`; by default it is
            seen as it is simulated.

    Returns:
        The compiled model; its free joint comes first, unless the trunk is held, then
        the left leg's joints from hip to ankle, then the right one's; those of a waist
        that gives way are last.
    """
    world = world or World()
    spec = new_scene(robot.name, world)
    height = standing_height(robot) * (_HELD if world.held else 1.0)
    trunk = spec.worldbody.add_body(name="trunk", pos=[0, 0, height])
    if not world.held:
        trunk.add_freejoint(name="base")
    _mount_imu(trunk, robot, world)
    if robot.boxes:
        _add_boxes(spec, trunk, robot, world)
    else:
        add_skeleton(spec, trunk, robot, world)
    shift_com(trunk, world)
    split_trunk_at_waist(trunk, robot.reduced.leg_length, world)
    add_imu(spec)
    if looks is not None:
        add_shapes(spec, robot, looks)
    add_link_errors(spec, world)
    return spec.compile()


def _mount_imu(trunk: Any, robot: Robot, world: World) -> None:
    """Put the IMU in the middle of the trunk, as nearly as the world does."""
    tilt = draw_imu_tilt(world)
    if robot.identified is not None:
        tilt = tilt + robot.identified.tilt
    roll, pitch, yaw = tilt.tolist()
    turn = np.empty(4)
    mujoco.mju_euler2Quat(turn, [yaw, pitch, roll], "zyx")
    middle = np.array([0.0, 0.0, 0.5 * robot.reduced.trunk_length])
    trunk.add_site(name="imu", pos=middle + draw_imu_place(world), quat=turn)


def standing_height(robot: Robot) -> float:
    """Return the height of the hips above the floor with straight legs [m]."""
    return robot.reduced.ankle_height + robot.reduced.leg_length


def _add_boxes(spec: Any, trunk: Any, robot: Robot, world: World) -> None:
    """Add the trunk and legs of the box robot."""
    half = 0.5 * robot.reduced.trunk_length
    _add_link(trunk, robot.reduced, _TRUNK, half, world.mass)
    trunk.mass += world.payload * robot.reduced.mass
    for side in SIDES:
        _add_leg(spec, trunk, robot, side, world)


def _add_link(body: Any, biped: ReducedBiped, link: int, z: float, mass: float) -> None:
    """Set a body's inertia and add its box, which is drawn and may hit the floor."""
    box = link_boxes(biped)[link]
    x = biped.sole_offset if link == _FOOT else 0.0
    body.mass = link_masses(biped)[link] * mass
    body.inertia = link_inertias(biped)[link] * mass
    body.ipos = [x, 0, z]
    body.explicitinertial = True
    body.add_geom(
        name=f"{body.name}_box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=0.5 * box,
        pos=[x, 0, z],
        rgba=_COLOURS[link],
        friction=[0.0, 0.0, 0.0],  # MuJoCo takes the larger of two: the floor's
        contype=0,  # collides with the floor only, not with other links
        conaffinity=1,
    )


def _add_leg(spec: Any, trunk: Any, robot: Robot, side: str, world: World) -> None:
    biped = robot.reduced
    y = 0.5 * biped.hip_width * (1.0 if side == "left" else -1.0)
    names = [f"{side}_{part}" for part in BOXES]
    femur = trunk.add_body(name=names[0], pos=[0, y, 0])
    _add_link(femur, biped, _FEMUR, -0.5 * biped.femur_length, world.mass)
    crus = femur.add_body(name=names[1], pos=[0, 0, -biped.femur_length])
    _add_link(crus, biped, _CRUS, -0.5 * biped.crus_length, world.mass)
    foot = crus.add_body(name=names[2], pos=[0, 0, -biped.crus_length])
    _add_link(foot, biped, _FOOT, -0.5 * biped.ankle_height, world.mass)
    bodies = (femur, femur, femur, crus, foot, foot)
    for at, body in enumerate(bodies, start=6 * SIDES.index(side)):
        add_servo(spec, body, robot.legs, at, world)
