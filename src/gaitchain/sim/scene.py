"""The robot's world in MuJoCo: floor, blocks, servos, sensors and link errors."""

import math
from typing import Any

import mujoco
import numpy as np

from gaitchain.errors import MissingExtraError
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import (
    draw_blocks,
    draw_com_shift,
    draw_gains,
    draw_link_errors,
)

_BLOCK_COLOUR = (0.72, 0.74, 0.7, 1)
_BLOCK_DEPTH = 0.05  # below the floor, so that contacts push a sole upward [m]
_IMPEDANCE_RATIO = 10.0  # of friction over normal force; with more, less creep
_WEIGHTLESS = 2e-3  # kg, above what links without mass are given; no errors below it


def new_scene(name: str, world: World) -> Any:
    """Return a spec with floor, blocks and light, without a robot."""
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    spec.option.timestep = world.timestep
    spec.option.gravity = -GRAVITY * np.array(world.up)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # The sparse solver of MuJoCo 4.0.0 builds a wrong Hessian (fixed in 4.0.1).
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # One robot is one island of contacts; to find that takes a tenth of a time step.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    if world.cone == "elliptic":
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = _IMPEDANCE_RATIO
    _add_surroundings(spec, world)
    _add_blocks(spec, world)
    return spec


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
        contype=1,
        conaffinity=0,
        **_surface(world),
    )


def _add_blocks(spec: Any, world: World) -> None:
    # Boxes simulate faster than a height field and have vertical sides; on the world
    # body they are static.
    for i, (x, y, yaw, *half, height) in enumerate(draw_blocks(world)):
        depth = 0.5 * (_BLOCK_DEPTH + height)
        spec.worldbody.add_geom(
            name=f"block_{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[*half, depth],
            pos=[x, y, height - depth],
            quat=[math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)],
            rgba=_BLOCK_COLOUR,
            contype=1,
            conaffinity=0,
            **_surface(world),
        )


def _surface(world: World) -> dict[str, Any]:
    """Return the contact parameters of floor and blocks; they override the robot's."""
    return {
        "friction": [world.friction, 0.005, 0.0001],
        "solref": [world.contact_s, 1.0],
        "priority": 1,
    }


def add_imu(spec: Any) -> None:
    """Add gyro and accelerometer at the site "imu"."""
    kinds = {
        "gyro": mujoco.mjtSensor.mjSENS_GYRO,
        "accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER,
    }
    for name, kind in kinds.items():
        spec.add_sensor(
            name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu"
        )


def add_servo(spec: Any, body: Any, legs: LegModel, at: int, world: World) -> None:
    """Add a leg joint and its position servo to the body that it moves.

    The set-point is limited in rate by the joint's speed limit and stays in the joint's
    range; the torque is limited.

    Args:
        spec: the scene.
        body: the body.
        legs: the robot's legs.
        at: index of the joint, left leg first.
        world: servos.

    Raises:
        MissingExtraError: this version of MuJoCo cannot limit the rate.
    """
    name, span = legs.joint_names[at], [legs.lower[at], legs.upper[at]]
    torque = float(legs.torque_limit[at]) * world.torque_limit
    limit = world.speed_limit_deg_s
    own = float(legs.speed_limit[at])
    viscous = world.viscous_friction * torque / world.motor_speed(own)
    gain = float(draw_gains(world, len(legs.joint_names))[at])
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=legs.axis.reshape(-1, 3)[at],
        damping=[legs.joint_damping[at] + viscous, 0.0, 0.0],
        range=span,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=legs.armature[at],
        frictionloss=legs.friction_loss[at] + world.dry_friction * torque,
    )
    actuator = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrlrange=span,
        ctrllimited=True,
        forcerange=[-torque, torque],
        forcelimited=True,
    )
    if not hasattr(actuator, "set_to_pid"):
        raise MissingExtraError(
            f"MuJoCo {mujoco.__version__} has no servo with a speed limit of its "
            "set-point, 3.12 has: pip install 'gaitchain[sim]'"
        )
    actuator.set_to_pid(
        kp=float(legs.stiffness[at]) * gain,
        kv=float(legs.damping[at] - legs.joint_damping[at]) * gain,
        slewmax=own if limit is None else math.radians(limit),
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_POS),
    )
    _delay(actuator, world)


def _delay(servo: Any, world: World) -> None:
    """Delay a servo's targets by the world's bus delay, if it has one."""
    steps = world.delay_steps
    if steps:
        # A quarter step less, because sample and read times are sums with rounding
        # errors: on a tie the previous sample might be read.
        servo.delay = (steps - 0.25) * world.timestep
        servo.nsample = steps + 1


def shift_com(trunk: Any, world: World) -> None:
    """Shift the CoM of a trunk that is still in one part."""
    if world.com_m:
        trunk.ipos = trunk.ipos + draw_com_shift(world)


def add_link_errors(spec: Any, world: World) -> None:
    """Add errors to the mass, inertia and CoM of every link."""
    if not world.model_error:
        return
    least = _WEIGHTLESS * world.mass  # the same links, however heavy all of them are
    links = [body for body in spec.bodies[1:] if body.mass > least]
    errors = draw_link_errors(world, len(links))
    for body, (mass, inertia, *shift) in zip(links, errors, strict=True):
        half = half_sides(body.mass, body.inertia)
        body.mass *= 1.0 + mass
        body.inertia = body.inertia * (1.0 + inertia)
        body.ipos = body.ipos + turned(body.iquat, np.array(shift) * half)


def half_sides(mass: float, inertia: Array) -> Array:
    """Return half the sides of the uniform box with this mass and these moments."""
    squares = 1.5 * (np.sum(inertia) - 2.0 * np.asarray(inertia)) / mass
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def turned(quaternion: Array, vector: Array) -> Array:
    """Rotate a vector by a quaternion."""
    result = np.empty(3)
    mujoco.mju_rotVecQuat(result, vector, np.asarray(quaternion, dtype=float))
    return result
