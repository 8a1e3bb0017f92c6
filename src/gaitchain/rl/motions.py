"""Reference motions: the walk in physics at each of a grid of commands, sampled."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import settling
from gaitchain.build.jobs import run_jobs
from gaitchain.build.workers import available_cores
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command
from gaitchain.rl.frames import Frames, Motion, Stage, stage_of
from gaitchain.rl.phase import StepPhase
from gaitchain.walker.walker import Walker

_RUN_IN_S = 3.0  # until a walk is steady
_SLACK = 1e-6  # frames: times are sums, rounded


class Asked(NamedTuple):
    """A command of the grid."""

    wanted: Command
    """As the grid has it; corners ask for more than the robot can do at once."""
    command: Command
    """As it is walked: scaled into the library's range, in the same direction."""


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
    """Frames per second [Hz]; 100, one each control period, or a divisor of it."""
    own_file: Path | None = None
    """The robot's file, to walk in its own model; see `stage_of`."""

    @cached_property
    def names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Joints and bodies of a motion in their order, the base first."""
        stage = stage_of(self.library, self.own_file)
        return stage.joint_names, stage.body_names

    @property
    def commands(self) -> list[Asked]:
        """The grid, row by row."""
        return command_grid(self.library.command_range, self.grid)

    @property
    def every(self) -> int:
        """Control periods from frame to frame."""
        return round(1.0 / (CONTROL_PERIOD_S * self.rate_hz))

    @property
    def cycle_s(self) -> float:
        """Planned time of a cycle of two steps [s]."""
        return 2.0 * self.library.timing.step

    def length_to(self, frame_s: float) -> float:
        """Return the least `seconds` with which a frame is at a time or after it.

        Args:
            frame_s: since the first frame [s].
        """
        frames = math.ceil(frame_s * self.rate_hz - _SLACK)
        return (frames * self.every + 1) * CONTROL_PERIOD_S


def command_grid(limits: CommandRange, grid: Sequence[int]) -> list[Asked]:
    """Return the commands of a grid over the whole range.

    Each axis has evenly spaced parts of its limits from -1 to 1, or 0 alone where it
    has no motion; where a direction is missing, 0 in place of all its parts. What asks
    for more than the range is scaled into it, so that the corners lie on its surface.

    Args:
        limits: the range.
        grid: odd numbers of vx, vy and yaw rate.
    """
    axes = []
    for count, (low, high) in zip(grid, limits.limits, strict=True):
        moves = high > low and count > 1
        axes.append(np.linspace(-1.0, 1.0, count) if moves else np.zeros(1))
    # Commands that differ by less than they are rounded to are walked once, too.
    wanted = dict.fromkeys(limits.rounded_at(parts) for parts in product(*axes))
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
    stage = stage_of(plan.library, plan.own_file)
    walk, frames = _Walk(plan.library, stage, command), Frames(stage)
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

    def __init__(self, library: GaitLibrary, stage: Stage, command: Command) -> None:
        self.walker, self.backend = Walker(library), stage.backend
        self._phase = StepPhase(self.walker.gait)
        self._ready: tuple[Array, float] | None = None
        self.backend.connect(self.walker.stand)
        for target in settling(self.walker, self.backend):
            self.backend.write(target)
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
        """Return the targets (m,) [rad] and the phase of this control period."""
        ready, self._ready = self._ready, None
        if ready is not None:
            return ready
        target = self.walker.step(self.backend.read()).position
        self._phase.tick()
        return target, self._phase.value
