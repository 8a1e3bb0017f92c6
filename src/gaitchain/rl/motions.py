"""Reference motions: the walk in physics at each of a grid of commands, sampled."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.jobs import run_jobs
from gaitchain.build.workers import available_cores
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Command
from gaitchain.rl.phase import StepPhase
from gaitchain.walker.walker import Walker

_SETTLE_TICKS = 100  # of standing
_RUN_IN_S = 3.0  # until a walk is steady
_TOUCHES = 0.02  # part of the weight on a foot that is in contact
_BASE_POSITIONS, _BASE_RATES = 7, 6


class Asked(NamedTuple):
    """A command of the grid."""

    wanted: Command
    """As the grid has it; corners ask for more than the robot can do at once."""
    command: Command
    """As it is walked: scaled into the library's range, in the same direction."""


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
    """(F, n) what the walk asks of the servos [rad]."""
    qpos: Array
    """(F, 7 + n) base's position [m] and quaternion, joints [rad]."""
    qvel: Array
    """(F, 6 + n) base's velocity in the world [m/s], angular one in the base's frame
    [rad/s], joints [rad/s]."""
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


@dataclass(frozen=True)
class Plan:
    """What is to be walked."""

    library: GaitLibrary
    """The gaits."""
    grid: tuple[int, int, int]
    """Numbers of speeds ahead, aside and around."""
    seconds: float
    """Length of each motion [s]."""
    rate_hz: int
    """Frames a second; 100 are as many of them."""

    @property
    def commands(self) -> list[Asked]:
        """The grid, row by row."""
        return command_grid(self.library.command_range, self.grid)

    @property
    def every(self) -> int:
        """Control periods from frame to frame."""
        return round(1.0 / (CONTROL_PERIOD_S * self.rate_hz))


def command_grid(limits: CommandRange, grid: Sequence[int]) -> list[Asked]:
    """Return the commands of a grid over the whole range.

    Each axis has evenly spaced parts of its limits from -1 to 1, or 0 alone where it
    has no motion. What asks for more than the range is scaled into it, so that the
    corners lie on its surface.

    Args:
        limits: the range.
        grid: odd numbers of vx, vy and yaw rate.
    """
    axes = []
    for count, (low, high) in zip(grid, limits.limits, strict=True):
        moves = high > low and count > 1
        axes.append(np.linspace(-1.0, 1.0, count) if moves else np.zeros(1))
    wanted = (limits.rounded_at(parts) for parts in product(*axes))
    return [Asked(command, limits.clamp(command)[0]) for command in wanted]


def record_motions(plan: Plan, workers: int | None = None) -> Iterator[Motion]:
    """Walk each command of a plan in the nominal world.

    Args:
        plan: what is to be walked.
        workers: number of processes; all cores by default.

    Yields:
        The motions, in the order of `plan.commands`.
    """
    jobs = [(plan, asked.command) for asked in plan.commands]
    yield from run_jobs(record_motion, jobs, Motion, workers or available_cores())


def record_motion(plan: Plan, command: Command) -> Motion:
    """Walk one command: stand, three seconds of run-in, then the motion.

    Args:
        plan: length and rate of the motion.
        command: within the library's range.
    """
    walk = _Walk(plan.library, command)
    frames = _Frames(walk.backend, walk.walker.stand)
    ticks = round(plan.seconds / CONTROL_PERIOD_S)
    for tick in range(ticks):
        if walk.backend.fallen:
            break
        target, phase = walk.next_target()
        if tick % plan.every == 0:
            frames.add(target, phase)
        walk.backend.write(target)
    return frames.motion(plan.rate_hz, walk.backend.fallen)


class _Walk:
    """A walk at a constant command, from the start of a cycle on."""

    def __init__(self, library: GaitLibrary, command: Command) -> None:
        self.walker = Walker(library)
        self.backend = MujocoBackend(library.robot)
        self._phase = StepPhase(self.walker.gait)
        self._ready: tuple[Array, float] | None = None
        self.backend.connect(self.walker.stand)
        for _ in range(_SETTLE_TICKS):
            self.backend.write(self.walker.stand)
        self._go(round(self.walker.gait.rest_s / CONTROL_PERIOD_S))
        self.walker.command(command)
        self._go(round(_RUN_IN_S / CONTROL_PERIOD_S))
        if not (command.stops or self.backend.fallen):
            self._to_cycle_start()

    def _go(self, ticks: int) -> None:
        for _ in range(ticks):
            self.backend.write(self.next_target()[0])

    def _to_cycle_start(self) -> None:
        """Go on until the left leg begins its support; keep that period's target."""
        gait = self.walker.gait
        most = round(4.0 * self.walker.library.timing.step / CONTROL_PERIOD_S)
        for _ in range(most):
            before = gait.steps
            found = self.next_target()
            if gait.steps > before and gait.state.left_support:
                self._ready = found
                return
            self.backend.write(found[0])

    def next_target(self) -> tuple[Array, float]:
        """Return the targets (n,) [rad] and the phase of this control period."""
        ready, self._ready = self._ready, None
        if ready is not None:
            return ready
        target = self.walker.step(self.backend.read()).position
        self._phase.tick()
        return target, self._phase.value


class _Frames:
    """Frames of a motion, with the velocities of all bodies at the same instant."""

    def __init__(self, backend: MujocoBackend, stand: Array) -> None:
        self._backend, self._model = backend, backend.model
        # Its own data, as those of the simulation lag their state by a time step.
        self._data = mujoco.MjData(self._model)
        self._ends = _BASE_POSITIONS + len(stand), _BASE_RATES + len(stand)
        self._weight = float(self._model.body_mass.sum()) * GRAVITY
        self._rows: list[tuple[Array, ...]] = []

    def add(self, target: Array, phase: float) -> None:
        """Add the state of the simulation."""
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = self._backend.data.qpos, self._backend.data.qvel
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        rates = np.array([self._rate(body) for body in range(1, model.nbody)])
        loads = self._backend.foot_loads()
        positions, velocities = self._ends
        self._rows.append(
            (
                np.array(phase),
                np.array(target),
                data.qpos[:positions].copy(),
                data.qvel[:velocities].copy(),
                (loads >= _TOUCHES * self._weight).astype(float),
                data.xpos[1:].copy(),
                data.xquat[1:].copy(),
                rates[:, 3:],
                rates[:, :3],
            )
        )

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


def body_names(library: GaitLibrary) -> tuple[str, ...]:
    """Return the bodies of a motion in their order, the trunk first."""
    model = MujocoBackend(library.robot).model
    return tuple(model.body(i).name for i in range(1, model.nbody))
