"""Metrics of a recorded walk: speeds, ZMP margin, joint maxima, the fall."""

import math
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from gaitchain.analysis import base_motion
from gaitchain.analysis.fall_cause import explain, when_fell
from gaitchain.analysis.record import WalkRecord
from gaitchain.gait.schedule import Schedule, counts_steps
from gaitchain.gait.zmp import FEET_ON_GROUND, margin, planned_region
from gaitchain.messages import Array, Command
from gaitchain.robot.robot import Robot

RUN_IN_S = 2.0
"""Beginning of a timed schedule, left out of the mean speed and its error [s]."""
_SINGLE = [name for name, feet in FEET_ON_GROUND.items() if len(feet) == 1]


@dataclass(frozen=True)
class SegmentResult:
    """Commanded and achieved speed of one schedule segment."""

    commanded_mps: float
    """Magnitude of the commanded velocity."""
    achieved_mps: float
    """Mean speed in the commanded direction; NaN after a fall."""
    duration_s: float
    command: Command
    achieved: Command
    """Mean speeds in the heading of the robot; NaN after a fall."""


@dataclass(frozen=True)
class WalkSummary:
    """The metrics of one walk."""

    fell: bool
    cause: str | None
    """Description of the fall, see `fall_cause`; None without one."""
    segments: tuple[SegmentResult, ...]
    distance_m: float
    """Displacement of the base along the world's x axis."""
    zmp_inside_support: float
    """Fraction of time with the measured ZMP inside the planned support region."""
    max_joint_speed_deg_s: float
    max_joint_angle_deg: float
    max_torque_nm: float
    speed_error_mps: float
    """Mean absolute speed error of the segments, weighted by duration.

    In a timed schedule it is in the commanded direction, without the first two seconds.
    """
    speed_mps: float
    """Mean speed of the base in the commanded direction, in the heading of the robot.
    Turning in place is left out, and the first two seconds of a timed schedule, in
    which the robot accelerates. NaN if nothing is left."""
    yaw_drift_deg: float
    """Turn to the left beyond the commanded one, at the end [deg]."""
    lateral_drift_m: float
    """Distance to the left beyond the commanded one, in the robot's heading [m]."""
    stop_s: float
    """Time until both feet stand still, see `base_motion.stop_time` [s]."""
    zmp_rms_m: float
    """Root mean square distance of the measured from the planned ZMP in single support
    [m]; NaN if no ZMP is planned."""

    def to_json(self) -> dict[str, Any]:
        """Return plain values; NaN becomes None."""
        plain: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return plain


def summarise(robot: Robot, record: WalkRecord, schedule: Schedule) -> WalkSummary:
    """Compute the metrics of a recorded walk.

    Args:
        robot: the robot.
        record: the walk.
        schedule: the commands.

    Returns:
        The metrics.
    """
    motion = base_motion.own_motion(record.qpos)
    parts = base_motion.stretches(record.step_ticks, schedule, _first_row(record))
    in_steps = counts_steps(schedule)
    # A schedule in steps is straight, so its speeds are measured in the world, up to
    # the final rest.
    way = base_motion.world_motion(record) if in_steps else motion
    segments = _segments(way, parts, to_rest=in_steps)
    speed, error = base_motion.pace(motion, parts, 0.0 if in_steps else RUN_IN_S)
    if in_steps:
        errors = [abs(s.achieved_mps - s.commanded_mps) for s in segments]
        error = base_motion.known_mean(errors, [s.duration_s for s in segments])
    x = record.qpos[:, 0]
    return WalkSummary(
        fell=record.fell_at_s is not None,
        cause=fall_cause(record),
        segments=segments,
        distance_m=float(x[-1] - x[0]),
        zmp_inside_support=float(np.mean(zmp_margins(robot, record) >= 0.0)),
        max_joint_speed_deg_s=float(np.degrees(np.abs(record.joint_velocity).max())),
        max_joint_angle_deg=float(np.degrees(np.abs(record.joint_position).max())),
        max_torque_nm=float(np.abs(record.torque).max()),
        speed_error_mps=error,
        speed_mps=speed,
        yaw_drift_deg=math.degrees(base_motion.drift(motion, parts, 2)),
        lateral_drift_m=base_motion.drift(motion, parts, 1),
        stop_s=base_motion.stop_time(record, parts),
        zmp_rms_m=_zmp_rms(record),
    )


def percent(share: float) -> str:
    """Return a part of a whole in percent, of which 100 is said only of all.

    Args:
        share: 0 to 1; rounded down to a tenth of a percent.
    """
    tenths = math.floor(1000.0 * share + 1e-9)
    return f"{0.1 * tenths:.1f} %" if tenths % 10 else f"{tenths // 10} %"


def _first_row(record: WalkRecord) -> int:
    """Return the row of time 0, beyond the end where a robot fell as it settled."""
    return int(np.searchsorted(record.time_s, -1e-9))


def fall_cause(record: WalkRecord) -> str | None:
    """Describe a fall: direction, time, the rule that broke first, what to change.

    Returns:
        One line; None if the robot did not fall. A record without its robot gives only
        direction and time.
    """
    if record.fell_at_s is None:
        return None
    place = _place(record, record.fell_at_s)
    if record.robot is None:
        return place
    explanation = explain(record.robot, record)
    cause = explanation.cause
    if cause is None:
        return f"{place}: no rule broke before"
    return (
        f"{place}: {cause.what} {cause.how_much}{explanation.after}, "
        f"{record.fell_at_s - cause.time_s:.2f} s before; "
        f"try {cause.advice}"
    )


def _place(record: WalkRecord, fell_at_s: float) -> str:
    """Describe the direction, the time and the phase of the step of a fall."""
    w, x, y, z = record.qpos[-1, 3:7]
    # The horizontal part of the trunk's upward axis is the direction of the fall.
    ahead, left = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x)
    heading = 2.0 * math.atan2(z, w)  # yaw, independent of the tilt
    angle = math.degrees(math.atan2(left, ahead) - heading)
    sides = ("forward", "to the left", "backward", "to the right")
    side = sides[round(angle / 90.0) % 4]
    row = len(record.time_s) - 1
    step = int(np.searchsorted(record.step_ticks[:-1], row, "right"))
    layer = int(record.key_pose[-1, 0])
    fell = f"fell {side} {when_fell(fell_at_s)}"
    if fell_at_s <= 0.0:
        return fell
    if not layer:
        return f"{fell}, standing after step {step}"
    return (
        f"{fell}, in step {step} moving to kp_{layer + 1}, planned support "
        f"{record.support[-1]}"
    )


def zmp_margins(robot: Robot, record: WalkRecord) -> Array:
    """Compute the margin of the measured ZMP in the planned support region.

    The region is that of the feet that are planned to be on the ground (rs, rl, ls, lr,
    Sec. VI-B), at their measured positions.

    Returns:
        (N,) margin [m]; -inf in rows without ground contact.
    """
    result = np.full(len(record.time_s), -np.inf)
    for i, (point, feet) in enumerate(zip(record.zmp, record.feet, strict=True)):
        if not np.isnan(point[0]):
            result[i] = margin(point, support_region(robot, record, i, feet))
    return result


def support_region(
    robot: Robot, record: WalkRecord, row: int, feet: Array | None = None
) -> Array:
    """Return the planned support region at the measured feet, (K, 2) [m]."""
    where = record.feet[row] if feet is None else feet
    return planned_region(robot, where, str(record.support[row]))


def _segments(
    motion: Array, parts: tuple[base_motion.Stretch, ...], *, to_rest: bool
) -> tuple[SegmentResult, ...]:
    """Compute the result of each segment; `to_rest` extends the last to the end."""
    results = []
    for part in parts:
        whole = to_rest and part is parts[-1] and part.end < len(motion)
        did = base_motion.achieved(motion, part, len(motion) - 1 if whole else part.end)
        real = did.vx if to_rest else base_motion.along(part.command, did)
        duration_s = part.duration_s
        results.append(SegmentResult(part.speed, real, duration_s, part.command, did))
    return tuple(results)


def _zmp_rms(record: WalkRecord) -> float:
    rows = np.flatnonzero(np.isin(record.support, _SINGLE))
    off = np.linalg.norm(record.zmp[rows] - record.planned_zmp[rows], axis=1)
    known = ~np.isnan(off)
    return float(np.sqrt(np.mean(off[known] ** 2))) if known.any() else math.nan
