"""What a log tells of a robot: the simulator's replay fitted to it. Ours.

With y the measured rows and f(p) those of a replay of the same targets, the most likely
deviations p from what was believed are

    min_p  sum_i ((y_i - f_i(p)) / s_i)^2 + (p - m)^T B^-1 (p - m)                 (1)

with what is believed, mean m and covariance B, and s_i the size of a sensor's residual;
residuals that are alike from row to row count as fewer rows. Play and friction make
f(p) rough, so that slopes at a point lead astray. Of hung legs p is searched without
any (`joint_search`); then, as in iterated ensemble smoothers [Chada21], J is the
regression of replays with many deviations at once, whose spread is reduced from round
to round. The covariance of p is then, by Laplace's approximation,

    C = (J^T J + B^-1)^-1,   J = d f / d p / s                                     (2)

The motions of a log are taken in turn: what one tells is believed for the next. While
the trunk is held, legs do not know of each other.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate, count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.build.jobs import arrivals, run_once
from gaitchain.build.progress import Progress
from gaitchain.errors import LogError
from gaitchain.identify.joint_search import Group, JointSearch
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog
from gaitchain.identify.parameters import (
    OF_IMU,
    OF_JOINTS,
    OF_SERVOS,
    OF_STAND,
    Parameter,
    Parameters,
)
from gaitchain.identify.refusals import (
    check_content,
    check_explained,
    check_names,
    check_units,
    encoder_noise,
)
from gaitchain.identify.simulated import replay
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.identified import UNSURE, Identified
from gaitchain.robot.robot import Robot


class Round(NamedTuple):
    """Replays around the numbers found so far, and how far around."""

    spread: float
    """Parts of the deviations that are believed."""
    own: float = 0.0
    """Of those by which a joint differs from others that are alike."""


# A robot that stands shows what a few numbers do together; one that swings its legs,
# what each does: there each joint's own numbers are searched first. Where that does not
# explain the log, play, damping and friction are fitted as those of all joints: what
# each has of its own is tried near the rest of the numbers.
_SEARCHES = {"held": 12, "standing": 0}
_NEAR = (Round(0.1, 0.4), Round(0.05, 0.2))  # after a search that explains the log
_ROUNDS = {
    "held": (
        *(Round(spread) for spread in (0.8, 0.5, 0.3, 0.2, 0.1, 0.05)),
        *(Round(0.1, own) for own in (1.0, 0.6, 0.4)),
    ),
    "standing": tuple(map(Round, (1.0, 0.8, 0.6, 0.4, 0.3, 0.2, 0.3, 0.15, 0.1))),
}
_REPLAYS = 96  # in a round; more than numbers
_LEAST_SPREAD = 0.03
_ALIKE = 0.01  # numbers that differ by less in a round's replays share their slope
_STEPS = (1.0, 0.5)  # parts of a Gauss-Newton step that are tried
_LEAST_SD = (2e-4, 2e-3, 0.03)  # of joints, gyro and accelerometer
_TOLD = 0.6  # of the believed deviation: what a number's may be that the log tells
_BLOCK = 25  # rows whose mean shows how alike residuals are
_EXPLAINED = 0.5 * (_BLOCK + 1)  # more of a joint's residual is noise than is not
_FALLEN = 1.0  # residual of a row that the replay did not reach; no joint's else [rad]
_DIGITS = 6  # of the factor of what is left unknown [rad, m]
_IMU = 6  # columns of gyro and accelerometer
_BANK, _SEARCH_BANK = 0x1D, 0x1D5  # of seeds
_STAGE = "fitting replays to the log"

Columns = NDArray[np.int64]


class Found(NamedTuple):
    """One number of a robot, in the unit of its parameter."""

    parameter: Parameter
    value: float
    sd: float
    told: bool
    """Whether the log says more of it than what was believed."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What a log tells, and how well it is replayed."""

    identified: Identified
    numbers: tuple[Found, ...]
    before: tuple[float | None, ...]
    """RMS of what the replay of the file's robot misses: joints [rad], gyro [rad/s],
    accelerometer [m/s^2]; None of a sensor that the logs do not have."""
    after: tuple[float | None, ...]
    """The same with what was identified."""
    missed: tuple[tuple[str, Array, Array], ...]
    """Of each motion what it needs, and (N, 2 n + 6) measured less replayed, before and
    after; NaN where nothing was measured."""

    @property
    def present(self) -> tuple[float, ...]:
        """Part of the rows that have joints, gyro and accelerometer."""
        kinds = _kinds([after for _, _, after in self.missed])
        return tuple(float(np.isfinite(kind).mean()) for kind in kinds)


class _Belief(NamedTuple):
    """Mean and covariance of all numbers, in believed deviations."""

    mean: Array
    covariance: Array


def fit_logs(
    robot: Robot, logs: Sequence[ExerciseLog], workers: int, progress: Progress
) -> Fit:
    """Fit a robot to its logs.

    A journal, see `keeping`, has what each motion told as soon as it did.

    Args:
        robot: as in its file.
        logs: of exercises.
        workers: number of processes; the result does not depend on it.
        progress: called with what is done, how far it is, and of how much.

    Raises:
        LogError: a log is of another robot, or of another control period, or has gaps,
            other joints or units, or joints that were not measured or did not move; no
            replay stays on its feet, or none comes nearer to the log than that of the
            file's robot.
    """
    parts = checked_parts(robot, logs)
    robot = robot.nominal
    parameters = Parameters(robot.legs.joint_names)
    motions = [_Motion(robot, part, parameters, workers) for part in parts]
    belief, leans = _fit_motions(motions, parameters, progress)
    belief = _as_seen(parameters, belief, parts)
    missed = _missed_of(robot, motions, leans, parameters.read(belief.mean)[0])
    return _accepted(_fit_of(parameters, belief, missed), parts)


def _fit_motions(
    motions: Sequence["_Motion"], parameters: Parameters, progress: Progress
) -> tuple[_Belief, list[Array]]:
    """Return what all motions tell together, and how the trunk leaned in each."""
    size, ends = len(parameters.all), [*accumulate(map(_rounds, motions), initial=0)]
    belief, leans = _Belief(np.zeros(size), parameters.correlation()), list[Array]()
    for number, motion in enumerate(motions):
        if number and motion.support == "held":
            # The trunk is held once more.
            belief = _Belief(*parameters.anew(["lean"], *belief))
        rng = np.random.default_rng((_BANK, number))
        begin = _counted(progress, ends[number], ends[-1])
        work = partial(motion.fit, belief, rng, begin)
        found, covariance = run_once("fit", work, tuple[Array, Array])
        known = _believed(covariance, belief.covariance, parameters)
        belief = _Belief(found, known)
        leans.append(parameters.read(found)[1])
    progress(_STAGE, ends[-1], ends[-1])
    return belief, leans


def checked_parts(robot: Robot, logs: Sequence[ExerciseLog]) -> list[MotionLog]:
    """Return the motions of all logs, which can be fitted.

    Args:
        robot: as in its file.
        logs: of exercises.

    Raises:
        LogError: one cannot be fitted to this robot.
    """
    for log in logs:
        _check(robot, log)
    parts = [part for log in logs for part in log.parts]
    check_units(robot.legs, parts)
    check_content(robot.legs.joint_names, parts)
    return parts


def _as_seen(
    parameters: Parameters, belief: _Belief, parts: Sequence[MotionLog]
) -> _Belief:
    """Return numbers that nothing in the logs shows as they were believed before.

    Nothing speaks against whatever was drawn of them in the best replay of the rest.
    """
    felt = [(p.measured.angular_velocity, p.measured.acceleration) for p in parts]
    unseen: tuple[str, ...] = ()
    if not any(np.isfinite(rows).any() for both in felt for rows in both):
        unseen += OF_IMU
    if all(part.motion.support == "held" for part in parts):
        unseen += OF_STAND
    return _Belief(*parameters.anew(unseen, *belief))


def _accepted(fit: Fit, parts: Sequence[MotionLog]) -> Fit:
    """Return a fit that says something of the robot."""
    (before, *_), (after, *_) = fit.before, fit.after
    assert before is not None and after is not None  # `check_content` has seen joints
    told = any(n.told for n in fit.numbers if n.parameter.name in OF_JOINTS)
    check_explained(before, after, encoder_noise(parts), told=told)
    return fit


def _rounds(motion: "_Motion") -> int:
    return _SEARCHES[motion.support] + len(_ROUNDS[motion.support])  # at most


def _counted(progress: Progress, first: int, rounds: int) -> Callable[[], None]:
    """Return what tells of each round of a motion that begins."""
    done = count(first)
    return lambda: progress(_STAGE, next(done), rounds)


def _believed(covariance: Array, before: Array, parameters: Parameters) -> Array:
    """Return the covariance of a fit, rough as replays are; never more than before.

    That joints are alike is believed of what comes next, too: roughness hides it.
    """
    sd = np.sqrt(np.diag(covariance))
    most = np.minimum(parameters.rough, np.sqrt(np.diag(before)) / sd)
    grown = np.maximum(most, 1.0)
    rough = np.linalg.inv(covariance * np.outer(grown, grown))
    return np.asarray(np.linalg.inv(rough + parameters.likeness()))


def _check(robot: Robot, log: ExerciseLog) -> None:
    nominal, period_s = robot.nominal, log.period_s
    if log.fingerprint != nominal.fingerprint:
        raise LogError(
            f"the log is of {log.robot} ({log.fingerprint}), the library of "
            f"{nominal.name} ({nominal.fingerprint}); give a log of that robot"
        )
    check_names(nominal, log.joint_names)
    if abs(period_s - CONTROL_PERIOD_S) > 1e-9:
        raise LogError(
            f"the log has a row every {1e3 * period_s:g} ms, a replay needs one "
            f"every {1e3 * CONTROL_PERIOD_S:g} ms"
        )
    if log.uneven:
        raise LogError(log.uneven)


def _missed_of(
    robot: Robot,
    motions: Sequence["_Motion"],
    leans: Sequence[Array],
    found: Identified,
) -> tuple[tuple[str, Array, Array], ...]:
    """Return `Fit.missed`; of the file's robot, a trunk that is held is level."""
    plain = Identified.of_file(len(robot.legs.joint_names))
    before, after = robot.as_identified(plain), robot.as_identified(found)
    return tuple(
        (m.support, m.missed(before, np.zeros(2)), m.missed(after, lean))
        for m, lean in zip(motions, leans, strict=True)
    )


def _fit_of(
    parameters: Parameters,
    belief: _Belief,
    missed: tuple[tuple[str, Array, Array], ...],
) -> Fit:
    values = parameters.values(belief.mean).tolist()
    deviations = np.sqrt(np.diag(belief.covariance)).tolist()
    numbers = tuple(
        Found(p, p.show(value), p.show(p.belief.sd * sd), sd < _TOLD)
        for p, value, sd in zip(parameters.all, values, deviations, strict=True)
    )
    _, before, after = zip(*missed, strict=True)
    found = parameters.read(belief.mean)[0]
    identified = replace(found, unknown=_factor(parameters, belief.covariance))
    return Fit(identified, numbers, _rms(before), _rms(after), missed)


def _factor(parameters: Parameters, covariance: Array) -> Array:
    """Return the factor of what is unknown of a robot, in the numbers' own units."""
    order = [i for name in UNSURE for i in parameters.places(name)]
    sd = np.array([parameters.all[i].belief.sd for i in order])
    own = covariance[np.ix_(order, order)] * np.outer(sd, sd)
    return np.round(np.linalg.cholesky(own), _DIGITS)


def _kinds(tables: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Return the columns of joints, gyro and accelerometer."""
    table = np.concatenate(tables)
    return table[:, :-_IMU], table[:, -_IMU:-3], table[:, -3:]


def _rms(tables: Sequence[Array]) -> tuple[float | None, ...]:
    """Return what replays miss of joints, gyro, accelerometer; None of what is not."""
    there = [kind[np.isfinite(kind)] for kind in _kinds(tables)]
    return tuple(float(np.sqrt(np.mean(k**2))) if k.size else None for k in there)


class _Motion:
    """One motion of a log, and replays of it."""

    def __init__(
        self, robot: Robot, log: MotionLog, parameters: Parameters, workers: int
    ) -> None:
        self._robot, self._log, self._parameters = robot, log, parameters
        self._workers, self._joints = workers, len(robot.legs.joint_names)
        self.support = log.motion.support
        measured = _columns(log.measured, len(log.motion.targets))
        self._present = np.isfinite(measured)
        self._measured = _unbiased(measured)

    def fit(
        self, belief: _Belief, rng: np.random.Generator, begin: Callable[[], None]
    ) -> tuple[Array, Array]:
        """Return the most likely numbers, and the covariance (2) of them.

        Args:
            belief: without this motion.
            rng: source of randomness.
            begin: called before each round.
        """
        found, rounds = belief.mean, _ROUNDS[self.support]
        if _SEARCHES[self.support]:
            searched = self._search(belief, begin)
            if self._explains(searched):
                found, rounds = searched, _NEAR
        covariance = belief.covariance
        for around in rounds:
            begin()
            found, covariance = self.improve(found, belief, around, rng)
        return found, covariance

    def _search(self, belief: _Belief, begin: Callable[[], None]) -> Array:
        """Return the numbers that a search joint by joint finds."""
        rng = np.random.default_rng(_SEARCH_BANK)
        search = JointSearch(*belief, self._groups())
        for _ in range(_SEARCHES[self.support]):
            begin()
            self._select(search, rng)
        return self._clipped(search.found)

    def _explains(self, vector: Array) -> bool:
        """Return whether a replay with these numbers misses joints by noise, mostly."""
        table = self._table(self._replays([vector])[0])
        _, alike = _spread(table, self._present)
        return bool(np.all(alike[: self._joints] < _EXPLAINED))

    def _select(self, search: JointSearch, rng: np.random.Generator) -> None:
        """Do one round of a search."""
        tried = self._clipped(search.draw(_REPLAYS, rng))
        tables = np.array(list(map(self._table, self._replays(tried))))
        missed = np.sum(tables**2, axis=1)
        least = tables[np.argmin(missed, axis=0), :, np.arange(missed.shape[1])].T
        search.select(tried, missed * _weights(least, self._present) ** 2)

    def improve(
        self, start: Array, belief: _Belief, around: Round, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """Return better numbers by one round, and the covariance (2) of them.

        Args:
            start: numbers found so far.
            belief: without this motion.
            around: the replays around the start.
            rng: source of randomness.
        """
        tried = self._clipped(start + self._around(belief, around, rng))
        replays = self._replays([start, *tried])
        stood = np.array([len(seen.joint_position) for seen in replays[1:]])
        tables = list(map(self._table, replays))
        weights = _weights(tables[0], self._present)
        known = np.linalg.inv(belief.covariance)
        whole = np.flatnonzero(stood == len(self._measured))
        residual, slope = self._regression(tried - start, tables[1:], whole, weights)
        curve = slope.T @ slope + known
        back = slope.T @ residual + known @ (start - belief.mean)
        step = -np.linalg.solve(curve, back)
        ahead = self._clipped(np.array([start + part * step for part in _STEPS]))
        vectors = [*ahead, start, *tried]
        missed = np.array([*map(self._table, self._replays(ahead)), *tables])
        off = np.array(vectors) - belief.mean
        costs = np.sum((weights * missed) ** 2, axis=(1, 2))
        costs += np.einsum("ij,jk,ik->i", off, known, off)
        return vectors[int(np.argmin(costs))], np.linalg.inv(curve)

    def _around(
        self, belief: _Belief, around: Round, rng: np.random.Generator
    ) -> Array:
        """Draw deviations of all replays of a round, in pairs of opposite ones."""
        sd = np.sqrt(np.diag(belief.covariance))
        together, apart = self._parameters.draw(_REPLAYS // 2, rng)
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

    def _table(self, seen: Measured) -> Array:
        """Return measured less replayed; nothing where a sensor is missing."""
        shown = _columns(seen, len(self._measured))
        # The gyro's mean is that of the same rows.
        replayed = _unbiased(np.where(self._present, shown, np.nan))
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
        """
        if not stood.size:
            raise LogError(
                "every replay of the log falls, as if it were that of another robot; "
                "check the masses and the servos of the file"
            )
        rows = weights * np.array([tables[i] for i in stood])
        residual = np.zeros(rows.shape[1:])
        slope = np.zeros((*residual.shape, moved.shape[1]))
        for sensors, numbers in self._effects():
            design = np.column_stack([np.ones(len(stood)), moved[stood][:, numbers]])
            size = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
            seen = rows[:, :, sensors].reshape(len(stood), -1)
            scaled = np.linalg.lstsq(design / size, seen, rcond=_ALIKE)[0]
            level, *slopes = scaled / size[:, None]
            residual[:, sensors] = level.reshape(-1, len(sensors))
            for number, own in zip(numbers, slopes, strict=True):
                slope[:, sensors, number] = own.reshape(-1, len(sensors))
        return residual.ravel(), slope.reshape(-1, moved.shape[1])

    def _groups(self) -> list[Group]:
        """Return each joint's numbers, those of all servos, and those of the IMU."""
        numbers, joints = self._parameters, np.arange(self._joints)
        common = [i for name in (*OF_SERVOS, "lean") for i in numbers.places(name)]
        imu = self._joints + np.arange(_IMU)
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
        imu = self._joints + np.arange(_IMU)

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


def _columns(seen: Measured, rows: int) -> Array:
    """Return the rows of all sensors, (N, 2 n + 6); NaN after a fall."""
    shown = np.hstack([seen.joint_position, seen.angular_velocity, seen.acceleration])
    table = np.full((rows, shown.shape[1]), np.nan)
    table[: len(shown)] = shown
    return table


def _unbiased(table: Array) -> Array:
    """Return the rows without the gyro's mean, as it has a bias; NaN stays NaN."""
    table, gyro = table.copy(), slice(-_IMU, -3)
    there = np.isfinite(table[:, gyro])
    total = np.where(there, table[:, gyro], 0.0).sum(axis=0)
    table[:, gyro] -= total / np.maximum(there.sum(axis=0), 1)
    return table


def _weights(table: Array, present: NDArray[np.bool_]) -> Array:
    """Return 1 / s of each sensor by its residuals, as if all rows were independent.

    Args:
        table: (N, 2 n + 6) residuals, 0 where nothing was measured.
        present: (N, 2 n + 6) where something was.
    """
    sd, alike = _spread(table, present)
    return np.asarray(1.0 / (sd * np.sqrt(alike)))


def _spread(table: Array, present: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the size of each sensor's residuals, and how alike they are.

    Of white noise the latter is 1; of what changes slowly, the rows of a block.
    """
    joints = table.shape[1] - _IMU
    least = np.repeat(_LEAST_SD, [joints, 3, 3])
    square = np.sum(table**2, axis=0) / np.maximum(present.sum(axis=0), 1)
    sd = np.maximum(np.sqrt(square), least)
    whole = len(table) // _BLOCK * _BLOCK
    sums = table[:whole].reshape(-1, _BLOCK, table.shape[1]).sum(axis=1)
    rows = np.maximum(present[:whole].sum(axis=0), 1)
    return sd, np.maximum(np.sum(sums**2, axis=0) / rows / sd**2, 1.0)
