"""Cause of a fall: the rule that broke first, when, by how much, and what to change.

Pure functions of a record. The cause is the first break of the run-up. The run-up
consists of the breaks before the fall that have gaps of less than `RECOVERY_S` between
them. Breaks before it, and those that ended more than `RUN_UP_S` before the fall, did
not cause the fall.
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
    Rule,
    RuleLimits,
)
from gaitchain.gait.stride.family import STRIDES
from gaitchain.robot.robot import Robot

RUN_UP_S = 1.5
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

    @property
    def after(self) -> str:
        """Events just before the cause as " after ...", or ""."""
        if self.cause is None:
            return ""
        end_s = self.cause.time_s + 1e-6
        near = [what for t, what in self.events if end_s - RECOVERY_S <= t <= end_s]
        return f" after {', '.join(near)}" if near else ""

    @property
    def sentence(self) -> str:
        """The cause in one sentence."""
        if self.fell_at_s is None:
            count = len(self.findings)
            often = {0: "no rule broke", 1: "one rule broke, once"}
            broke = often.get(count, f"rules broke {count} times")
            return f"The robot did not fall; {broke}."
        if self.cause is None:
            return f"The robot fell at {self.fell_at_s:.2f} s; no rule broke before."
        cause = self.cause
        return (
            f"The robot fell at {self.fell_at_s:.2f} s{self.after}: "
            f"{cause.what} came first, "
            f"{self.fell_at_s - cause.time_s:.2f} s before the fall, "
            f"{cause.how_much} (limit {cause.limit_text}); turn {cause.advice}."
        )


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
    found = broken_rules(robot, _until_fall(record), limits or RuleLimits())
    fell_at_s = record.fell_at_s
    end_s = math.inf if fell_at_s is None else fell_at_s
    events = tuple(sorted(event for event in record.events if event[0] <= end_s))
    findings = tuple(
        replace(f, advice=_stride_advice(f.rule, robot))
        if record.gait == STRIDES.name
        else f
        for f in found
    )
    cause = None if fell_at_s is None else _cause(findings, fell_at_s, events)
    return Explanation(fell_at_s, findings, cause, events)


def _stride_advice(rule: Rule, robot: Robot) -> str:
    """Return the parameter to change; servos of a full robot have it in the profile."""
    advice = STRIDE_ADVICE[rule]
    for key, in_profile in _IN_PROFILE.items() if robot.legs else ():
        advice = advice.replace(key, in_profile)
    return advice


def _cause(
    findings: tuple[Finding, ...],
    fell_at_s: float,
    events: tuple[tuple[float, str], ...],
) -> Finding | None:
    begin_s, run_up = fell_at_s, []
    for finding in sorted(findings, key=lambda f: f.until_s, reverse=True):
        if finding.until_s < max(fell_at_s - RUN_UP_S, begin_s - RECOVERY_S):
            break
        run_up.append(finding)
        begin_s = min(begin_s, finding.time_s)
    first = [f for f in findings if f in run_up]
    # A rule that broke before a push did not cause the fall until then.
    pushed_s = next((t for t, _ in events if t >= begin_s - RECOVERY_S), -math.inf)
    later = (f for f in first if f.time_s >= pushed_s - 1e-6)
    return next(later, first[0] if first else None)


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
