"""Cause of a fall: the rule that broke first, when, by how much, and what to change.

Pure functions of a record. The cause is the first break of the run-up. The run-up
consists of the breaks before the fall that have gaps of less than `RECOVERY_S` between
them. Breaks before it, and those that ended more than `RUN_UP_S` before the fall, did
not cause the fall. A slip in the run-up brings those of the steps before it with it,
until a step had none: a foot that slips is lifted before it has recovered.
What disturbed the robot less than `DISTURBED_S` before the fall is named, and the
run-up begins with it: with the last of several disturbances, or with one before it from
which the robot had not recovered by then.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.rule_checks import broken_rules
from gaitchain.analysis.rules import (
    RECOVERY_S,
    STRIDE_ADVICE,
    Finding,
    JudgedWalk,
    Remedy,
    Rule,
    RuleLimits,
)
from gaitchain.gait.stride.family import STRIDES
from gaitchain.robot.robot import Robot

RUN_UP_S = 1.5
DISTURBED_S = 3.0
"""So long after a push a robot may take to fall [s]: some steps of a swaying walk."""
_STILL = 1e-3  # m/s and rad/s: a robot that was asked for less stood
_WEAKER = Remedy("a weaker disturbance (`gaitchain push` finds what it withstands)")
_STOOD = Remedy("floor, load and servos: it stood")
_IN_PROFILE = {
    "joint_torque_limit": "servo.NAME.torque_limit of the profile",
    "servo_stiffness": "servo.NAME.stiffness of the profile",
}


@dataclass(frozen=True)
class Explanation:
    """All rules that broke in a walk, and the one that caused the fall."""

    fell_at_s: float | None
    """Time of the fall [s]; None without one."""
    findings: tuple[Finding, ...]
    """Breaks up to the fall, in order of time."""
    cause: Finding | None
    """None if the robot did not fall, or fell without a broken rule."""
    events: tuple[tuple[float, str], ...] = ()
    """(time [s], event) such as a push, up to the fall."""
    notes: tuple[tuple[float, str], ...] = ()
    """(time [s], event) such as a stop or a reset, which no fall comes from."""
    whole: bool = True
    """Whether nothing is missing in the record, in which it may have fallen."""

    @property
    def after(self) -> str:
        """What disturbed the robot before it fell as " after ...", or ""."""
        if self.fell_at_s is None:
            return ""
        until_s = self.fell_at_s if self.cause is None else self.cause.time_s
        near = _disturbances(self.events, self.fell_at_s, until_s)
        if not near:
            return ""
        at_s, what = near[-1]
        many = f"{len(near)} disturbances, the last one " if len(near) > 1 else ""
        early = until_s - at_s > RECOVERY_S
        when = f", {self.fell_at_s - at_s:.2f} s before the fall" if early else ""
        return f" after {many}{what}{when}"

    @property
    def sentence(self) -> str:
        """The cause in one sentence."""
        if self.fell_at_s is None:
            count = len(self.findings)
            often = {0: "no rule broke", 1: "one rule broke, once"}
            broke = often.get(count, f"rules broke {count} times")
            if not self.whole:
                return f"No fall in the rows that are left; {broke}."
            return f"The robot did not fall; {broke}."
        where = "" if self.whole else "in the rows that are left "
        if self.cause is None:
            fell = f"The robot fell {when_fell(self.fell_at_s)}{self.after}"
            return f"{fell}; {where}no rule broke before."
        cause = self.cause
        return (
            f"The robot fell {when_fell(self.fell_at_s)}{self.after}: "
            f"{where}{cause.what} came first, "
            f"{self.fell_at_s - cause.time_s:.2f} s before the fall, "
            f"{cause.how_much} (limit {cause.limit_text}); try {cause.advice}."
        )


def when_fell(fell_at_s: float) -> str:
    """Tell the time of a fall, which may come before the first step."""
    if fell_at_s > 0.0:
        return f"at {fell_at_s:.2f} s"
    return f"while it settled, {-fell_at_s:.2f} s before its first step"


def explain(
    robot: Robot, record: WalkRecord, limits: RuleLimits | None = None
) -> Explanation:
    """Find every rule that broke in a walk, and the cause of its fall.

    Args:
        robot: the robot.
        record: the walk.
        limits: limits of the rules; `RuleLimits()` by default.

    Returns:
        The findings up to the fall in order of time, and the cause among them.
    """
    limits, walked = limits or RuleLimits(), _until_fall(record)
    found = broken_rules(robot, walked, limits)
    fell_at_s = record.fell_at_s
    end_s = math.inf if fell_at_s is None else fell_at_s
    events = tuple(sorted(event for event in record.events if event[0] <= end_s))
    findings = tuple(
        replace(f, remedies=_of_strides(f.rule, robot))
        if record.gait == STRIDES.name
        else f
        for f in found
    )
    step_s = JudgedWalk(robot, walked, limits).step_s
    cause = None if fell_at_s is None else _cause(findings, fell_at_s, events, step_s)
    if cause is not None and fell_at_s is not None:
        disturbed = bool(_disturbances(events, fell_at_s, cause.time_s))
        stood = _stood(record, fell_at_s)
        fitting = replace(cause, remedies=_fitting(cause.remedies, disturbed, stood))
        findings = tuple(fitting if f is cause else f for f in findings)
        cause = fitting
    return Explanation(fell_at_s, findings, cause, events, record.notes)


def _disturbances(
    events: tuple[tuple[float, str], ...], fell_at_s: float, until_s: float
) -> list[tuple[float, str]]:
    """Return what disturbed the robot soon enough before its fall to have caused it.

    Nothing of a robot that was falling by itself before the first disturbance.
    """
    since_s = fell_at_s - DISTURBED_S
    near = [event for event in events if since_s <= event[0] <= fell_at_s]
    return near if near and near[0][0] <= until_s + 1e-6 else []


def _stood(record: WalkRecord, fell_at_s: float) -> bool:
    """Return whether no motion was asked for just before the fall."""
    told = [(t, command) for t, command in record.commands if t <= fell_at_s]
    ends = [*(t for t, _ in told[1:]), fell_at_s]
    since_s = fell_at_s - DISTURBED_S
    asked = [c for (_, c), end_s in zip(told, ends, strict=False) if end_s >= since_s]
    return bool(asked) and all(max(map(abs, c.motion)) < _STILL for c in asked)


def _fitting(
    remedies: tuple[Remedy, ...], disturbed: bool, stood: bool
) -> tuple[Remedy, ...]:
    """Return the remedies that fit how the robot fell."""
    fitting = tuple(r for r in remedies if not (stood and r.walking_only))
    return ((_WEAKER,) if disturbed else ()) + fitting or (_STOOD,)


def _of_strides(rule: Rule, robot: Robot) -> tuple[Remedy, ...]:
    """Return what to change; servos of a robot from a file have it in the profile."""
    remedies = STRIDE_ADVICE[rule]
    for key, in_profile in _IN_PROFILE.items() if not robot.of_boxes else ():
        remedies = tuple(
            r._replace(text=r.text.replace(key, in_profile)) for r in remedies
        )
    return remedies


def _cause(
    findings: tuple[Finding, ...],
    fell_at_s: float,
    events: tuple[tuple[float, str], ...],
    step_s: float,
) -> Finding | None:
    run_up = _run_up(findings, fell_at_s)
    begin_s = min((f.time_s for f in run_up), default=fell_at_s)
    # A rule that broke before a push did not cause the fall until then.
    since_s = min(begin_s - RECOVERY_S, fell_at_s - DISTURBED_S)
    pushed_s = _felled_from([t for t, _ in events if t >= since_s], findings)
    later = [f for f in findings if f.time_s >= pushed_s - 1e-6]
    if pushed_s == math.inf:
        run_up += _slips_before(findings, run_up, step_s)
    first = later or [f for f in findings if f in run_up]
    return first[0] if first else None


def _felled_from(pushes_s: list[float], findings: tuple[Finding, ...]) -> float:
    """Return when the push came from which the robot did not recover; inf for none.

    It had recovered if no rule was broken any more when the next push came.
    """
    felled_s = pushes_s[-1] if pushes_s else math.inf
    for push_s in reversed(pushes_s[:-1]):
        since = [f for f in findings if push_s - 1e-6 <= f.time_s < felled_s]
        ended_s = max((f.until_s for f in since), default=push_s)
        if ended_s < felled_s - RECOVERY_S:
            break
        felled_s = push_s
    return felled_s


def _run_up(findings: tuple[Finding, ...], fell_at_s: float) -> list[Finding]:
    """Return the breaks that the robot did not recover from before its fall."""
    begin_s, run_up = fell_at_s, []
    for finding in sorted(findings, key=lambda f: f.until_s, reverse=True):
        if finding.until_s < max(fell_at_s - RUN_UP_S, begin_s - RECOVERY_S):
            break
        run_up.append(finding)
        begin_s = min(begin_s, finding.time_s)
    return run_up


def _slips_before(
    findings: tuple[Finding, ...], run_up: list[Finding], step_s: float
) -> list[Finding]:
    """Return the slips, step after step, that led to a slip of the run-up.

    A slip ends as its foot is lifted, which is no recovery: only a step without one is.
    """
    gap_s, chain = max(step_s, RECOVERY_S), []
    begin_s = min((f.time_s for f in run_up if f.rule is Rule.SLIP), default=math.inf)
    for finding in sorted(findings, key=lambda f: f.until_s, reverse=True):
        if finding.rule is not Rule.SLIP or finding in run_up:
            continue
        if finding.until_s < begin_s - gap_s:
            break
        chain.append(finding)
        begin_s = min(begin_s, finding.time_s)
    return chain


def _until_fall(record: WalkRecord) -> WalkRecord:
    """Cut off the rows of a record after the fall."""
    if record.fell_at_s is None:
        return record
    rows = max(int(np.searchsorted(record.time_s, record.fell_at_s - 1e-9)), 1)
    columns = {f.name: getattr(record, f.name) for f in fields(record)}
    arrays: dict[str, Any] = {
        n: a[:rows] for n, a in columns.items() if isinstance(a, np.ndarray)
    }
    return replace(record, **arrays)
