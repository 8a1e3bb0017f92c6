"""Replays of one motion of a log, and the fit of numbers to it. Ours."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.jobs import arrivals
from gaitchain.identify.joint_climb import JointClimb
from gaitchain.identify.joint_search import JointSearch
from gaitchain.identify.log import Measured, MotionLog
from gaitchain.identify.parameters import Parameters
from gaitchain.identify.rounds import Rounds
from gaitchain.identify.sensor_rows import (
    columns,
    spread,
    unbiased,
    weights_of,
)
from gaitchain.identify.simulated import replay
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

NOISE = 1.5
"""Likeness of each joint's residuals, see `spread`, with which a climb ends: that of
the true numbers is up to 1.4."""
_FALLEN = 1.0  # residual of a row that the replay did not reach; no joint's else [rad]

Columns = NDArray[np.int64]


class Belief(NamedTuple):
    """Mean and covariance of all numbers, in believed deviations."""

    mean: Array
    covariance: Array


class Generation(NamedTuple):
    """What came of a generation of a climb."""

    missed: Array
    """(M, S) squared residuals of each sensor, over their variance."""
    alike: float
    """Largest likeness of a joint's residuals with the numbers found before."""


class MotionFit(ABC):
    """One motion of a log, and replays of it."""

    rough: float
    """Times its residual that a row counts as: where slopes differ from place to place,
    a fit ends where more than noise is missed."""

    def __init__(
        self, robot: Robot, log: MotionLog, parameters: Parameters, workers: int
    ) -> None:
        """Compare replays of a robot with what was measured in a motion.

        Args:
            robot: as in its file.
            log: of the motion.
            parameters: what is fitted.
            workers: number of processes; the result does not depend on it.
        """
        self._robot, self._log, self._parameters = robot, log, parameters
        self._workers, self._joints = workers, len(robot.legs.joint_names)
        self.support = log.motion.support
        measured = columns(log.measured, len(log.motion.targets))
        self._present = np.isfinite(measured)
        self._measured = unbiased(measured)

    @property
    @abstractmethod
    def most_rounds(self) -> int:
        """Number of rounds of a fit, at most."""

    @abstractmethod
    def fit(
        self, belief: Belief, rng: np.random.Generator, begin: Callable[[], None]
    ) -> tuple[Array, Array]:
        """Return the most likely numbers, and the covariance of them, (2) of `fit`.

        Args:
            belief: without this motion.
            rng: source of randomness.
            begin: called before each round, and before the replays for the covariance.

        Raises:
            LogError: every replay of a robot that stands falls.
        """

    def alike(self, vector: Array) -> float:
        """Return the largest likeness of a joint's residuals, see `spread`.

        Args:
            vector: numbers of a replay, in believed deviations.
        """
        (table,) = self._missed_with([vector])
        return self._likeness(table)

    def missed(self, robot: Robot, lean: Array) -> Array:
        """Return what a replay misses, (N, 2 n + 6); NaN where nothing was measured."""
        table = self._table(replay(robot, self._log.motion, lean))
        return np.where(self._present, table, np.nan)

    def _climbed(
        self, search: JointSearch, rounds: Rounds, generations: int, crowd: int
    ) -> Array:
        """Return the numbers that generations find from where a search has led."""
        bounds = np.stack([self._parameters.least, self._parameters.most], axis=1)
        climb = JointClimb(search, bounds, crowd, int(rounds.rng.integers(2**31)))
        for _ in range(generations):
            tried = climb.ask()
            came = rounds.run(partial(self._generation, climb.found, tried), Generation)
            if came.alike < NOISE:
                break
            climb.tell(tried, came.missed)
        return climb.found

    def _generation(self, found: Array, tried: Array) -> Generation:
        """Do one generation of a climb."""
        before, *tables = self._missed_with([found, *tried])
        return Generation(self._weighed(np.array(tables)), self._likeness(before))

    def _weighed(self, tables: Array) -> Array:
        """Return squared residuals over the variance of the least of each sensor."""
        missed = np.sum(tables**2, axis=1)
        least = tables[np.argmin(missed, axis=0), :, np.arange(missed.shape[1])].T
        return np.asarray(missed * self._weights(least) ** 2)

    def _likeness(self, table: Array) -> float:
        """Return the largest likeness of a joint's residuals; of noise it is 1."""
        _, alike = spread(table, self._present)
        return float(np.max(alike[: self._joints]))

    def _weights(self, table: Array) -> Array:
        """Return 1 / s of each sensor."""
        return weights_of(table, self._present) / self.rough

    def _missed_with(self, vectors: Sequence[Array] | Array) -> Array:
        """Return what replays with these numbers miss, (M, N, 2 n + 6)."""
        return self._tables(self._replays(vectors))

    def _replays(self, vectors: Sequence[Array] | Array) -> list[Measured]:
        read = [self._parameters.read(vector) for vector in vectors]
        jobs = [
            (n, replay, self._robot.as_identified(found), self._log.motion, lean)
            for n, (found, lean) in enumerate(read)
        ]
        came = dict(arrivals(jobs, self._workers))
        return [came[n] for n in range(len(jobs))]

    def _tables(self, replays: Sequence[Measured]) -> Array:
        """Return what each replay misses, (M, N, 2 n + 6)."""
        return np.array(list(map(self._table, replays)))

    def _table(self, seen: Measured) -> Array:
        """Return measured less replayed; nothing where a sensor is missing."""
        shown = columns(seen, len(self._measured))
        # The gyro's mean is that of the same rows.
        replayed = unbiased(np.where(self._present, shown, np.nan))
        missed = np.where(np.isnan(shown), _FALLEN, self._measured - replayed)
        return np.where(self._present, missed, 0.0)

    def _clipped(self, vectors: Array) -> Array:
        return np.clip(vectors, self._parameters.least, self._parameters.most)
