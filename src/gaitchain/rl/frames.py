"""Frames of a walk: joints, bodies and their velocities, in one model or another."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.backends.whole_body import WholeBodyBackend
from gaitchain.build.own_model import of_its_file, own_model, use_implicit_integrator
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import LEAST_LOAD
from gaitchain.messages import GRAVITY, Array
from gaitchain.sim.world import World

_BASE_POSITIONS, _BASE_RATES = 7, 6
_SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


@dataclass(frozen=True, eq=False)
class Motion:
    """A walk at one command, F frames; the robot has n joints and B bodies.

    The frame is the world's, in which the walk began along x; quaternions are w x y z.
    """

    time: Array
    """(F,) since the first frame, at which the left leg begins its support [s]."""
    phase: Array
    """(F,) place in the cycle of two steps, 0 to 1."""
    target: Array
    """(F, n) what the walk asks of the servos [rad]; of a joint that has none, and
    follows others, where it is."""
    qpos: Array
    """(F, 7 + n) base's position [m] and quaternion, joints [rad]."""
    qvel: Array
    """(F, 6 + n) base's velocity in the world [m/s], angular one in the base's frame
    [rad/s], joints [rad/s]."""
    heading: Array
    """(F,) of the pelvis in the world, 0 along x [rad]."""
    contact: Array
    """(F, 2) 1 where the left, the right foot carries 2 % of the weight or more."""
    body_position: Array
    """(F, B, 3) [m]"""
    body_quaternion: Array
    """(F, B, 4)"""
    body_velocity: Array
    """(F, B, 3) of the bodies' origins [m/s]"""
    body_rate: Array
    """(F, B, 3) angular velocity [rad/s]"""
    fell: bool
    """Whether the robot fell, at the last frame."""


class Stage(NamedTuple):
    """Where a library walks, and what is filmed there."""

    backend: MujocoBackend | WholeBodyBackend
    base: int
    """Body of the base."""
    turn: Array
    """(3, 3) columns: the pelvis' axes in the base."""
    joints: list[int]
    """All of the robot's in the model's order, hinges and slides."""
    bodies: list[int]
    """Its bodies in the model's order, the base first."""
    targets: Callable[[Array], dict[str, float]]
    """Returns targets of joints by name from those of the legs."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        model = self.backend.model
        return tuple(model.joint(j).name for j in self.joints)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        model = self.backend.model
        return tuple(model.body(b).name for b in self.bodies)


def stage_of(library: GaitLibrary, own_file: Path | None = None) -> Stage:
    """Set a stage in the nominal world.

    Args:
        library: whose robot it is.
        own_file: the robot's MJCF or URDF, to walk in its own model, arms and all; the
            skeleton that builds walk by default.

    Raises:
        CommandError: that file is of another robot, or cannot be simulated.
    """
    if own_file is None:
        return _skeleton(library)
    with of_its_file(own_file, library):
        model = own_model(own_file, library.robot, World())
        use_implicit_integrator(model)
        return _own(WholeBodyBackend(model, library), library)


def _skeleton(library: GaitLibrary) -> Stage:
    backend = MujocoBackend(library.robot)
    model, names = backend.model, library.robot.legs.joint_names
    bodies = list(range(1, model.nbody))

    def targets(legs: Array) -> dict[str, float]:
        return dict(zip(names, legs.tolist(), strict=True))

    joints = [model.joint(name).id for name in names]
    return Stage(backend, bodies[0], np.eye(3), joints, bodies, targets)


def _own(backend: WholeBodyBackend, library: GaitLibrary) -> Stage:
    model, names = backend.model, backend.whole_joint_names
    base = int(model.jnt_bodyid[backend.free_joint])
    bodies = [b for b in range(model.nbody) if model.body_rootid[b] == base]
    kind, body = model.jnt_type, model.jnt_bodyid
    joints = [j for j in range(model.njnt) if kind[j] in _SCALAR and body[j] in bodies]

    def targets(legs: Array) -> dict[str, float]:
        return dict(zip(names, backend.with_legs(legs).tolist(), strict=True))

    turn = np.array(library.robot.legs.base_turn)
    return Stage(backend, base, turn, joints, bodies, targets)


class Frames:
    """Frames of a motion, with the velocities of all bodies at the same instant."""

    def __init__(self, stage: Stage) -> None:
        """Film a stage."""
        self._stage, self._model = stage, stage.backend.model
        # Its own data, as those of the simulation lag their state by a time step.
        self._data = mujoco.MjData(self._model)
        self._weight = float(self._model.body_mass.sum()) * GRAVITY
        self._names = stage.joint_names
        model, free = self._model, int(self._model.body_jntadr[stage.base])
        at, rate = int(model.jnt_qposadr[free]), int(model.jnt_dofadr[free])
        base = np.arange(_BASE_POSITIONS)
        self._qpos = np.concatenate([at + base, model.jnt_qposadr[stage.joints]])
        base = np.arange(_BASE_RATES)
        self._qvel = np.concatenate([rate + base, model.jnt_dofadr[stage.joints]])
        self._rows: list[tuple[Array, ...]] = []

    def add(self, target: Array, phase: float) -> None:
        """Add the state of the simulation.

        Args:
            target: (m,) of the legs' joints [rad].
            phase: see `Motion`.
        """
        stage, data = self._stage, self._data
        data.qpos[:] = stage.backend.data.qpos
        data.qvel[:] = stage.backend.data.qvel
        for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            compute(self._model, data)
        rates = np.array([self._rate(body) for body in stage.bodies])
        loads = stage.backend.foot_loads()
        qpos = data.qpos[self._qpos]
        asked, own = stage.targets(target), qpos[_BASE_POSITIONS:]
        aims = [asked.get(n, q) for n, q in zip(self._names, own, strict=True)]
        self._rows.append(
            (
                np.array(phase),
                np.array(aims),
                qpos,
                data.qvel[self._qvel],
                self._heading(),
                (loads >= LEAST_LOAD * self._weight).astype(float),
                data.xpos[stage.bodies],
                data.xquat[stage.bodies],
                rates[:, 3:],
                rates[:, :3],
            )
        )

    def _heading(self) -> Array:
        base = self._data.xmat[self._stage.base].reshape(3, 3)
        ahead = base @ self._stage.turn[:, 0]
        return np.asarray(np.arctan2(ahead[1], ahead[0]))

    def _rate(self, body: int) -> Array:
        """Return angular and linear velocity of a body's origin in the world, (6,)."""
        found = np.empty(6)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(self._model, self._data, kind, body, found, 0)
        return found

    def motion(self, rate_hz: int, fell: bool) -> Motion:
        """Return what was added."""
        names = [field.name for field in fields(Motion)][1:-1]
        columns = zip(*self._rows, strict=True) if self._rows else [()] * len(names)
        found = {n: np.array(c) for n, c in zip(names, columns, strict=True)}
        time = np.arange(len(self._rows)) / rate_hz
        return Motion(time=time, **found, fell=fell)
