"""The rules for a walk, their limits, and the quantities that they compare.

A rule breaks when its limit is exceeded for longer than its hold time. Breaks of one
rule at one joint or foot that are less than `RECOVERY_S` apart count as one. Its amount
is the worst value in its first `_JUDGED_S`, as later ones may be part of the fall.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gaitchain.analysis.record import WalkRecord
from gaitchain.gait.zmp import LEAST_LOAD
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array
from gaitchain.robot.robot import Robot

SIDES = ("left", "right")
RECOVERY_S = 0.3
_GAP_S = 0.05  # no foot is lifted and put down again in so short a time
_JUDGED_S = 0.2
Mask = NDArray[np.bool_]
_DIGITS = {"m/s": 2, "mm": 1, "deg": 1, "N m": 1, "deg/s": 0, "ms": 0}


class Rule(Enum):
    """The rules; of two that break at the same time, the first in this list leads."""

    ESTIMATOR = "estimator divergence"
    SELF_COLLISION = "self collision"
    SPEED = "speed saturation"
    TORQUE = "torque saturation"
    TRACKING = "tracking lag"
    EARLY = "early touch-down"
    LATE = "late touch-down"
    SLIP = "slip"
    ZMP = "ZMP at the sole's edge"


MEANINGS = {
    Rule.ESTIMATOR: "the walker takes its trunk for leaning otherwise than it does",
    Rule.SELF_COLLISION: "the legs touch each other",
    Rule.SPEED: "a joint turns as fast as its servo can, or is asked to turn faster",
    Rule.TORQUE: "a servo pulls with all the torque that it has",
    Rule.TRACKING: "a joint is farther from its target than its load explains",
    Rule.EARLY: "a foot lands long before its planned time",
    Rule.LATE: "a foot is still in the air long after its planned time",
    Rule.SLIP: "a foot that carries the robot slides on the ground",
    Rule.ZMP: "the point that the ground's force acts at (zero moment point) is at the "
    "edge of the soles on the ground, over which the robot then tips",
}
"""What it means that a rule breaks, for a person."""


class Remedy(NamedTuple):
    """One thing that a user can change where a rule broke."""

    text: str
    """The parameter, and in which direction."""
    walking_only: bool = False
    """Whether it does nothing for a robot that stands: it cannot stand more slowly."""


_SLOWER = Remedy("a slower command", walking_only=True)
_LONGER_STEPS = Remedy("--step-s up", walking_only=True)
_GRIP = Remedy("the sole's friction up")
_STIFFER = Remedy("servo_stiffness up")
_STRONGER = Remedy("joint_torque_limit up")
ADVICE = {
    Rule.ESTIMATOR: (
        Remedy("the estimator's gain up"),
        Remedy("the gyro's bias out"),
    ),
    Rule.SELF_COLLISION: (
        Remedy("sway down"),
        Remedy("the bound of sideways steps", walking_only=True),
    ),
    Rule.SPEED: (_LONGER_STEPS, Remedy("joint_speed_limit up")),
    Rule.TORQUE: (Remedy("hip_height up (straighter knees)"), _STRONGER),
    Rule.TRACKING: (_STIFFER, _LONGER_STEPS),
    Rule.EARLY: (Remedy("foot_z up (more lift)", walking_only=True),),
    Rule.LATE: (
        Remedy("hip_height down (more reach)", walking_only=True),
        _LONGER_STEPS,
    ),
    Rule.SLIP: (_GRIP, Remedy("shorter steps", walking_only=True)),
    Rule.ZMP: (Remedy("sway"),),
}
"""What to change in a walk of key poses."""
STRIDE_ADVICE = {
    Rule.ESTIMATOR: (Remedy("standing still before it walks, for the gyro's bias"),),
    Rule.SELF_COLLISION: (
        Remedy("a slower command aside", walking_only=True),
        Remedy("less turning", walking_only=True),
    ),
    Rule.SPEED: (_SLOWER, Remedy("a library with a lower --speed-limit")),
    Rule.TORQUE: (_SLOWER, _STRONGER),
    Rule.TRACKING: (_STIFFER, _SLOWER),
    Rule.EARLY: (_SLOWER,),
    Rule.LATE: (_SLOWER,),
    Rule.SLIP: (_GRIP, _SLOWER),
    Rule.ZMP: (_SLOWER,),
}
"""The same of strides, which follow from the robot: a user changes what is asked."""
EDGE_ADVICE = {
    "front": Remedy("hip_x down (hips further back)"),
    "rear": Remedy("hip_x up (hips further ahead)"),
    "inner": Remedy("sway up (further over the support foot)"),
    "outer": Remedy("sway down (less far over the support foot)"),
}
"""Remedy by the edge that the ZMP is at, in the heading of the loaded foot."""


@dataclass(frozen=True)
class RuleLimits:
    """Limits of the rules. Lengths scale with the sole, speeds with sqrt(g leg).

    A rule breaks if its limit is exceeded for longer than its hold time `*_hold_s`.
    """

    zmp_margin: float = 0.014
    """Least ZMP margin in the loaded soles, part of a sole's length: 3 mm on RES."""
    slip_speed: float = 0.04
    """Greatest speed of a loaded foot, part of sqrt(g leg): 0.1 m/s on RES."""
    slip_way: float = 0.07
    """Greatest distance that a loaded foot moves within 1 s, part of a sole's length:
    15 mm on RES."""
    contact_load: float = LEAST_LOAD
    """Part of the weight above which a foot is on the ground."""
    landing_load: float = 0.1
    """Part of the weight above which a swing foot has landed."""
    carrying_load: float = 0.3
    """Part of the weight above which a foot must not slip."""
    saturation: float = 0.99
    """Part of a joint's torque or speed limit from which it is saturated."""
    touch_down: float = 0.15
    """Greatest deviation from the planned touch-down, part of the step time: 0.45 s in
    a step of 3 s."""
    air: float = 0.05
    """Part of the step time in the air after which a swing foot has lifted off."""
    tracking_rad: float = math.radians(4.0)
    """Greatest joint error beyond the sag torque / servo_stiffness of a servo."""
    estimate_rad: float = math.radians(3.0)
    """Greatest error of the estimated roll or pitch."""
    zmp_hold_s: float = 0.06
    slip_hold_s: float = 0.03
    saturation_hold_s: float = 0.04
    landing_hold_s: float = 0.02
    tracking_hold_s: float = 0.06
    estimate_hold_s: float = 0.05


@dataclass(frozen=True)
class Finding:
    """One break of a rule."""

    rule: Rule
    time_s: float
    """Start of the break [s]."""
    until_s: float
    """Last moment of the break [s]."""
    amount: float
    """Worst value at the beginning of the break."""
    unit: str
    """Unit of amount and limit."""
    limit: float
    """Limit of the rule."""
    remedies: tuple[Remedy, ...]
    """What to change."""
    joint: str | None = None
    """Joint at which the rule broke, for rules on joints."""
    foot: str | None = None
    """Foot at which the rule broke, for rules on feet."""
    asked: bool = False
    """Whether the amount is what the joint was asked for, not what it did."""

    @property
    def what(self) -> str:
        """The rule, and the joint or foot at which it broke."""
        if self.joint is not None:
            return f"{self.rule.value} at {self.joint}"
        return f"{self.rule.value}, {self.foot} foot" if self.foot else self.rule.value

    @property
    def advice(self) -> str:
        """What to change, in words."""
        return ", or ".join(remedy.text for remedy in self.remedies)

    @property
    def how_much(self) -> str:
        """The amount with its unit, and whether it was only asked for."""
        asked = "asked for " if self.asked else ""
        return f"{asked}{_rounded(self.amount, self.unit)} {self.unit}"

    @property
    def limit_text(self) -> str:
        """The limit with its unit."""
        return f"{_rounded(self.limit, self.unit)} {self.unit}"


def _rounded(value: float, unit: str) -> str:
    # + 0.0: a ZMP that is 0.01 mm outside reads 0.0, not -0.0.
    return f"{round(value, _DIGITS[unit]) + 0.0:.{_DIGITS[unit]}f}"


class Measure(NamedTuple):
    """The quantity that a rule compares with its limit."""

    values: Array
    """(N,) values, or (N, 2 n) for all joints."""
    unit: str
    limit: float
    worst: Callable[[Array], Any] = np.max
    """Selects the worst of several values."""
    asked: Mask | None = None
    """Whether a value is what was asked for, not what was done; of the same shape."""


@dataclass(frozen=True, eq=False)
class JudgedWalk:
    """A record with the quantities that the rules need."""

    robot: Robot
    record: WalkRecord
    limits: RuleLimits

    @cached_property
    def period_s(self) -> float:
        """Time from row to row [s]."""
        steps = np.diff(self.record.time_s)
        return float(np.median(steps)) if len(steps) else CONTROL_PERIOD_S

    @cached_property
    def step_s(self) -> float:
        """Planned time of a step [s]; without a plan that of the shortest step."""
        if self.record.timing is not None:
            return self.record.timing.step
        ticks = np.diff(self.record.step_ticks)
        return float(ticks.min()) * self.period_s if len(ticks) else 1.0

    @cached_property
    def load(self) -> Array:
        """Load of each foot, part of the weight, (N, 2)."""
        return self.record.foot_load / (self.robot.reduced.mass * GRAVITY)

    @cached_property
    def pushed(self) -> list[int]:
        """Rows with an external event, at which a break is split into two."""
        times = np.array([time_s for time_s, _ in self.record.events])
        rows = np.searchsorted(self.record.time_s, times - 1e-6)
        return sorted({int(row) for row in rows})

    @cached_property
    def gaps(self) -> list[int]:
        """First rows after a time of which none is left; no break spans one."""
        far_s = max(_GAP_S, 1.5 * self.period_s)
        later = np.flatnonzero(np.diff(self.record.time_s) > far_s) + 1
        return [int(row) for row in later]

    def spells(self, broken: Mask, hold_s: float) -> Iterator[tuple[int, int]]:
        """Yield (first row, row after the last) of breaks longer than the hold time."""
        edges = np.diff(np.concatenate([[False], broken, [False]]).astype(np.int8))
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        for span in zip(begins.tolist(), ends.tolist(), strict=True):
            for begin, end in _cut(span, self.gaps):
                if (end - begin) * self.period_s > hold_s + 1e-9:
                    yield from _cut((begin, end), self.pushed)

    def findings(
        self,
        rule: Rule,
        broken: Mask,
        hold_s: float,
        measure: Measure,
        *,
        joint: str | None = None,
        foot: str | None = None,
    ) -> Iterator[Finding]:
        """Yield the breaks of a rule at one joint or foot, merging near ones.

        Args:
            rule: the rule.
            broken: (N,) whether the limit is exceeded.
            hold_s: hold time [s].
            measure: the quantity compared.
            joint: name of the joint, for rules on joints.
            foot: "left" or "right", for rules on feet.
        """
        merged: list[list[int]] = []
        for begin, end in self.spells(broken, hold_s):
            last = merged[-1][1] if merged else -math.inf
            cut = any(last <= row <= begin for row in (*self.pushed, *self.gaps))
            if (begin - last) * self.period_s < RECOVERY_S and not cut:
                merged[-1][1] = end
            else:
                merged.append([begin, end])
        time_s, judged = self.record.time_s, math.ceil(_JUDGED_S / self.period_s)
        values, unit, limit, worst, told = measure
        for begin, end in merged:
            rows = slice(begin, min(end, begin + judged))
            amount = float(worst(values[rows][broken[rows]]))
            span = float(time_s[begin]), float(time_s[end - 1])
            asked = told is not None and bool(told[rows][values[rows] == amount].any())
            near = rule, *span, amount, unit, limit, ADVICE[rule]
            yield Finding(*near, joint, foot, asked)


def _cut(span: tuple[int, int], rows: list[int]) -> Iterator[tuple[int, int]]:
    """Yield the parts of a span of rows that begin at some of them."""
    begin, end = span
    yield from pairwise([begin, *(row for row in rows if begin < row < end), end])
