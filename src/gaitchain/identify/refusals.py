"""Logs that tell nothing of a robot, and fits that explain none. Ours.

A fit has an answer for any log: from one of servos without power it makes a robot whose
numbers nobody measured. So a log is looked at before, and what it came to after.
"""

import math
from collections.abc import Sequence

import numpy as np

from gaitchain.errors import LogError, short_name
from gaitchain.identify.gyro_check import BEYOND_DEG, TIMES, turns
from gaitchain.identify.log import MotionLog
from gaitchain.identify.parameters import USUAL_PLAY_RAD
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot
from gaitchain.walker.upright import MOST_TILT_DEG, nearest_axis, tilt_deg

_MEASURED = 0.5  # of the rows of a motion, of each joint
_FOLLOWED = 0.25  # of a target's motion: soft, worn servos that stand show half of it
_NAMED = 6  # joints in a message
# RMS that the file's numbers may miss without being improved, in deviations of noise
# and in steps of usual encoders: so little is what no model has.
_NOISES, _STEP_RAD = 5.0, 2.0 * math.pi / 4096
_BEYOND_RAD = 1.0  # of its range: what no joint is asked for or shows
_SELDOM = 0.1  # of the rows, which may be spoilt
_OFF = 0.3  # of gravity: the most of a fair accelerometer
_IMPROVED = 0.9  # of the RMS before: what is left at most of one that is more than that


def check_names(robot: Robot, found: Sequence[str]) -> None:
    """Make sure that a log has the joints of a robot, in their order.

    Args:
        robot: the robot.
        found: (2 n,) the log's.

    Raises:
        LogError: it has others, or one twice, or another order.
    """
    wanted = robot.legs.joint_names
    if len(found) != len(wanted):
        raise LogError(
            f"the log has {len(found)} joints, {robot.name} {len(wanted)} in its legs: "
            f"{', '.join(wanted)}"
        )
    for i, (name, own) in enumerate(zip(found, wanted, strict=True), start=1):
        if name != own:
            raise LogError(
                f"joint {i} of the log is {short_name(name)!r}, of {robot.name} "
                f"it is {own!r}; the order is {', '.join(wanted)}"
            )


def check_units(legs: LegModel, parts: Sequence[MotionLog]) -> None:
    """Make sure that angles and rates are in rad, and accelerometers show gravity.

    Args:
        legs: of the robot.
        parts: the motions of all logs of a fit.

    Raises:
        LogError: they are, or do, not.
    """
    for part in parts:
        _check_angles(legs, part, "asked for", part.motion.targets)
        _check_angles(legs, part, "shown", part.measured.joint_position)
        _check_gravity(part)
        _check_gyro(part)


def check_content(joint_names: Sequence[str], parts: Sequence[MotionLog]) -> None:
    """Make sure that all joints were measured, moved, and followed their targets.

    Args:
        joint_names: (2 n,) leg joints.
        parts: the motions of all logs of a fit.

    Raises:
        LogError: some were not; it names them.
    """
    for part in parts:
        _check_measured(joint_names, part)
    _check_moved(joint_names, parts)
    for part in parts:
        _check_followed(joint_names, part)


def check_explained(
    before_rad: float, after_rad: float, noise_rad: float, *, told: bool
) -> None:
    """Make sure that a fit says something of the robot.

    Args:
        before_rad: RMS of what the replay of the file's robot misses of joints [rad].
        after_rad: the same with what was identified [rad].
        noise_rad: of the encoders, see `encoder_noise` [rad].
        told: whether the log tells any number of a joint.

    Raises:
        LogError: it does not.
    """
    most_rad = _NOISES * max(noise_rad, _STEP_RAD)
    before, after, most = np.degrees([before_rad, after_rad, most_rad])
    if before_rad > most_rad and after_rad > _IMPROVED * before_rad:
        raise LogError(
            f"no robot makes this log: replays miss the joints by {after:.2f} deg "
            f"after the fit, {before:.2f} before it (RMS); above {most:.2f} at most "
            f"{_IMPROVED:.0%} may be left. Look whether the servos had their torque, "
            "and whether the file's masses and directions are right; exercise again"
        )
    if not told:
        raise LogError(
            "the log tells no number of any joint: each is as uncertain as before the "
            "fit, at least one has to be told; give the log of a whole exercise"
        )


def encoder_noise(parts: Sequence[MotionLog]) -> float:
    """Return the deviation of the noise of encoders, of most joints and motions [rad].

    It is what second differences have beyond a slow motion; 0 where no joint was
    measured in three rows running.
    """
    bent = [np.diff(part.measured.joint_position, 2, axis=0) for part in parts]
    columns = [own[np.isfinite(own)] for table in bent for own in table.T]
    rms = [np.sqrt(np.mean(own**2) / 6.0) for own in columns if own.size]
    return float(np.median(rms)) if rms else 0.0


def _check_angles(legs: LegModel, part: MotionLog, what: str, angles: Array) -> None:
    out = np.maximum(angles - legs.upper, legs.lower - angles)
    far = np.nan_to_num(out) > _BEYOND_RAD
    joint = int(np.argmax(far.sum(axis=0)))
    if far[:, joint].mean() > _SELDOM:
        name, low, high = legs.joint_names[joint], legs.lower[joint], legs.upper[joint]
        worst = angles[np.argmax(np.nan_to_num(out[:, joint])), joint]
        raise LogError(
            f"{worst:.4g} rad are {what} of {name} in the motion {_of(part)!r}, its "
            f"range is {low:.3g} to {high:.3g}, and at most {_BEYOND_RAD:g} beyond it "
            "can be; angles are in rad, not in degrees"
        )


def _check_gravity(part: MotionLog) -> None:
    felt = part.measured.acceleration
    felt = felt[np.isfinite(felt).all(axis=1)]
    if not len(felt):
        return
    middle = float(np.median(np.linalg.norm(felt, axis=1)))
    if abs(middle - GRAVITY) > _OFF * GRAVITY:
        low, high = (1.0 - _OFF) * GRAVITY, (1.0 + _OFF) * GRAVITY
        raise LogError(
            f"the accelerometer shows {middle:.3g} m/s^2 in the motion {_of(part)!r}, "
            f"gravity is {GRAVITY:g}, and {low:.3g} to {high:.3g} can be; give its "
            "values in m/s^2, and NaN for an IMU that there is not"
        )
    _check_upright(part, felt.mean(axis=0))


def _check_upright(part: MotionLog, pulling: Array) -> None:
    """Look at an acceleration (3,): a trunk stands, or is held level by hand."""
    tilt = tilt_deg(pulling)
    if tilt > MOST_TILT_DEG:
        raise LogError(
            f"up is near the trunk's {nearest_axis(pulling)}, {tilt:.0f} deg from its "
            f"z, by the accelerometer in the motion {_of(part)!r}, and at most "
            f"{MOST_TILT_DEG:g} can be of a trunk that stands or is held level; "
            "correct imu.axes in the calibration until `gaitchain calibrate --check` "
            "agrees, and exercise again"
        )


def _check_gyro(part: MotionLog) -> None:
    turned = turns(part.measured)
    if turned is not None and not turned.possible:
        raise LogError(
            f"the gyro turns by {turned.gyro_deg:.3g} deg to and fro in the motion "
            f"{_of(part)!r} (RMS about level axes), gravity by "
            f"{turned.gravity_deg:.2g} deg in the accelerometer, and at most "
            f"{TIMES:g} times that and {BEYOND_DEG:g} deg more can be; give its values "
            "in rad/s, not in deg/s"
        )


def _check_measured(joint_names: Sequence[str], part: MotionLog) -> None:
    there = np.isfinite(part.measured.joint_position).mean(axis=0)
    few = _below(_MEASURED, joint_names, there, "{} in {:.0%}")
    if few:
        raise LogError(
            f"joints were measured in too few rows of the motion {_of(part)!r}: "
            f"{_listed(few)}; a fit needs {_MEASURED:.0%}. Look for servos that do not "
            "answer (`gaitchain doctor`), and exercise again"
        )


def _check_moved(joint_names: Sequence[str], parts: Sequence[MotionLog]) -> None:
    spans = np.max([np.ptp(part.motion.targets, axis=0) for part in parts], axis=0)
    least_deg = math.degrees(USUAL_PLAY_RAD)
    still = _below(least_deg, joint_names, np.degrees(spans), "{} by {:.1f} deg")
    if still:
        raise LogError(
            f"joints were hardly asked to move: {_listed(still)}; below "
            f"{least_deg:.1f} deg play may hide what a servo does. "
            "Give the log of a whole exercise; widen limits that leave a joint less"
        )


def _check_followed(joint_names: Sequence[str], part: MotionLog) -> None:
    """Look at joints that move by more than their play, or they may well stay."""
    targets, shown = part.motion.targets, part.measured.joint_position
    spans, shares = np.ptp(targets, axis=0), _followed(targets, shown)
    idle = [
        f"{share:.0%} of {math.degrees(span):.1f} deg of {name}"
        for name, span, share in zip(joint_names, spans, shares, strict=True)
        if span > 2.0 * USUAL_PLAY_RAD and share < _FOLLOWED
    ]
    if idle:
        raise LogError(
            f"joints do not follow their targets in the motion {_of(part)!r}: their "
            f"encoders show {_listed(idle)}; a fit needs {_FOLLOWED:.0%} at least. "
            "Look whether the servos have power and torque, and turn the right way; "
            "exercise again"
        )


def _below(
    least: float, joint_names: Sequence[str], values: Array, form: str
) -> list[str]:
    """Return the joints of a lower value, with it."""
    of_joints = zip(joint_names, values.tolist(), strict=True)
    return [form.format(name, value) for name, value in of_joints if value < least]


def _followed(targets: Array, shown: Array) -> Array:
    """Return the slope of each joint's encoder over its target, (2 n,)."""
    there = np.isfinite(shown)
    asked = np.where(there, targets, np.nan)
    asked -= np.nanmean(asked, axis=0)
    came = shown - np.nanmean(shown, axis=0)
    square = np.maximum(np.nansum(asked**2, axis=0), np.finfo(float).tiny)
    shares = np.nansum(asked * came, axis=0) / square
    return np.asarray(np.round(shares, 2) + 0.0)  # -0.0 is 0.0


def _of(part: MotionLog) -> str:
    return "held up" if part.motion.support == "held" else part.motion.support


def _listed(found: Sequence[str]) -> str:
    rest = len(found) - _NAMED
    more = f" and {rest} more" if rest > 0 else ""
    return ", ".join(found[:_NAMED]) + more
