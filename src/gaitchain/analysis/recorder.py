"""Build the record of a walk, one sample per control period.

A sample comes from a walker in a simulator (`observe`), or from the telemetry of a
control loop. Columns derived from the simulator's ground truth are computed at the end,
for all rows at once.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gaitchain.analysis.record import Limit, WalkRecord
from gaitchain.analysis.record_columns import columns_from_truth
from gaitchain.backends.base import Truth
from gaitchain.gait.family import STAND
from gaitchain.gait.motion import Timing
from gaitchain.messages import Array, Command, PanelMessage
from gaitchain.robot.robot import Robot
from gaitchain.walker.gait import Gait
from gaitchain.walker.generator import Decision

if TYPE_CHECKING:
    from gaitchain.backends.mujoco import MujocoBackend

_SLEW = 1  # index of a servo's speed limit in MuJoCo's actuator_dynprm
_BASE = 7  # number of generalised positions of the trunk
_UNKNOWN = math.nan, math.nan
_OWN = (
    *("time_s", "target", "joint_position", "joint_velocity"),
    *("torque", "estimated_tilt"),
)
_TRUTH_SHAPES: dict[str, tuple[int, ...]] = {
    "qpos": (-1,),
    "place": (2, 3),
    "turn": (2, 9),
    "wrench": (2, 6),
    "twist": (2, 6),
    "com": (3,),
    "tilt": (2,),
    "foot_height": (2,),
}


class WalkSample(NamedTuple):
    """Walker and robot in one control period: a row of a record."""

    time_s: float
    """Time since the start of the first step [s]."""
    target: Sequence[float] | Array
    """(2 n,) joint targets [rad]"""
    joint_position: Sequence[float] | Array
    """(2 n,) joint angles [rad]"""
    joint_velocity: Sequence[float] | Array
    """(2 n,) joint speeds [rad/s]"""
    torque: Sequence[float] | Array
    """(2 n,) joint torques [N m]"""
    estimated_tilt: tuple[float, float]
    """Estimated roll and pitch [rad]; NaN if unknown."""
    planned_zmp: tuple[float, float]
    """Planned ZMP in the support-foot frame [m]; NaN if unknown."""
    support: str
    """Planned support, as in `WalkRecord`."""
    decision: Decision | None
    """Latest decision of the gait."""
    panel: PanelMessage | None
    """Primitive components of that decision's key pose."""
    truth: Truth | None
    """Ground truth of a simulator; None on a robot."""


def observe(
    time_s: float, target: Array, gait: Gait, simulator: "MujocoBackend"
) -> WalkSample:
    """Return the sample of a simulated robot before a target is written to it.

    Args:
        time_s: time since the start of the first step [s].
        target: (2 n,) joint targets [rad].
        gait: the gait that computed the targets.
        simulator: the simulated robot.
    """
    truth = simulator.truth()
    return WalkSample(
        time_s=time_s,
        target=np.array(target),
        joint_position=truth.qpos[_BASE:],
        joint_velocity=truth.qvel[_BASE - 1 :],
        torque=simulator.loads(),
        estimated_tilt=estimated_tilt(gait),
        planned_zmp=planned_zmp(gait),
        support=planned_support(gait),
        decision=gait.decision,
        panel=gait.panel,
        truth=truth,
    )


def estimated_tilt(gait: Gait) -> tuple[float, float]:
    """Return a gait's estimated roll and pitch [rad]; NaN without an estimate."""
    found = gait.estimate
    return _UNKNOWN if found is None else (found.roll, found.pitch)


def planned_zmp(gait: Gait) -> tuple[float, float]:
    """Return a gait's planned ZMP in the support-foot frame [m]; NaN without one."""
    found = gait.planned_zmp
    return _UNKNOWN if found is None else (float(found[0]), float(found[1]))


def planned_support(gait: Gait) -> str:
    """Return a gait's planned support, as in `WalkRecord`."""
    return "stand" if gait.standing else gait.support.value


class Recorder:
    """Collects the rows of a walk and makes a record of them."""

    def __init__(
        self, robot: Robot, simulator: "MujocoBackend | None" = None, *, gait: str = ""
    ) -> None:
        """Begin without a row.

        Args:
            robot: the robot.
            simulator: source of mass and joint limits; those of the robot by default.
            gait: name of the gait's family.
        """
        self._robot, self._mass, self._gait = robot, robot.legs.mass, gait
        self._limits: dict[str, Any] = {}
        self._samples: list[WalkSample] = []
        if simulator is not None:
            model = simulator.model
            self._mass = float(model.body_mass.sum())
            self._limits = {
                "torque_limit": _limit(model.actuator_forcerange[:, 1]),
                "speed_limit": _limit(model.actuator_dynprm[:, _SLEW]),
            }

    def add(self, sample: WalkSample) -> None:
        """Add a row."""
        self._samples.append(sample)

    def record(
        self,
        step_ticks: tuple[int, ...],
        fell_at_s: float | None,
        timing: Timing | None = None,
        events: tuple[tuple[float, str], ...] = (),
        commands: tuple[tuple[float, Command], ...] = (),
    ) -> WalkRecord:
        """Return the record of all rows; see `WalkRecord` for the arguments.

        Without ground truth the columns that need it are NaN, there are no touch-downs,
        and the support is always "stand", so that no rule is applied.
        """
        rows = self._samples
        own: dict[str, Any] = {n: np.array([getattr(r, n) for r in rows]) for n in _OWN}
        return WalkRecord(
            **self._derived(rows),
            **own,
            key_pose=np.array([_key_pose(row) for row in rows], dtype=np.int64),
            step_ticks=step_ticks,
            fell_at_s=fell_at_s,
            decisions=_decisions(rows),
            robot=self._robot,
            gait=self._gait,
            timing=timing,
            events=events,
            commands=commands,
            **self._limits,
        )

    def _derived(self, rows: Sequence[WalkSample]) -> dict[str, Any]:
        """Return the columns that need the ground truth of a simulator."""
        truths = [row.truth for row in rows if row.truth is not None]
        support = np.array([row.support if truths else "stand" for row in rows])
        touch = [truth.self_contact for truth in truths] or [False] * len(rows)
        known = truth_columns(truths) if truths else _unknown(rows)
        known["time_s"] = np.array([row.time_s for row in rows])
        known["planned_zmp"] = np.array([row.planned_zmp for row in rows])
        return {
            **columns_from_truth(self._robot, self._mass, known, support),
            **{name: known[name] for name in ("qpos", "tilt", "foot_height")},
            "self_contact": np.array(touch),
            "support": support,
        }


def truth_columns(truths: Sequence[Truth]) -> dict[str, Array]:
    """Stack the ground truth of several moments to arrays with one row for each."""
    return {
        name: np.array([getattr(truth, name) for truth in truths]).reshape(
            len(truths), *shape
        )
        for name, shape in _TRUTH_SHAPES.items()
    }


def _unknown(rows: Sequence[WalkSample]) -> dict[str, Array]:
    """Return NaN in place of the ground truth: only the joints were measured."""
    truth = {
        name: np.full((len(rows), *map(abs, shape)), math.nan)
        for name, shape in _TRUTH_SHAPES.items()
    }
    base = np.full((len(rows), _BASE), math.nan)
    joints = np.array([row.joint_position for row in rows])
    return truth | {"qpos": np.hstack([base, joints])}


def _key_pose(row: WalkSample) -> tuple[int, int]:
    decision = row.decision
    if decision is None or row.panel is None:
        return 0, STAND
    return decision.layer, decision.pose


def _decisions(
    rows: Sequence[WalkSample],
) -> tuple[tuple[float, Decision, PanelMessage], ...]:
    """Return each decision once, with the time of its first row."""
    found, last = [], None
    for row in rows:
        decision, panel, key = row.decision, row.panel, None
        if decision is not None and panel is not None:
            # Costs are left out: they may be NaN, and NaN differs from itself.
            key = decision.layer, decision.pose, decision.target, panel.left_support
            if key != last:
                found.append((row.time_s, decision, panel))
        last = key
    return tuple(found)


def _limit(each: Array) -> Limit:
    """Return one limit if it is the same for all joints, else one for each."""
    values = tuple(each.tolist())
    return values[0] if len(set(values)) == 1 else values
