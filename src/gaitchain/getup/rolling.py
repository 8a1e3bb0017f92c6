"""Roll a lying robot over onto its other side, to get up from there. Ours.

Most robots roll by a pose or two that are not the same on both sides, drawn at random.
So a robot that gets up from one side gets up from both.
"""

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.build.progress import Progress
from gaitchain.gait.get_up import Side, TimedPose, Way
from gaitchain.getup.fallen_robot import FallenRobot, Start, Subject, fallen_robot
from gaitchain.getup.ways import TURN, judge, timed_pose
from gaitchain.messages import Array

OTHERS, ENOUGH = 24, 23
"""Starts of a trial of a way, and how many of them have to stand."""
_ROUNDS, _CROWD = 12, 24  # rolls of a round
_POSES = 3  # of a roll, at most
_POSE_S, _STRAIGHTENS_S = 0.6, 1.2
_FEW = 3  # starts from which a roll has to end on the other side, to be tried
_ON_THE_OTHER, _STILL = 0.8, 0.1  # cosine between trunk and floor; [legs/s]
_BANK = 104729  # begins the seeds of its starts, which no other search has


class RollSearch:
    """The search of a way over the other side."""

    def __init__(self, subject: Subject, side: Side, seed: int, workers: int) -> None:
        """Make ready.

        Args:
            subject: the robot.
            side: what it lies on.
            seed: of the rolls and of how it lies.
            workers: processes at once.
        """
        self._subject, self._side, self._seed = subject, side, seed
        self._robot, self._workers = fallen_robot(subject), workers
        self._rng = np.random.default_rng((_BANK, seed))

    def run(self, rest: Way, progress: Progress) -> Way:
        """Return the way that stands from most starts; it may be from none.

        Args:
            rest: the way up from the other side.
            progress: called after each round.
        """
        best, stage = Way(rest.poses, 0, OTHERS), f"over from the {self._side}"
        for number in range(_ROUNDS):
            progress(stage, number, _ROUNDS)
            for roll in self._rolls():
                stood = self._stood((*roll, *rest.poses))
                if stood > best.stood:
                    best = Way((*roll, *rest.poses), stood, OTHERS)
                if stood >= ENOUGH:
                    progress(stage, _ROUNDS, _ROUNDS)
                    return best
        progress(stage, _ROUNDS, _ROUNDS)
        return best

    def _rolls(self) -> list[tuple[TimedPose, ...]]:
        """Draw rolls; return those that end on the other side from a few starts."""
        drawn = [roll_of(self._robot, self._drawn()) for _ in range(_CROWD)]
        starts = self._starts(_FEW)
        jobs = [(self._subject, self._side, roll, starts) for roll in drawn]
        came = run_jobs(rolls_over, jobs, bool, self._workers)
        return [roll for roll, rolled in zip(drawn, came, strict=True) if rolled]

    def _drawn(self) -> Array:
        poses = int(self._rng.integers(1, _POSES + 1))
        return self._rng.normal(0.0, 1.0, (poses, len(_movable(self._robot))))

    def _starts(self, count: int) -> tuple[Start, ...]:
        numbers = self._rng.integers(2**31, size=count)
        return tuple((_BANK, self._seed, int(number)) for number in numbers)

    def _stood(self, poses: tuple[TimedPose, ...]) -> int:
        """Return from how many other starts the whole way stands."""
        jobs = [
            (self._subject, self._side, poses, start) for start in self._starts(OTHERS)
        ]
        return sum(run_jobs(stands_after, jobs, bool, self._workers))


def roll_of(robot: FallenRobot, numbers: Array) -> tuple[TimedPose, ...]:
    """Return the poses of a roll, and the one in which a robot lies straight.

    Args:
        robot: of the joints.
        numbers: (poses, joints) changes from the standing pose, of the joints of the
            legs and of those that move on a way, each side by itself [rad].
    """
    poses, last = [], robot.stand
    for changes in np.clip(numbers, -TURN, TURN):
        angles = robot.stand.copy()
        angles[_movable(robot)] += changes
        angles = np.clip(angles, robot.lower, robot.upper)
        poses.append(timed_pose(robot, last, angles, _POSE_S))
        last = np.array(poses[-1].angles)
    return (*poses, timed_pose(robot, last, robot.stand, _STRAIGHTENS_S))


def rolls_over(
    subject: Subject,
    side: Side,
    roll: tuple[TimedPose, ...],
    starts: tuple[Start, ...],
) -> bool:
    """Whether a robot lies still on its other side after a roll, from all starts."""
    robot = fallen_robot(subject)
    ahead = 1.0 if side == "front" else -1.0
    for start in starts:
        robot.lie(side, start)
        look = robot.move(Way(roll, 0, 1))[-1]
        if ahead * look.ahead < _ON_THE_OTHER or look.speed > _STILL:
            return False
    return True


def stands_after(
    subject: Subject, side: Side, poses: tuple[TimedPose, ...], start: Start
) -> bool:
    """Lie down at random and take some poses; return whether the robot stands."""
    robot = fallen_robot(subject)
    robot.lie(side, start)
    return judge(robot.move(Way(poses, 0, 1))).stood


def _movable(robot: FallenRobot) -> list[int]:
    """Return the joints of the legs, and those of both sides that move on a way."""
    pairs = {row for pair in robot.pairs for row in (pair.left, pair.right)}
    return sorted(pairs.union(robot.leg_rows))
