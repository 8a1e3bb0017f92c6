"""A robot that fell, in its own model: how it lies, and moves from pose to pose."""

import math
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.model import ModelBackend
from gaitchain.build.own_model import own_model, use_implicit_integrator
from gaitchain.errors import CommandError
from gaitchain.gait.get_up import Side, Way, way_targets
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.getup.squats import Pitches, Squats
from gaitchain.getup.symmetry import Pair, mirrored_pairs
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.sim.bodies import subtree
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

Start = tuple[int, ...]
"""Seed of how a robot lies, its links' masses and the floor's friction."""

_TURN, _JOINT = 0.3, 0.3  # of how it lies, either way [rad]
_LINKS, _LEAST_GRIP = 0.1, 0.6  # either way of each link's mass; of the file's friction
_ABOVE = 0.02  # of its height, from where it is let fall
_SETTLES_S, _LIMP_S, _HOLDS_S, _LOOKS_S = 2.0, 1.0, 1.0, 0.05
_UPRIGHT, _HIGH, _STILL = 0.95, 0.9, 0.1
_ACROSS = 0.5  # least cosine between a pitch joint's axis and the left
_REACH = 0.5  # of the CoM's height: from a joint to the end of what it carries
_FOREARM = 0.5  # of that of its arm: what an elbow carries, and no wrist
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class BodyState(NamedTuple):
    """Where a robot is on its way up."""

    up: float
    """Cosine of the trunk's tilt."""
    ahead: float
    """How far its x axis points up: 1 on its back, -1 on its front."""
    high: float
    """Height of the CoM, of that of the standing robot."""
    off: float
    """Horizontal distance of the CoM from between the feet, in legs."""
    lifted: float
    """Height of the higher foot above where it is in a stand, in legs."""
    speed: float
    """Of the CoM, in legs a second."""
    flat: float
    """Cosine of the tilt of the foot that is tilted most; 1 as in a stand."""

    @property
    def stands(self) -> bool:
        """Whether it stands."""
        upright = self.up > _UPRIGHT and self.high > _HIGH
        return upright and self.speed < _STILL


class _Lying(NamedTuple):
    """A robot on the floor, to be put there again."""

    state: Array
    mass: Array
    inertia: Array
    friction: Array
    pair_friction: Array


class FallenRobot:
    """The robot's own model on a floor, and what can be done with it lying there."""

    def __init__(self, file: str | Path, library: GaitLibrary) -> None:
        """Put the robot into its model.

        Args:
            file: the robot's MJCF or URDF.
            library: of that robot.

        Raises:
            CommandError: the robot has no file, or a joint, its actuator, the free
                joint or the floor is missing.
        """
        if library.robot.of_boxes:
            raise CommandError(
                f"{library.robot.name} cannot get up: it is described by two legs and "
                "the trunk's mass, without arms or a shape to lie on; a robot that has "
                "an MJCF or URDF file can, by a library built from that file"
            )
        self.backend = ModelBackend(own_model(file, library.robot, World()), library)
        use_implicit_integrator(self.backend.model)
        names = self.backend.joint_names
        self.stand = Walker(library, require_qualified=False, joint_names=names).stand
        self._leg = library.robot.reduced.leg_length
        self.backend.connect(self.stand)
        model = self.backend.model
        self._mass, self._inertia = model.body_mass.copy(), model.body_inertia.copy()
        self._friction = model.geom_friction.copy()
        self._pair_friction = model.pair_friction.copy()
        self._lying: dict[tuple[Side, Start], _Lying] = {}
        legs = library.robot.legs
        self.leg_rows = tuple(names.index(name) for name in legs.joint_names)
        self._measure(legs)
        self.lower, self.upper = self._ranges(legs)
        self.speed_limit = _speed_limits(names, legs)
        limits = self.lower, self.upper
        self.squats = Squats(
            self.backend, self.stand, limits, self._feet, self._pitches()
        )

    def _measure(self, legs: LegModel) -> None:
        """Note what a standing robot is like: height, feet, joints that may help."""
        model, data = self.backend.model, self.backend.data
        self._base = self.backend.in_model.base
        joints = list(self.backend.in_model.joints)
        ends = legs.joint_names[len(legs.joint_names) // 2 - 1], legs.joint_names[-1]
        self._feet = [int(model.jnt_bodyid[model.joint(name).id]) for name in ends]
        self.height = float(data.subtree_com[self._base, 2])
        """Of the CoM above the floor in the stand [m]."""
        self._sole = float(data.xpos[self._feet, 2].max())
        self._flat = _third_rows(data, self._feet)
        axes, at = np.array(data.xaxis[joints]), np.array(data.xanchor[joints])
        at[:, 1] -= data.xpos[self._feet, 1].mean()
        pairs = mirrored_pairs(at, axes, self.height)
        sides = [pair.left for pair in pairs if pair.left != pair.right]
        self.pairs = tuple(
            pair for pair in pairs if self._helps(pair, axes, legs, sides)
        )
        """Joints that move on the way, both sides alike."""

    def _helps(self, pair: Pair, axes: Array, legs: LegModel, sides: list[int]) -> bool:
        """Whether a pair moves: pitches of the legs, and arms, but no hand or head."""
        if self.backend.joint_names[pair.left] in legs.joint_names:
            return bool(abs(axes[pair.left, 1]) > _ACROSS)
        reach = self._reach(pair.left)
        arm = reach if pair.left == pair.right else self._longest(pair.left, sides)
        return arm > _REACH * self.height and reach > _FOREARM * arm

    def _longest(self, row: int, sides: list[int]) -> float:
        """Return the reach of the first joint of an arm that a joint is of [m]."""
        model, joints = self.backend.model, self.backend.in_model.joints
        of_body = {int(model.jnt_bodyid[joints[side]]): side for side in sides}
        longest, body = self._reach(row), int(model.jnt_bodyid[joints[row]])
        while body:
            body = int(model.body_parentid[body])
            if body in of_body:
                longest = max(longest, self._reach(of_body[body]))
        return longest

    def _reach(self, row: int) -> float:
        """Return how far from a joint the end is of what it carries [m]."""
        model, data = self.backend.model, self.backend.data
        joint = self.backend.in_model.joints[row]
        carried = subtree(model, int(model.jnt_bodyid[joint]))
        ends = [
            data.geom_xpos[geom] + _corners(model, geom) @ turn.reshape(3, 3).T
            for geom, turn in enumerate(data.geom_xmat)
            if model.geom_bodyid[geom] in carried
        ]
        away = np.concatenate([*ends, data.xanchor[joint][None]]) - data.xanchor[joint]
        return float(np.linalg.norm(away, axis=1).max())

    def _pitches(self) -> Pitches | None:
        """Return the pairs that bend the legs, from the hip down, if they are three."""
        known = {pair.left: pair for pair in self.pairs}
        found = [known[row] for row in self.leg_rows if row in known]
        return Pitches(*found) if len(found) == len(Pitches._fields) else None

    def _ranges(self, legs: LegModel) -> tuple[Array, Array]:
        """Return the joints' limits, half a turn where the file has none [rad]."""
        model, joints = self.backend.model, list(self.backend.in_model.joints)
        limited = model.jnt_limited[joints].astype(bool)[:, None]
        span = np.where(limited, model.jnt_range[joints], [-math.pi, math.pi])
        of_legs = zip(legs.joint_names, legs.lower, legs.upper, strict=True)
        for name, low, high in of_legs:
            row = self.backend.joint_names.index(name)
            span[row] = max(span[row, 0], low), min(span[row, 1], high)
        return span[:, 0], span[:, 1]

    def lie(self, side: Side, start: Start) -> None:
        """Let the robot fall onto a side, in a world of its own, and lie straight.

        Args:
            side: what it lies on.
            start: how, and in what world.
        """
        known = self._lying.get((side, start))
        if known is None:
            self._fall(side, np.random.default_rng(start))
            known = self._lying[side, start] = self._noted()
        self._put(known)

    def collapse(self, side: Side, start: Start) -> None:
        """Let the robot fall onto a side, and lie limp, as after a fall on its way.

        Args:
            side: what it falls on.
            start: how, and in what world.
        """
        self._fall(side, np.random.default_rng(start))
        self.backend.release()
        for _ in range(round(_LIMP_S / CONTROL_PERIOD_S)):
            self.backend.write(self.stand)
        self.backend.engage()

    def _fall(self, side: Side, rng: np.random.Generator) -> None:
        model, backend = self.backend.model, self.backend
        factor = 1.0 + rng.uniform(-_LINKS, _LINKS, model.nbody)
        model.body_mass[:] = factor * self._mass
        model.body_inertia[:] = factor[:, None] * self._inertia
        grip = rng.uniform(_LEAST_GRIP, 1.0)
        model.geom_friction[:] = grip * self._friction
        model.pair_friction[:] = grip * self._pair_friction
        mujoco.mj_setConst(model, backend.data)
        angles = self.stand + rng.uniform(-_JOINT, _JOINT, len(self.stand))
        angles = np.clip(angles, self.lower, self.upper)
        backend.connect(angles)
        pitch = 0.5 * math.pi if side == "front" else -0.5 * math.pi
        self._turn(rng.uniform(-_TURN, _TURN, 2) + np.array([0.0, pitch]))
        for tick in range(round(_SETTLES_S / CONTROL_PERIOD_S)):
            part = min(2.0 * tick * CONTROL_PERIOD_S / _SETTLES_S, 1.0)
            backend.write(angles + part * (self.stand - angles))

    def _noted(self) -> _Lying:
        model = self.backend.model
        masses = model.body_mass.copy(), model.body_inertia.copy()
        grips = model.geom_friction.copy(), model.pair_friction.copy()
        return _Lying(self.state, *masses, *grips)

    @property
    def state(self) -> Array:
        """All that its motion depends on from here, in the world in which it lay."""
        model = self.backend.model
        state = np.zeros(mujoco.mj_stateSize(model, _STATE))
        mujoco.mj_getState(model, self.backend.data, state, _STATE)
        return state

    def go_back(self, side: Side, start: Start, state: Array) -> None:
        """Put the robot where it was on its way up.

        Args:
            side: what it lay on.
            start: how, and in what world.
            state: see `state`.
        """
        self.lie(side, start)
        mujoco.mj_setState(self.backend.model, self.backend.data, state, _STATE)
        mujoco.mj_forward(self.backend.model, self.backend.data)

    def _put(self, lying: _Lying) -> None:
        model, data = self.backend.model, self.backend.data
        model.body_mass[:], model.body_inertia[:] = lying.mass, lying.inertia
        model.geom_friction[:] = lying.friction
        model.pair_friction[:] = lying.pair_friction
        mujoco.mj_setConst(model, data)
        mujoco.mj_setState(model, data, lying.state, _STATE)
        mujoco.mj_forward(model, data)

    def _turn(self, roll_pitch: Array) -> None:
        """Turn the standing robot about its own origin, and lift it off the floor."""
        data, free = self.backend.data, self.backend.in_model.free
        for axis, angle in zip(np.eye(3), roll_pitch, strict=False):
            turn, before = np.zeros(4), data.qpos[free + 3 : free + 7].copy()
            mujoco.mju_axisAngle2Quat(turn, axis, angle)
            mujoco.mju_mulQuat(data.qpos[free + 3 : free + 7], turn, before)
        mujoco.mj_kinematics(self.backend.model, data)
        data.qpos[free + 2] += _ABOVE * self.height - min(self.backend.above_floor())
        mujoco.mj_forward(self.backend.model, data)

    def move(
        self, way: Way, begin: Array | None = None, hold_s: float = _HOLDS_S
    ) -> list[BodyState]:
        """Go through the poses of a way and hold the last; look again and again.

        Args:
            way: the poses.
            begin: (n,) targets before the first; the standing pose by default [rad].
            hold_s: how long the last is held [s].
        """
        start = self.stand if begin is None else begin
        rows = way_targets(way, start, CONTROL_PERIOD_S)
        hold = np.repeat(rows[-1:], round(hold_s / CONTROL_PERIOD_S), axis=0)
        seen, every = [], round(_LOOKS_S / CONTROL_PERIOD_S)
        for tick, row in enumerate(np.concatenate([rows, hold])):
            self.backend.write(row)
            if tick % every == 0:
                seen.append(self.look())
        return seen

    def look(self) -> BodyState:
        """Return where the robot is."""
        model, data = self.backend.model, self.backend.data
        mujoco.mj_subtreeVel(model, data)
        com, feet = data.subtree_com[self._base], data.xpos[self._feet]
        axes = data.xmat[self._base].reshape(3, 3)[2] @ self.backend.in_model.turn
        return BodyState(
            float(axes[2]),
            float(axes[0]),
            float(com[2] / self.height),
            float(np.hypot(*(com - feet.mean(axis=0))[:2]) / self._leg),
            float(max(feet[:, 2].max() - self._sole, 0.0) / self._leg),
            float(np.linalg.norm(data.subtree_linvel[self._base]) / self._leg),
            float((_third_rows(data, self._feet) * self._flat).sum(axis=1).min()),
        )


def _third_rows(data: mujoco.MjData, bodies: list[int]) -> Array:
    """Return which way is up for some bodies, in their frames (n, 3)."""
    return np.array(data.xmat[bodies].reshape(-1, 3, 3)[:, 2])


def _corners(model: mujoco.MjModel, geom: int) -> Array:
    """Return the corners of the box around a geom, in its frame (8, 3) [m]."""
    middle, half = np.split(model.geom_aabb[geom], 2)
    signs = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0
    return np.asarray(middle + signs * half)


def _speed_limits(names: tuple[str, ...], legs: LegModel) -> Array:
    """Return how fast each joint may turn; files limit legs only [rad/s]."""
    known = dict(zip(legs.joint_names, legs.speed_limit.tolist(), strict=True))
    return np.array([known.get(name, max(known.values())) for name in names])


class Subject:
    """A library's robot and its file, told from others by what they are."""

    def __init__(self, file: str | Path, library: GaitLibrary) -> None:
        """Take both; the model is made where it is needed, once in a process."""
        self.file, self.library = str(file), library
        # All of the library, as the stand is its own and not the robot's.
        content = sha256(library_bytes(library)).hexdigest()
        self._key = self.file, _changed_at(Path(file)), content

    def __eq__(self, other: object) -> bool:
        """Whether it is the same library and the same file, unchanged."""
        return isinstance(other, Subject) and self._key == other._key

    def __hash__(self) -> int:
        """Return the same number for the same ones in one process."""
        return hash(self._key)


def _changed_at(file: Path) -> int | None:
    """Return when a file was changed [ns]; None of a name, or where there is none."""
    try:
        return file.stat().st_mtime_ns
    except OSError:
        return None


@lru_cache(maxsize=1)
def fallen_robot(subject: Subject) -> FallenRobot:
    """Return the robot in its model."""
    return FallenRobot(subject.file, subject.library)
