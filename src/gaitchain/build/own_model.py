"""A robot's own model: its file, with every joint, actuator and contact, on a floor.

Builds walk the skeleton, legs under one rigid body on box soles, as that is several
times as fast. This is the robot as its maker describes it: arms that its own actuators
hold, soles as they are, its own friction, contacts and solver. Ours.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.actuators import BY_JOINT
from gaitchain.backends.model import OfRobot, OtherRobotError
from gaitchain.build.own_floor import add_floor
from gaitchain.discover.catalogue import find_robot_file
from gaitchain.discover.isolate import drop_actuators
from gaitchain.discover.load import load_model
from gaitchain.discover.tendons import pulling_at
from gaitchain.errors import CommandError, RobotFileError
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY
from gaitchain.robot.robot import Robot
from gaitchain.sim.overlaps import exclude_overlaps
from gaitchain.sim.scene import add_link_errors, shift_com
from gaitchain.sim.stability import (
    explicit_damping,
    most_damping,
)
from gaitchain.sim.world import World

_ROUNDED = 1e-6  # part of a rotor's inertia


def own_model(file: str | Path, robot: Robot, world: World) -> mujoco.MjModel:
    """Return the robot's own model on a floor.

    Args:
        file: the robot's MJCF or URDF, or its name in a collection.
        robot: the robot that was found in it; a joint that the file leaves without an
            actuator, as a URDF does, gets one. What pulls at legs by a tendon or a
            crank, which gets no target, is left out.
        world: slope and errors of the links; the rest of it has no effect.
    """
    spec = own_spec(file, robot).spec.copy()
    spec.option.gravity = -GRAVITY * np.array(world.up)
    drop_actuators(spec, pulling_at(spec, robot.legs.joint_names))
    _drive_all(spec, robot)
    shift_com(spec.bodies[1], world)
    add_link_errors(spec, world)
    return spec.compile()


def own_digest(file: str | Path, robot: Robot) -> str:
    """Return a hash of all that is simulated of a robot's own model.

    The robot's fingerprint has not all of it: no friction or contacts, no arms.

    Returns:
        The hash; empty if there is no such model, or it cannot be simulated.
    """
    if robot.boxes or robot.identified is not None:
        return ""
    try:
        model = own_model(file, robot, World())
    except (RobotFileError, ValueError):  # the gate says why
        return ""
    return model_digest(model)


def model_digest(model: mujoco.MjModel) -> str:
    """Return a hash of a compiled model, whatever files it was read from."""
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    return hashlib.sha256(content.tobytes()).hexdigest()


def use_implicit_integrator(model: mujoco.MjModel) -> str:
    """Let a model be integrated implicitly that its servos' damping would shake.

    Returns:
        Why; empty if the model's own integrator stays.
    """
    (ratio, joint), most = explicit_damping(model), most_damping(model)
    if ratio <= most:
        return ""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    step_ms = 1000.0 * float(model.opt.timestep)
    return (
        f"implicitfast: at {step_ms:g} ms the file's lets {joint} shake (damping x "
        f"time step / inertia is {ratio:.1f}, at most {most:g} holds; "
        f"{step_ms * most / ratio:.2g} ms would do)"
    )


@contextmanager
def of_its_file(file: str | Path, library: OfRobot) -> Iterator[None]:
    """Say of whatever goes wrong that the file does not do for this library.

    Raises:
        CommandError: it is that of another robot, or cannot be simulated.
    """
    try:
        yield
    except OtherRobotError as error:
        raise CommandError(
            f"{file} is not the file that the library of {library.robot.name} was "
            f"built from: {error}"
        ) from None
    except (CommandError, RobotFileError, ValueError) as error:  # MuJoCo's is the last
        raise CommandError(f"{file} cannot be simulated as it is: {error}") from None


class OwnSpec(NamedTuple):
    """A robot on a floor, without errors of its links."""

    spec: Any
    """Its `mujoco.MjSpec`."""
    parted: tuple[tuple[str, str], ...]
    """Links that pass through each other, see `exclude_overlaps`."""
    step: str
    """Why its time step is not the file's; empty if it is."""


def own_spec(file: str | Path, robot: Robot) -> OwnSpec:
    """Return a robot's file on a floor, with which `own_model` begins.

    Args:
        file: see `own_model`.
        robot: that was found in it.
    """
    path, _ = find_robot_file(file)
    legs = robot.legs
    stand = dict(zip(legs.joint_names, legs.stand.tolist(), strict=True))
    pose = tuple({**legs.held, **stand}.items())
    return _load(path, path.stat().st_mtime_ns, pose)


@lru_cache(maxsize=1)
def _load(path: Path, changed_ns: int, stand: tuple[tuple[str, float], ...]) -> OwnSpec:
    """Read a file once in a process, and again where it has changed since."""
    del changed_ns
    spec = load_model(path).spec
    _weigh(spec)
    parted = exclude_overlaps(spec, dict(stand))
    add_floor(spec, path)
    return OwnSpec(spec, parted, _fit_step(spec))


def _weigh(spec: Any) -> None:
    """Write down what links weigh by their shapes, so that it can be off."""
    whole, from_geoms = spec.compiler.settotalmass > 0.0, mujoco.mjtInertiaFromGeom
    by_shapes = spec.compiler.inertiafromgeom == from_geoms.mjINERTIAFROMGEOM_TRUE
    links = spec.bodies[1:]
    if not (whole or by_shapes or any(not link.explicitinertial for link in links)):
        return
    model = spec.compile()
    for link in links:
        of = model.body(link.name)
        link.mass, link.inertia = float(of.mass[0]), of.inertia
        link.ipos, link.iquat = of.ipos, of.iquat
        link.explicitinertial = True
        link.fullinertia = np.full(6, np.nan)
        link.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    spec.compiler.inertiafromgeom = from_geoms.mjINERTIAFROMGEOM_AUTO
    spec.compiler.settotalmass = -1.0


def _fit_step(spec: Any) -> str:
    """Let time steps divide the control period; return why, if they did not."""
    own_s = float(spec.option.timestep)
    if math.isclose(max(round(CONTROL_PERIOD_S / own_s), 1) * own_s, CONTROL_PERIOD_S):
        return ""
    fit_s = CONTROL_PERIOD_S / math.ceil(CONTROL_PERIOD_S / own_s)
    spec.option.timestep = fit_s
    return (
        f"{1000.0 * fit_s:.3g} ms: the file's {1000.0 * own_s:g} ms do not divide the "
        f"control period of {1000.0 * CONTROL_PERIOD_S:g} ms"
    )


def _drive_all(spec: Any, robot: Robot) -> None:
    """Give an actuator to each joint of the robot that has none, and rotors to legs.

    Joints that a coupling moves stay without: a servo would hold them back.
    """
    driven = {a.target for a in spec.actuators if a.trntype in BY_JOINT}
    legs = robot.legs
    armature = dict(zip(legs.joint_names, legs.armature.ravel(), strict=True))
    idle = {*armature, *legs.held} - driven
    idle -= _followers(spec, driven | armature.keys())
    for joint in spec.joints:
        if joint.name in idle:
            spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        inertia = float(armature.get(joint.name, 0.0))
        # The library's is rounded: a file's that is the same stays to the last digit.
        if inertia > joint.armature * (1.0 + _ROUNDED):
            joint.armature = inertia


def _followers(spec: Any, driven: AbstractSet[str]) -> set[str]:
    """Return joints that others move by a coupling, in which driven ones lead."""
    found = set()
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            one, other = equality.name1, equality.name2
            found.add(other if one in driven else one)
    return found - driven
