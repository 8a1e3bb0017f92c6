"""Let a robot get up from starts that no search has seen, as it would online. Ours."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.gait.get_up import GetUp, Side
from gaitchain.getup.fallen_robot import FallenRobot, Start, Subject, fallen_robot
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.walker.riser import Riser, Rising

_STANDS_S = 1.0  # after it said that it is up
_UNSEEN = 7919  # begins the seeds of trials, which no search has


class RiseResult(NamedTuple):
    """What came of one fall."""

    stood: bool
    tries: int
    seconds: float
    """From lying limp until it says that it stands, or gives up [s]."""


class RiseRecording(NamedTuple):
    """One fall to be drawn."""

    model: mujoco.MjModel
    time_s: Array
    """(N,) [s]"""
    qpos: Array
    """(N, nq) positions in the model."""


def try_rising(
    subject: Subject, found: GetUp, side: Side, runs: int, seed: int, workers: int
) -> Iterator[RiseResult]:
    """Yield what comes of each of a number of falls.

    The robot falls at random onto a side and lies limp. Then the riser has it, with no
    more than what its joints and an IMU measure.

    Args:
        subject: the robot.
        found: its ways.
        side: what it falls on.
        runs: how many falls.
        seed: of the falls.
        workers: processes at once.
    """
    jobs = [(subject, found, side, _start(seed, run)) for run in range(runs)]
    return run_jobs(rise, jobs, RiseResult, workers)


def rise(subject: Subject, found: GetUp, side: Side, start: Start) -> RiseResult:
    """Let the robot fall, and get up."""
    robot, riser = fallen_robot(subject), Riser(found)
    ticks = [riser.state for _ in _rising(robot, riser, side, start)]
    ends = (Rising.UP, Rising.GIVEN_UP)
    took_s = sum(state not in ends for state in ticks) * CONTROL_PERIOD_S
    up = riser.state is Rising.UP
    return RiseResult(up and robot.look().stands, riser.tries, took_s)


def record_rise(subject: Subject, found: GetUp, side: Side, seed: int) -> RiseRecording:
    """Return the first of the falls of `try_rising` with a seed, to be drawn."""
    robot = fallen_robot(subject)
    data = robot.backend.data
    walked = _rising(robot, Riser(found), side, _start(seed, 0))
    rows = np.array([data.qpos.copy() for _ in walked])
    time_s = CONTROL_PERIOD_S * np.arange(len(rows), dtype=float)
    return RiseRecording(robot.backend.model, time_s, rows)


def _start(seed: int, run: int) -> Start:
    return _UNSEEN, seed, run


def _rising(
    robot: FallenRobot, riser: Riser, side: Side, start: Start
) -> Iterator[None]:
    """Let the robot fall and get up; yield once in each control period."""
    robot.collapse(side, start)
    riser.begin(robot.backend.read().joint_position)
    stands = 0
    while stands < round(_STANDS_S / CONTROL_PERIOD_S):
        robot.backend.write(riser.step(robot.backend.read()))
        stands += riser.state in (Rising.UP, Rising.GIVEN_UP)
        yield
