"""How long a robot takes to stop, and how far it goes on, in the worlds of a proof."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.simulated_walk import SETTLE_S, follow_schedule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Schedule, due_commands
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

QUANTILES = 0.5, 0.95, 1.0


class Stop(NamedTuple):
    """How a walk ended after the command to stand."""

    seconds: float
    """From the command until the last step was over [s]."""
    metres: float
    """Farthest that the trunk came meanwhile from where it was at the command [m]."""
    stood: bool
    """Whether it stood for a second within the time that it is given."""
    fell: bool
    """Whether it fell, before that or while it walked; others never stood still."""


@dataclass(frozen=True)
class StopReport:
    """How a library stops."""

    walks: int
    stood: int
    """Walks that came to a stand; the quantiles are of these."""
    fell: int
    """Walks that fell. The others are those that never stood still."""
    parts: tuple[float, ...]
    """Parts of the walks that the quantiles are of; 1 is the largest."""
    seconds: tuple[float, ...]
    """Quantiles of the time [s]; empty if none stood."""
    metres: tuple[float, ...]
    """Quantiles of the distance [m]; empty if none stood."""


def measure_stop(library: GaitLibrary, world: World, schedule: Schedule) -> Stop:
    """Walk a schedule of commands in seconds, and stop.

    Args:
        library: a qualified library.
        world: the world.
        schedule: the commands; the one to stand follows the last of them.
    """
    backend = MujocoBackend(library.robot, world)
    walked = follow_schedule(Walker(library), backend, schedule)
    end_s = due_commands(schedule, library.timing.step)[-1][0]
    begun = round(end_s / CONTROL_PERIOD_S)
    path = np.array([pose[:2] for pose in walked.base[begun:]]).reshape(-1, 2)
    fell = walked.fell_at_s is not None
    if fell or not len(path):
        return Stop(math.inf, math.inf, stood=False, fell=fell)
    seconds = len(path) * CONTROL_PERIOD_S - SETTLE_S
    metres = float(np.linalg.norm(path - path[0], axis=1).max())
    return Stop(max(seconds, 0.0), metres, walked.stood, fell)


def judge_stops(stops: Sequence[Stop]) -> StopReport:
    """Combine stops to quantiles."""
    stood = [stop for stop in stops if stop.stood]
    return StopReport(
        len(stops),
        len(stood),
        sum(stop.fell for stop in stops),
        QUANTILES,
        _quantiles([stop.seconds for stop in stood]),
        _quantiles([stop.metres for stop in stood]),
    )


def _quantiles(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(np.quantile(values, QUANTILES).tolist()) if values else ()
