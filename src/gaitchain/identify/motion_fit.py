"""The fit of one motion of a log by rounds of replays, equations of `fit`. Ours."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.jobs import arrivals
from gaitchain.errors import LogError
from gaitchain.identify.certainty import ALIKE, fisher_information, posterior_covariance
from gaitchain.identify.chord import GaussianPrior, follow, slopes
from gaitchain.identify.joint_climb import JointClimb
from gaitchain.identify.joint_search import Group, JointSearch, Searched
from gaitchain.identify.log import Measured, MotionLog
from gaitchain.identify.parameters import OF_JOINTS, OF_SERVOS, Parameters
from gaitchain.identify.rounds import Rounds
from gaitchain.identify.sensor_rows import (
    BLOCK,
    IMU,
    columns,
    spread,
    unbiased,
    weights_of,
)
from gaitchain.identify.simulated import replay
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot


class Round(NamedTuple):
    """Replays around the numbers found so far, and how far around."""

    spread: float
    """Parts of the deviations that are believed."""
    own: float = 0.0
    """Of those by which a joint differs from others that are alike."""


SEARCHES = 2
"""Rounds of the search joint by joint, of hung legs."""
CLIMBS, CROWD = 40, 32
"""Generations of the climb from there, at most, and replays in each."""
REPLAYS = 96
"""Number of replays in a round; more than numbers."""
SMOOTH = 3
"""Times that smooth slopes are taken of a robot that stands, at most."""
_ANY = Round(1.0)
ROUGH = {"held": 1.0, "standing": 5.0}
"""Times its residual that a row counts as: where soles touch the floor, slopes differ
from place to place, and a search ends where more than noise is missed."""
SURE = Round(0.3, 1.0)
"""Replays that show how well hung legs tell the numbers that were found."""
SURE_REPLAYS = 96
"""Number of them, in pairs; more of these than of slopes."""
OTHER = 2.0
"""Times its residual that a row counts as, once more, in what smooth slopes tell: they
are those of another robot."""
NOISE = 1.5
"""Likeness of each joint's residuals, see `spread`, with which a climb ends: that of
the true numbers is up to 1.4."""
EXPLAINED = 0.5 * (BLOCK + 1)
"""Most likeness of a joint's residuals, see `spread`, that are noise, mostly."""
_LEAST_SPREAD = 0.03
_ROUGHEN = "backlash_deg", "dry_friction", "stiction"  # what smooth slopes are without
_BY_HUNG_LEGS = "damping", "backlash_deg", "dry_friction", *OF_SERVOS
"""Numbers of which a stand says what the smooth robot does not have, or next to
nothing."""
_SLOPE, _LEAST_SLOPE = 0.3, 0.1  # differences, of deviations; least of these
_STEPS = (1.0, 0.5)  # parts of a Gauss-Newton step that are tried
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


class MotionFit:
    """One motion of a log, and replays of it."""

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
    def most_rounds(self) -> int:
        """Number of rounds of a fit, at most."""
        searched = self.support == "held"
        return (SEARCHES + CLIMBS if searched else SMOOTH) + 1

    def fit(
        self, belief: Belief, rng: np.random.Generator, begin: Callable[[], None]
    ) -> tuple[Array, Array]:
        """Return the most likely numbers, and the covariance (2) of them.

        Args:
            belief: without this motion.
            rng: source of randomness.
            begin: called before each round, and before the replays for the covariance.
        """
        rounds = Rounds(rng, begin)
        if self.support == "held":
            found = self._searched(belief, rounds)
            known = partial(self.certainty_by_pairs, found, belief, rng)
        else:
            found = self._settled(belief, rounds)
            known = partial(self.certainty_by_slopes, found, belief)
        return found, rounds.run(known, Array)

    def _settled(self, belief: Belief, rounds: Rounds) -> Array:
        """Return the numbers of a robot that stands: by smooth slopes."""
        found = belief.mean
        if not all(self._stood(self._replays([found]))):
            # Where it falls there are no slopes: begin near a replay that does not.
            found = self.improve(found, belief, _ANY, rounds.rng)
        least, most = self._parameters.least, self._parameters.most
        precision = np.asarray(np.linalg.inv(belief.covariance))
        prior = GaussianPrior(belief.mean, precision, least, most)
        for _ in range(SMOOTH):
            found = rounds.run(partial(self._followed, found, belief, prior), Array)
            if self.explains(found):
                break
        return found

    def _followed(self, start: Array, belief: Belief, prior: GaussianPrior) -> Array:
        """Return where smooth slopes at the start lead."""
        slope = self._smooth_slopes(start, belief)
        return follow(start, slope, prior, self._missed_with, self._weights)

    def _smooth_slopes(self, at: Array, belief: Belief) -> Array:
        """Return slopes of a robot without play and dry friction."""
        sd, by = np.sqrt(np.diag(belief.covariance)), np.zeros(len(at))
        ((_, numbers),) = self._effects()
        by[numbers] = _SLOPE * np.maximum(sd, _LEAST_SLOPE)[numbers]
        plain = self._parameters.without(at, *_ROUGHEN)
        ahead, behind = (self._clipped(plain + np.diag(way * by)) for way in (1, -1))
        return slopes(ahead, behind, self._missed_standing)

    def _missed_with(self, vectors: Sequence[Array] | Array) -> Array:
        """Return what replays with these numbers miss, (M, N, 2 n + 6)."""
        return self._tables(self._replays(vectors))

    def _missed_standing(self, vectors: Array) -> Array:
        """Return the same; NaN of replays that fell."""
        replays = self._replays(vectors)
        tables = self._tables(replays)
        tables[~self._stood(replays)] = np.nan
        return tables

    def explains(self, vector: Array) -> bool:
        """Return whether a replay with these numbers misses joints by noise, mostly.

        Args:
            vector: the numbers, in believed deviations.
        """
        (table,) = self._missed_with([vector])
        return self._likeness(table) < EXPLAINED

    def _likeness(self, table: Array) -> float:
        """Return the largest likeness of a joint's residuals; of noise it is 1."""
        _, alike = spread(table, self._present)
        return float(np.max(alike[: self._joints]))

    def _searched(self, belief: Belief, rounds: Rounds) -> Array:
        """Return the numbers of hung legs: searched joint by joint."""
        search = JointSearch(*belief, self._groups())
        select = partial(self._selected, search, rounds.rng)
        for _ in range(SEARCHES):
            search.go_on(rounds.run(select, Searched))
        return self._climbed(search, rounds)

    def _climbed(self, search: JointSearch, rounds: Rounds) -> Array:
        """Return the numbers that generations from there find."""
        bounds = np.stack([self._parameters.least, self._parameters.most], axis=1)
        climb = JointClimb(search, bounds, CROWD, int(rounds.rng.integers(2**31)))
        for _ in range(CLIMBS):
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

    def _selected(self, search: JointSearch, rng: np.random.Generator) -> Searched:
        """Do one round of a search."""
        tried = self._clipped(search.draw(REPLAYS, rng))
        search.select(tried, self._weighed(self._missed_with(tried)))
        return search.searched

    def _weighed(self, tables: Array) -> Array:
        """Return squared residuals over the variance of the least of each sensor."""
        missed = np.sum(tables**2, axis=1)
        least = tables[np.argmin(missed, axis=0), :, np.arange(missed.shape[1])].T
        return np.asarray(missed * self._weights(least) ** 2)

    def improve(
        self, start: Array, belief: Belief, around: Round, rng: np.random.Generator
    ) -> Array:
        """Return better numbers by one round.

        Args:
            start: numbers found so far.
            belief: without this motion.
            around: the replays around the start.
            rng: source of randomness.
        """
        tried = self._clipped(start + self._around(belief, around, REPLAYS, rng))
        replays = self._replays([start, *tried])
        tables = list(map(self._table, replays))
        weights = self._weights(tables[0])
        precision = np.linalg.inv(belief.covariance)
        whole = np.flatnonzero(self._stood(replays[1:]))
        residual, slope = self._regression(tried - start, tables[1:], whole, weights)
        curve = slope.T @ slope + precision
        back = slope.T @ residual + precision @ (start - belief.mean)
        step = -np.linalg.solve(curve, back)
        ahead = self._clipped(np.array([start + part * step for part in _STEPS]))
        vectors = [*ahead, start, *tried]
        missed = np.array([*map(self._table, self._replays(ahead)), *tables])
        off = np.array(vectors) - belief.mean
        costs = np.sum((weights * missed) ** 2, axis=(1, 2))
        costs += np.einsum("ij,jk,ik->i", off, precision, off)
        best: Array = vectors[int(np.argmin(costs))]
        return best

    def certainty_by_pairs(
        self, found: Array, belief: Belief, rng: np.random.Generator
    ) -> Array:
        """Return the covariance (2) of numbers that were found: by pairs of replays.

        Args:
            found: the numbers.
            belief: without this motion.
            rng: source of randomness.
        """
        tried = self._clipped(found + self._around(belief, SURE, SURE_REPLAYS, rng))
        tables = self._missed_with([found, *tried])
        rows = tables[1:] * self._weights(tables[0])
        moved, apart = _halves(tried), _halves(rows)
        told = np.zeros_like(belief.covariance)
        for sensors, numbers in self._effects():
            seen = apart[:, :, sensors].reshape(len(apart), -1)
            told[np.ix_(numbers, numbers)] += fisher_information(
                moved[:, numbers], seen
            )
        return posterior_covariance(belief.covariance, told)

    def certainty_by_slopes(self, found: Array, belief: Belief) -> Array:
        """Return the covariance (2) of numbers that were found: by smooth slopes.

        Args:
            found: the numbers.
            belief: without this motion.

        Raises:
            LogError: the robot falls with them.
        """
        replays = self._replays([found])
        _check_stood(np.flatnonzero(self._stood(replays)))
        weights = self._weights(self._table(replays[0])) / OTHER
        slope = self._smooth_slopes(found, belief) * weights[:, None]
        slope[..., self._parameters.places(*_BY_HUNG_LEGS)] = 0.0
        flat = slope.reshape(-1, len(found))
        return posterior_covariance(belief.covariance, flat.T @ flat)

    def _stood(self, replays: Sequence[Measured]) -> NDArray[np.bool_]:
        """Return which replays stayed on their feet."""
        return np.array([len(r.joint_position) == len(self._measured) for r in replays])

    def _weights(self, table: Array) -> Array:
        """Return 1 / s of each sensor."""
        return weights_of(table, self._present) / ROUGH[self.support]

    def _around(
        self, belief: Belief, around: Round, number: int, rng: np.random.Generator
    ) -> Array:
        """Draw deviations of all replays of a round, in pairs of opposite ones."""
        sd = np.sqrt(np.diag(belief.covariance))
        together, apart = self._parameters.draw(number // 2, rng)
        half = np.maximum(around.spread * sd, _LEAST_SPREAD) * together
        half += around.own * sd * apart
        return np.concatenate([half, -half])

    def missed(self, robot: Robot, lean: Array) -> Array:
        """Return what a replay misses, (N, 2 n + 6); NaN where nothing was measured."""
        table = self._table(replay(robot, self._log.motion, lean))
        return np.where(self._present, table, np.nan)

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

    def _regression(
        self, moved: Array, tables: list[Array], stood: Columns, weights: Array
    ) -> tuple[Array, Array]:
        """Return residuals at the start and their slopes, over all replays that stood.

        Args:
            moved: (M, P) deviations of the replays' numbers from the start.
            tables: what each missed.
            stood: which of them stayed on their feet.
            weights: 1 / s, (2 n + 6,).

        Raises:
            LogError: none did.
        """
        _check_stood(stood)
        rows = weights * np.array([tables[i] for i in stood])
        residual = np.zeros(rows.shape[1:])
        slope = np.zeros((*residual.shape, moved.shape[1]))
        for sensors, numbers in self._effects():
            design = np.column_stack([np.ones(len(stood)), moved[stood][:, numbers]])
            size = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
            seen = rows[:, :, sensors].reshape(len(stood), -1)
            scaled = np.linalg.lstsq(design / size, seen, rcond=ALIKE)[0]
            level, *steep = scaled / size[:, None]
            residual[:, sensors] = level.reshape(-1, len(sensors))
            for number, own in zip(numbers, steep, strict=True):
                slope[:, sensors, number] = own.reshape(-1, len(sensors))
        return residual.ravel(), slope.reshape(-1, moved.shape[1])

    def _groups(self) -> list[Group]:
        """Return each joint's numbers, those of all servos, and those of the IMU."""
        numbers, joints = self._parameters, np.arange(self._joints)
        common = [i for name in (*OF_SERVOS, "lean") for i in numbers.places(name)]
        imu = self._joints + np.arange(IMU)
        return [
            *(
                Group(np.array(numbers.own(joint)), joints[joint : joint + 1])
                for joint in range(self._joints)
            ),
            Group(np.array(common), joints),
            Group(np.array(numbers.places("tilt")), imu),
        ]

    def _effects(self) -> list[tuple[Columns, Columns]]:
        """Return which numbers have an effect on which sensors."""
        everywhere = self._parameters.all
        leg, joints = self._joints // 2, np.arange(self._joints)
        imu = self._joints + np.arange(IMU)

        def chosen(*names: str, own: int | None = None) -> list[int]:
            return [
                i
                for i, p in enumerate(everywhere)
                if p.name in names and (own is None or (p.index or 0) // leg == own)
            ]

        if self.support == "standing":
            all_but = [i for i, p in enumerate(everywhere) if p.name != "lean"]
            return [(np.concatenate([joints, imu]), np.array(all_but))]
        servos, lean = chosen(*OF_SERVOS), chosen("lean")
        legs = [
            (joints // leg == own, [*chosen(*OF_JOINTS, own=own), *servos, *lean])
            for own in range(2)
        ]
        return [
            *((np.flatnonzero(of), np.array(numbers)) for of, numbers in legs),
            (imu, np.array([*chosen("tilt"), *lean])),
        ]


def _check_stood(stood: Columns) -> None:
    """Refuse replays of which none stayed on its feet.

    Raises:
        LogError: it is so.
    """
    if not stood.size:
        raise LogError(
            "every replay of the log falls, as if it were that of another robot; "
            "check the masses and the servos of the file"
        )


def _halves(rows: Array) -> Array:
    """Return half of what the first half of all rows differs by from the second."""
    first, second = np.split(rows, 2)
    return np.asarray(0.5 * (first - second))
