"""The full robot in MuJoCo, built in code from the reduced biped's numbers."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gaitchain.biped import Biped
from gaitchain.kinematics import link_boxes, link_inertias
from gaitchain.robot.joints import LEG_JOINTS

# Indices into kinematics.LINKS, which are symmetric in support and swing.
_FOOT, _CRUS, _FEMUR, _TRUNK = 0, 1, 2, 3
_AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0), "knee": (0, 1, 0)}
_COLOURS = {
    _FOOT: (0.9, 0.5, 0.15, 1),
    _CRUS: (0.75, 0.77, 0.8, 1),
    _FEMUR: (0.75, 0.77, 0.8, 1),
    _TRUNK: (0.2, 0.42, 0.7, 1),
}


@dataclass(frozen=True)
class World:
    """What the floor and the servos are like: the physics around the plan."""

    friction: float = 0.8
    servo_gain: float = 1.0
    """Factor on the servos' stiffness and damping."""
    mass: float = 1.0
    """Factor on every mass and inertia."""
    timestep: float = 0.002
    """Step of the simulation [s]."""


def build_model(biped: Biped, world: World | None = None) -> mujoco.MjModel:
    """Build the robot with its floor, position servos and sole sensors.

    Twelve joints (hip yaw, roll, pitch, knee, ankle pitch, roll on each side). Each
    is a position servo whose set-point follows at no more than the joint's speed
    limit, within the joint's range and torque.

    Args:
        biped: the robot.
        world: friction, servo and mass factors; the nominal world by default.

    Returns:
        The compiled model; its free joint comes first, then `JOINT_NAMES`.
    """
    world = world or World()
    spec = mujoco.MjSpec()
    spec.modelname = biped.name
    spec.compiler.degree = False
    spec.option.timestep = world.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # The sparse solver of MuJoCo 4.0.0 builds a wrong Hessian (fixed in 4.0.1).
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    _add_surroundings(spec, world)
    trunk = spec.worldbody.add_body(name="trunk", pos=[0, 0, standing_height(biped)])
    trunk.add_freejoint(name="base")
    half = 0.5 * biped.trunk_length
    _add_link(trunk, biped, _TRUNK, half, world.mass)
    trunk.add_site(name="imu", pos=[0, 0, half])
    for side in ("left", "right"):
        _add_leg(spec, biped, side, world)
    _add_imu(spec)
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
        _add_servo(spec, body, biped, f"{side}_{joint}", world.servo_gain)


def _add_servo(spec: Any, body: Any, biped: Biped, name: str, gain: float) -> None:
    limit = biped.joint_angle_limit
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
        forcerange=[-biped.joint_torque_limit, biped.joint_torque_limit],
        forcelimited=True,
    )
    servo.set_to_pid(
        kp=biped.servo_stiffness * gain,
        kv=biped.servo_damping * gain,
        slewmax=biped.joint_speed_limit,
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_POS),
    )
