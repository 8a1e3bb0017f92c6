"""What a log tells of a robot: the simulator's replay fitted to it. Ours.

With y the measured rows and f(p) those of a replay of the same targets, the most likely
deviations p from what was believed are

    min_p  sum_i ((y_i - f_i(p)) / s_i)^2 + (p - m)^T B^-1 (p - m)                 (1)

with what is believed, mean m and covariance B, and s_i the size of a sensor's residual;
residuals that are alike from row to row count as fewer rows. Play and friction make
f(p) rough, so that slopes at a point lead astray. Of hung legs p is searched without
any (`hung_fit`). Of a stand J is that of the robot without play and dry friction
(`chord`); where it would fall, J is first, as in ensemble smoothers [Chada21], the
regression of replays with many deviations at once; where more than noise is left, p is
climbed from there (`stand_fit`). The covariance of p is then, by Laplace's
approximation,

    C = (J^T J + B^-1)^-1,   J = d f / d p / s                                     (2)

with J^T J of hung legs as `certainty` has it, and of a stand by smooth slopes at p. The
motions of a log are taken in turn: what one tells is believed for the next. While the
trunk is held, legs do not know of each other, and what they tell of zeros is not kept:
offsets and the trunk's attitude tell the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, count
from typing import NamedTuple

import numpy as np

from gaitchain.build.progress import Progress
from gaitchain.errors import LogError
from gaitchain.identify.hung_fit import HungFit
from gaitchain.identify.log import ExerciseLog, MotionLog
from gaitchain.identify.motion_fit import Belief, MotionFit
from gaitchain.identify.parameters import (
    OF_IMU,
    OF_JOINTS,
    OF_STAND,
    OF_ZEROS,
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
from gaitchain.identify.sensor_rows import rms, sensor_kinds
from gaitchain.identify.stand_fit import StandFit
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.identified import UNSURE, Identified
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot

_TOLD = 0.6  # of the believed deviation: what a number's may be that the log tells
_DIGITS = 6  # of the factor of what is left unknown [rad, m]
_BANK = 0x1D  # of seeds
_STAGE = "fitting replays to the log"


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
        kinds = sensor_kinds([after for _, _, after in self.missed])
        return tuple(float(np.isfinite(kind).mean()) for kind in kinds)


def fit_logs(
    robot: Robot, logs: Sequence[ExerciseLog], workers: int, progress: Progress
) -> Fit:
    """Fit a robot to its logs.

    A journal, see `keeping`, has what each round found as soon as it did.

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
    motions = [motion_fit(robot, part, parameters, workers) for part in parts]
    belief, leans = _fit_motions(motions, parameters, progress)
    unseen = [*_unfelt(parameters, parts), *_idle(parameters, robot.legs)]
    belief = Belief(*parameters.anew(unseen, *belief))
    missed = _missed_of(robot, motions, leans, parameters.read(belief.mean)[0])
    fit = _accepted(_fit_of(parameters, belief, missed), parts)
    identified = replace(fit.identified, turnaround_s=_turnaround_s(logs))
    return replace(fit, identified=identified)


def motion_fit(
    robot: Robot, part: MotionLog, parameters: Parameters, workers: int
) -> MotionFit:
    """Return the fit of one motion of a log, see `MotionFit`."""
    kind = HungFit if part.motion.support == "held" else StandFit
    return kind(robot, part, parameters, workers)


def _turnaround_s(logs: Sequence[ExerciseLog]) -> float | None:
    """Return the median time from a read to its target [s]; None if none is known."""
    known = np.concatenate([log.turnarounds_s for log in logs])
    return float(np.median(known)) if known.size else None


def _fit_motions(
    motions: Sequence[MotionFit], parameters: Parameters, progress: Progress
) -> tuple[Belief, list[Array]]:
    """Return what all motions tell together, and how the trunk leaned in each."""
    size = len(parameters.all)
    ends = [*accumulate((motion.most_rounds for motion in motions), initial=0)]
    belief, leans = Belief(np.zeros(size), parameters.correlation()), list[Array]()
    for number, motion in enumerate(motions):
        if number and motion.support == "held":
            # The trunk is held once more.
            belief = Belief(*parameters.anew(parameters.places("lean"), *belief))
        rng = np.random.default_rng((_BANK, number))
        begin = _counted(progress, ends[number], ends[-1])
        found = Belief(*motion.fit(belief, rng, begin))
        leans.append(parameters.read(found.mean)[1])
        if motion.support == "held":
            found = _but(parameters.places(*OF_ZEROS), belief, found)
        belief = found
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


def _unfelt(parameters: Parameters, parts: Sequence[MotionLog]) -> list[int]:
    """Return the places of numbers that nothing in the logs shows.

    Nothing speaks against whatever was drawn of them in the best replay of the rest.
    """
    felt = [(p.measured.angular_velocity, p.measured.acceleration) for p in parts]
    unseen: tuple[str, ...] = ()
    if not any(np.isfinite(rows).any() for both in felt for rows in both):
        unseen += OF_IMU
    if all(part.motion.support == "held" for part in parts):
        unseen += OF_STAND
    return parameters.places(*unseen)


def _idle(parameters: Parameters, legs: LegModel) -> list[int]:
    """Return the places of numbers that do nothing: damping of servos without any."""
    servos, places = legs.damping - legs.joint_damping, parameters.places("damping")
    return [places[joint] for joint in np.flatnonzero(servos <= 0.0).tolist()]


def _accepted(fit: Fit, parts: Sequence[MotionLog]) -> Fit:
    """Return a fit that says something of the robot."""
    (before, *_), (after, *_) = fit.before, fit.after
    assert before is not None and after is not None  # `check_content` has seen joints
    told = any(n.told for n in fit.numbers if n.parameter.name in OF_JOINTS)
    check_explained(before, after, encoder_noise(parts), told=told)
    return fit


def _counted(progress: Progress, first: int, rounds: int) -> Callable[[], None]:
    """Return what tells of each round of a motion that begins."""
    done = count(first)
    return lambda: progress(_STAGE, next(done), rounds)


def _but(places: Sequence[int], before: Belief, found: Belief) -> Belief:
    """Return what was found, but of some numbers what was believed before."""
    own, mean, covariance = list(places), found.mean.copy(), found.covariance.copy()
    mean[own] = before.mean[own]
    covariance[own] = covariance[:, own] = 0.0
    covariance[np.ix_(own, own)] = before.covariance[np.ix_(own, own)]
    return Belief(mean, covariance)


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
    motions: Sequence[MotionFit],
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
    belief: Belief,
    missed: tuple[tuple[str, Array, Array], ...],
) -> Fit:
    values = parameters.values(belief.mean).tolist()
    deviations = np.sqrt(np.diag(belief.covariance)).tolist()
    numbers = tuple(
        Found(p, p.show(value), p.show(p.prior.sd * sd), sd < _TOLD)
        for p, value, sd in zip(parameters.all, values, deviations, strict=True)
        if p.name != "lean"  # how a log was made, and of no number that is kept
    )
    _, before, after = zip(*missed, strict=True)
    found = parameters.read(belief.mean)[0]
    identified = replace(found, unknown=_factor(parameters, belief.covariance))
    return Fit(identified, numbers, rms(before), rms(after), missed)


def _factor(parameters: Parameters, covariance: Array) -> Array:
    """Return the factor of what is unknown of a robot, in the numbers' own units."""
    order = [i for name in UNSURE for i in parameters.places(name)]
    sd = np.array([parameters.all[i].prior.sd for i in order])
    own = covariance[np.ix_(order, order)] * np.outer(sd, sd)
    return np.round(np.linalg.cholesky(own), _DIGITS)
