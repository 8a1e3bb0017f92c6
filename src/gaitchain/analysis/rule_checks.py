"""Checks of the rules: which of them broke in a walk, when, and by how much."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.record import WalkRecord, support_stays
from gaitchain.analysis.rules import (
    ADVICE,
    EDGE_ADVICE,
    SIDES,
    Finding,
    JudgedWalk,
    Mask,
    Measure,
    Rule,
    RuleLimits,
)
from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot

_JointRule = tuple[Rule, Mask, float, Measure, Array]


def broken_rules(robot: Robot, record: WalkRecord, limits: RuleLimits) -> list[Finding]:
    """Find every rule that broke, in order of time.

    Args:
        robot: the robot.
        record: the walk, without rows after its fall.
        limits: limits of the rules.
    """
    walk, order = JudgedWalk(robot, record, limits), list(Rule)
    found = (finding for rule in _RULES for finding in rule(walk))
    return sorted(found, key=lambda f: (f.time_s, order.index(f.rule)))


def tracking_errors(robot: Robot, record: WalkRecord) -> Array:
    """Compute the error of each joint beyond the sag of its servo.

    A servo under load has an error of torque / stiffness, which is subtracted. The
    position in a row is compared with the target of the row before.

    Returns:
        (N, 2 n) errors, 0 or more [rad].
    """
    asked = np.concatenate([record.joint_position[:1], record.target[:-1]])
    sag = np.abs(record.torque) / robot.legs.stiffness
    return np.asarray(np.maximum(np.abs(asked - record.joint_position) - sag, 0.0))


def asked_speeds(record: WalkRecord) -> Array:
    """Return the greater speed of each joint and its target, (N, 2 n) [rad/s]."""
    moved = np.diff(record.target, axis=0, prepend=record.target[:1])
    steps = np.diff(record.time_s, prepend=record.time_s[0] - 1.0)
    rate = np.abs(moved) / steps[:, None]
    return np.maximum(rate, np.abs(record.joint_velocity))


def joint_limits(robot: Robot, record: WalkRecord) -> tuple[Array, Array]:
    """Return the torque [N m] and speed [rad/s] limits of the walk's joints, (2 n,)."""
    full, shape = robot.legs, record.torque.shape[1:]
    torque, speed = record.torque_limit, record.speed_limit
    return (
        np.broadcast_to(full.torque_limit if torque is None else torque, shape),
        np.broadcast_to(full.speed_limit if speed is None else speed, shape),
    )


class NearLimit(NamedTuple):
    """The joint of a walk that came nearest to one of its limits."""

    joint: str
    value: float
    low: float
    high: float


def nearest_angle(robot: Robot, record: WalkRecord) -> NearLimit:
    """Find the joint angle that came nearest to an end of the joint's range [rad].

    It minimises min(q - q_low, q_high - q) / (q_high - q_low) over time and joints, as
    a large angle of a joint with a wide range may be far from its limits.
    """
    full, angle = robot.legs, record.joint_position
    room = np.minimum(angle - full.lower, full.upper - angle)
    row, j = np.unravel_index(np.argmin(room / (full.upper - full.lower)), room.shape)
    ends = float(full.lower[j]), float(full.upper[j])
    return NearLimit(record.joint_names[j], float(angle[row, j]), *ends)


def nearest_speed(robot: Robot, record: WalkRecord) -> NearLimit:
    """Find the joint speed that was the largest part of its limit [rad/s].

    If no joint has a limit, it is the highest speed.
    """
    speed, limit = np.abs(record.joint_velocity), joint_limits(robot, record)[1]
    part = speed / limit if np.isfinite(limit).any() else speed
    row, j = np.unravel_index(np.argmax(part), part.shape)
    most = float(np.broadcast_to(limit, speed.shape)[row, j])
    return NearLimit(record.joint_names[j], float(speed[row, j]), -most, most)


def standing_margins(
    robot: Robot, record: WalkRecord, contact_load: float = RuleLimits.contact_load
) -> Array:
    """Compute the margin of the ZMP in the convex hull of the loaded soles.

    Args:
        robot: the robot.
        record: the walk.
        contact_load: part of the weight above which a sole is loaded.

    Returns:
        (N,) margin [m], negative outside; NaN off the ground.
    """
    on_ground = record.foot_load > contact_load * robot.reduced.mass * GRAVITY
    soles = record.soles.copy()
    for foot in (0, 1):  # a foot in the air is replaced by the loaded one
        alone = on_ground[:, foot] & ~on_ground[:, 1 - foot]
        soles[alone, 1 - foot] = soles[alone, foot]
    corners = soles.reshape(len(soles), 8, 2)
    one, other = np.triu_indices(8, k=1)
    edge = corners[:, other] - corners[:, one]
    length = np.linalg.norm(edge, axis=-1)
    normal = np.stack([-edge[..., 1], edge[..., 0]], -1)
    normal /= np.maximum(length, 1e-12)[..., None]
    # The edges of the hull are among the lines through any two corners. The other lines
    # are moved outward until all corners are on one side; they are no nearer then.
    reach = np.einsum("nkx,nex->nek", corners, normal)
    point = np.einsum("nx,nex->ne", record.zmp, normal)
    inside = np.minimum(reach.max(-1) - point, point - reach.min(-1))
    nearest = np.where(length > 1e-9, inside, np.inf).min(axis=1)
    return np.asarray(np.where(on_ground.any(axis=1), nearest, np.nan))


def _estimator(walk: JudgedWalk) -> Iterator[Finding]:
    limits, record = walk.limits, walk.record
    off: Array = np.abs(record.estimated_tilt - record.tilt).max(axis=1)
    broken = off > limits.estimate_rad  # false where there is no estimate
    measure = Measure(_degrees(off), "deg", math.degrees(limits.estimate_rad))
    return walk.findings(Rule.ESTIMATOR, broken, limits.estimate_hold_s, measure)


def _self_collision(walk: JudgedWalk) -> Iterator[Finding]:
    """Yield contacts between the legs; the amount is their duration."""
    touch = walk.record.self_contact
    measure = Measure(touch.astype(np.float64), "ms", 0.0)
    for finding in walk.findings(Rule.SELF_COLLISION, touch, 0.0, measure):
        long_s = finding.until_s - finding.time_s + walk.period_s
        yield replace(finding, amount=1e3 * long_s)


def _joints(walk: JudgedWalk) -> Iterator[Finding]:
    rules = _joint_rules(walk)
    for joint, name in enumerate(walk.record.joint_names):
        for rule, broken, hold_s, measure, limit in rules:
            values, least = measure.values[:, joint], float(limit[joint])
            asked = None if measure.asked is None else measure.asked[:, joint]
            own = measure._replace(values=values, limit=least, asked=asked)
            yield from walk.findings(rule, broken[:, joint], hold_s, own, joint=name)


def _joint_rules(walk: JudgedWalk) -> tuple[_JointRule, ...]:
    """Return the rules on joints: rule, break mask, hold time, measure and limits."""
    record, limits = walk.record, walk.limits
    torque_limit, speed_limit = joint_limits(walk.robot, record)
    torque, speed = np.abs(record.torque), asked_speeds(record)
    lag = tracking_errors(walk.robot, record)
    # A target may move at the limit, but a joint at the limit cannot follow its target.
    held_back = np.abs(record.joint_velocity) >= limits.saturation * speed_limit
    fast = held_back | (speed > 1.001 * speed_limit)
    heavy = torque >= limits.saturation * torque_limit
    late = lag > limits.tracking_rad
    asked = speed > np.abs(record.joint_velocity)
    fastest = _degrees(speed_limit)
    speeds = Measure(_degrees(speed), "deg/s", 0.0, asked=asked)
    latest = _degrees(np.full(len(fastest), limits.tracking_rad))
    hold_s = limits.saturation_hold_s
    return (
        (Rule.SPEED, fast, hold_s, speeds, fastest),
        (Rule.TORQUE, heavy, hold_s, Measure(torque, "N m", 0.0), torque_limit),
        (
            Rule.TRACKING,
            late,
            limits.tracking_hold_s,
            Measure(_degrees(lag), "deg", 0.0),
            latest,
        ),
    )


def _touch_downs(walk: JudgedWalk) -> Iterator[Finding]:
    before = ""
    for name, begin, end in support_stays(walk.record.support):
        # Of one beside lost rows it is not known when it began, or ended.
        whole = not any(begin <= row <= end for row in walk.gaps)
        if whole and name in {"ls", "rs"}:
            yield from _early(walk, begin, end, 1 if name == "ls" else 0)
        elif whole and before in {"ls", "rs"}:
            yield from _late(walk, begin, end, 1 if before == "ls" else 0)
        before = name


def _early(walk: JudgedWalk, begin: int, end: int, foot: int) -> Iterator[Finding]:
    """Yield the touch-down of a swing foot before its planned time."""
    record, limits, timing = walk.record, walk.limits, walk.record.timing
    planned = end
    if timing is not None and end == len(record.support):  # ended by the fall
        planned = max(end, begin + round((timing.rise + timing.fall) / walk.period_s))
    load = walk.load[begin:end, foot]
    flights = walk.spells(load < limits.contact_load, limits.air * walk.step_s)
    lifted = next((row for row, _ in flights), None)
    if lifted is None:
        return
    down = load > limits.landing_load
    down[:lifted] = False
    for row, stop in walk.spells(down, limits.landing_hold_s):
        ahead_s = (planned - begin - row) * walk.period_s
        if ahead_s > limits.touch_down * walk.step_s:
            yield _landing(walk, Rule.EARLY, (begin + row, begin + stop), ahead_s, foot)
            return


def _late(walk: JudgedWalk, begin: int, end: int, foot: int) -> Iterator[Finding]:
    """Yield the touch-down of a swing foot after its planned time."""
    down = np.flatnonzero(walk.load[begin:end, foot] > walk.limits.contact_load)
    stop = begin + int(down[0]) if len(down) else end
    late_s = (stop - begin) * walk.period_s
    if late_s > walk.limits.touch_down * walk.step_s:
        yield _landing(walk, Rule.LATE, (begin, stop), late_s, foot)


def _landing(
    walk: JudgedWalk, rule: Rule, rows: tuple[int, int], off_s: float, foot: int
) -> Finding:
    time_s, limit_s = walk.record.time_s, walk.limits.touch_down * walk.step_s
    begin_s, until_s = float(time_s[rows[0]]), float(time_s[rows[1] - 1])
    amounts = 1e3 * off_s, "ms", 1e3 * limit_s
    return Finding(rule, begin_s, until_s, *amounts, ADVICE[rule], foot=SIDES[foot])


def _slip(walk: JudgedWalk) -> Iterator[Finding]:
    record, limits = walk.record, walk.limits
    fastest = limits.slip_speed * math.sqrt(GRAVITY * walk.robot.reduced.leg_length)
    furthest = limits.slip_way * walk.robot.reduced.sole_length
    for foot, side in enumerate(SIDES):
        carries = walk.load[:, foot] > limits.carrying_load
        speed, way = record.foot_speed[:, foot], _slid(walk, carries, foot)
        fast, far = carries & (speed > fastest), way > furthest
        by_speed = Measure(speed, "m/s", fastest)
        by_way = Measure(1e3 * way, "mm", 1e3 * furthest)
        yield from walk.findings(
            Rule.SLIP, fast, limits.slip_hold_s, by_speed, foot=side
        )
        yield from walk.findings(Rule.SLIP, far, 0.0, by_way, foot=side)


def _slid(walk: JudgedWalk, carries: Mask, foot: int) -> Array:
    """Return the distance that a loaded foot has moved in the last 1 s, (N,) [m].

    The distance is measured from the touch-down if that is more recent, or from the
    first row after a gap, in which the foot may have stepped.
    """
    centre = walk.record.soles[:, foot].mean(axis=1)
    rows = np.arange(len(centre))
    begins = np.where(carries, 0, rows + 1)
    begins[walk.gaps] = np.maximum(begins[walk.gaps], walk.gaps)
    since = np.maximum.accumulate(begins)
    since = np.maximum(since, rows - round(1.0 / walk.period_s))
    start = centre[np.minimum(since, rows)]
    return np.where(carries, np.linalg.norm(centre - start, axis=1), 0.0)


def _zmp(walk: JudgedWalk) -> Iterator[Finding]:
    limit = walk.limits.zmp_margin * walk.robot.reduced.sole_length
    margin = standing_margins(walk.robot, walk.record, walk.limits.contact_load)
    broken, hold_s = margin < limit, walk.limits.zmp_hold_s
    measure = Measure(1e3 * margin, "mm", 1e3 * limit, np.min)
    for finding in walk.findings(Rule.ZMP, broken, hold_s, measure):
        row = int(np.searchsorted(walk.record.time_s, finding.time_s))
        yield replace(finding, remedies=(EDGE_ADVICE[_edge(walk, row)],))


def _edge(walk: JudgedWalk, row: int) -> str:
    """Return the edge of the loaded soles that is nearest to the ZMP."""
    record = walk.record
    foot = int(np.argmax(record.foot_load[row]))
    yaw = record.feet[row, foot, 2]
    cos, sin = math.cos(yaw), math.sin(yaw)
    heading = np.array([[cos, -sin], [sin, cos]])
    loaded = walk.load[row] > walk.limits.contact_load
    corners = (record.soles[row, loaded] @ heading).reshape(-1, 2)
    point = record.zmp[row] @ heading
    (front, left), (rear, right) = corners.max(axis=0) - point, point - corners.min(0)
    outer, inner = (left, right) if foot == 0 else (right, left)
    room = {"front": front, "rear": rear, "inner": inner, "outer": outer}
    return min(room, key=room.__getitem__)


def _degrees(angles: Array) -> Array:
    return np.asarray(np.degrees(angles))


_RULES = (_estimator, _self_collision, _joints, _touch_downs, _slip, _zmp)
