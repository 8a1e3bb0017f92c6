"""The full robot in MuJoCo, built in code from the reduced biped's numbers."""

import math
from typing import Any

import mujoco
import numpy as np

from gaitchain.biped import Biped
from gaitchain.kinematics import link_boxes, link_inertias
from gaitchain.robot.joints import LEG_JOINTS
from gaitchain.robot.world import GRAVITY, World, draw_link_errors, strew_blocks

# Indices into kinematics.LINKS, which are symmetric in support and swing.
_FOOT, _CRUS, _FEMUR, _TRUNK = 0, 1, 2, 3
_AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0), "knee": (0, 1, 0)}
_COLOURS = {
    _FOOT: (0.9, 0.5, 0.15, 1),
    _CRUS: (0.75, 0.77, 0.8, 1),
    _FEMUR: (0.75, 0.77, 0.8, 1),
    _TRUNK: (0.2, 0.42, 0.7, 1),
}
_BLOCK_COLOUR = (0.72, 0.74, 0.7, 1)
_BLOCK_DEPTH = 0.05  # below the floor: a sole pressed into a block is pushed up [m]


def build_model(biped: Biped, world: World | None = None) -> mujoco.MjModel:
    """Build the robot with its floor, position servos and sole sensors.

    Twelve joints (hip yaw, roll, pitch, knee, ankle pitch, roll on each side). Each
    is a position servo whose set-point follows at no more than the joint's speed
    limit, within the joint's range and torque.

    Args:
        biped: the robot.
        world: what floor, servos and links are like; the nominal one by default.

    Returns:
        The compiled model; its free joint comes first, then `JOINT_NAMES`.
    """
    world = world or World()
    spec = mujoco.MjSpec()
    spec.modelname = biped.name
    spec.compiler.degree = False
    spec.option.timestep = world.timestep
    spec.option.gravity = -GRAVITY * world.up
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # The sparse solver of MuJoCo 4.0.0 builds a wrong Hessian (fixed in 4.0.1).
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    _add_surroundings(spec, world)
    _add_blocks(spec, world)
    trunk = spec.worldbody.add_body(name="trunk", pos=[0, 0, standing_height(biped)])
    trunk.add_freejoint(name="base")
    half = 0.5 * biped.trunk_length
    _add_link(trunk, biped, _TRUNK, half, world.mass)
    trunk.add_site(name="imu", pos=[0, 0, half])
    for side in ("left", "right"):
        _add_leg(spec, biped, side, world)
    _add_imu(spec)
    if world.model_error:
        _misbuild(spec, world)
    return spec.compile()


def standing_height(biped: Biped) -> float:
    """Height of the hips above the floor with straight legs [m]."""
    return biped.ankle_height + biped.leg_length


def total_mass(model: mujoco.MjModel) -> float:
    """Mass of all bodies [kg]."""
    return float(np.sum(model.body_mass))


def _add_surroundings(spec: Any, world: World) -> None:
    spec.worldbody.add_light(pos=[1, -2, 4], dir=[-0.2, 0.4, -1], castshadow=False)
    grid = spec.add_texture(
        name="grid",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.93, 0.94, 0.95],
        rgb2=[0.85, 0.87, 0.89],
        width=256,
        height=256,
    )
    material = spec.add_material(name="grid", texrepeat=[5, 5], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = grid.name
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        material="grid",
        friction=[world.friction, 0.005, 0.0001],
        contype=1,
        conaffinity=0,
    )


def _add_blocks(spec: Any, world: World) -> None:
    # Boxes step faster than a height field, whose flanks would be slanted, and on the
    # world's own body they need not be moved.
    for i, (x, y, yaw, *half, height) in enumerate(strew_blocks(world)):
        depth = 0.5 * (_BLOCK_DEPTH + height)
        spec.worldbody.add_geom(
            name=f"block_{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[*half, depth],
            pos=[x, y, height - depth],
            quat=[math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)],
            rgba=_BLOCK_COLOUR,
            friction=[world.friction, 0.005, 0.0001],
            contype=1,
            conaffinity=0,
        )


def _misbuild(spec: Any, world: World) -> None:
    """Make every link differ from the robot's file, as a real robot's do."""
    links = spec.bodies[1:]  # the first is the world
    errors = draw_link_errors(world, len(links))
    for body, (mass, inertia, *shift) in zip(links, errors, strict=True):
        body.mass *= 1.0 + mass
        body.inertia = body.inertia * (1.0 + inertia)
        body.ipos = body.ipos + np.array(shift) * body.geoms[0].size


def _add_link(body: Any, biped: Biped, link: int, z: float, mass: float) -> None:
    """Give a body its inertia and the box that is seen and that may hit the floor."""
    box = link_boxes(biped)[link]
    x = biped.sole_offset if link == _FOOT else 0.0
    masses = (biped.foot_mass, biped.crus_mass, biped.femur_mass, biped.trunk_mass)
    body.mass = masses[link] * mass
    body.inertia = link_inertias(biped)[link] * mass
    body.ipos = [x, 0, z]
    body.explicitinertial = True
    body.add_geom(
        name=f"{body.name}_box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=0.5 * box,
        pos=[x, 0, z],
        rgba=_COLOURS[link],
        friction=[0.0, 0.0, 0.0],  # the larger of two counts: the floor's
        contype=0,  # touches the floor, never another link
        conaffinity=1,
    )


def _add_imu(spec: Any) -> None:
    kinds = {
        "gyro": mujoco.mjtSensor.mjSENS_GYRO,
        "accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER,
    }
    for name, kind in kinds.items():
        spec.add_sensor(
            name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu"
        )


def _add_leg(spec: Any, biped: Biped, side: str, world: World) -> None:
    trunk = spec.body("trunk")
    y = 0.5 * biped.hip_width * (1.0 if side == "left" else -1.0)
    femur = trunk.add_body(name=f"{side}_femur", pos=[0, y, 0])
    _add_link(femur, biped, _FEMUR, -0.5 * biped.femur_length, world.mass)
    crus = femur.add_body(name=f"{side}_crus", pos=[0, 0, -biped.femur_length])
    _add_link(crus, biped, _CRUS, -0.5 * biped.crus_length, world.mass)
    foot = crus.add_body(name=f"{side}_foot", pos=[0, 0, -biped.crus_length])
    _add_link(foot, biped, _FOOT, -0.5 * biped.ankle_height, world.mass)
    bodies = (femur, femur, femur, crus, foot, foot)
    for joint, body in zip(LEG_JOINTS, bodies, strict=True):
        _add_servo(spec, body, biped, f"{side}_{joint}", world)


def _add_servo(spec: Any, body: Any, biped: Biped, name: str, world: World) -> None:
    limit = biped.joint_angle_limit
    torque = biped.joint_torque_limit * world.torque_limit
    speed = world.speed_limit_deg_s
    kind = name.rsplit("_", 1)[-1]
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=_AXES[kind],
        armature=biped.joint_armature,
        range=[-limit, limit],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
    )
    servo = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrlrange=[-limit, limit],
        ctrllimited=True,
        forcerange=[-torque, torque],
        forcelimited=True,
    )
    servo.set_to_pid(
        kp=biped.servo_stiffness * world.servo_gain,
        kv=biped.servo_damping * world.servo_gain,
        slewmax=biped.joint_speed_limit if speed is None else math.radians(speed),
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_POS),
    )
    _delay(servo, world)


def _delay(servo: Any, world: World) -> None:
    """Let a servo read its targets from the past; in every other world from now."""
    steps = world.delay_steps
    if steps:
        # Read a quarter step later than asked: sample and read times are sums with
        # rounding errors, and a tie may find the sample before.
        servo.delay = (steps - 0.25) * world.timestep
        servo.nsample = steps + 1
