"""Record a walk on the simulator, tick by tick.

The recorder copies MuJoCo's arrays at each tick, and has the columns of the record
worked out at the end, for all rows in one go.
"""

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from gaitchain.analysis.record import Limit, WalkRecord
from gaitchain.analysis.record_columns import columns
from gaitchain.gait.family import STAND
from gaitchain.gait.motion import Timing
from gaitchain.gait.zmp import Support
from gaitchain.messages import Array, Command, PanelMessage
from gaitchain.robot.reduced_biped import Biped
from gaitchain.walker.generator import Decision

if TYPE_CHECKING:
    from gaitchain.backends.mujoco import MujocoBackend

_SLEW = 1  # where MuJoCo keeps a servo's speed limit in its dynprm
_UNKNOWN = math.nan, math.nan
_OF_FEET = ("place", "turn", "wrench", "twist")
_AS_COPIED = ("time_s", "target", "torque", "qpos", "tilt", "foot_height")


class Plan(Protocol):
    """What the recorder reads off a walker at each tick.

    It may also have `estimate` (None, or with `roll` and `pitch` [rad]) and
    `planned_zmp` (None, or (2,) in the support-foot frame of `zmp` [m]).
    """

    @property
    def standing(self) -> bool:
        """Whether the robot is to stand still."""

    @property
    def support(self) -> Support:
        """The planned support region, when not standing."""

    @property
    def decision(self) -> Decision | None:
        """The latest decision."""

    @property
    def panel(self) -> PanelMessage | None:
        """The primitive components of the key pose that comes next."""


class Recorder:
    """The columns of a walk's record, filled tick by tick."""

    def __init__(
        self, biped: Biped, backend: "MujocoBackend", rows: int = 1024
    ) -> None:
        """Make room for a number of rows; more of them make room for themselves."""
        data, model = backend.data, backend.model
        sources = {
            "qpos": data.qpos,
            "qvel": data.qvel,
            "torque": data.actuator_force,
            "place": data.xpos,
            "turn": data.xmat,
            "wrench": data.cfrc_ext,
            "twist": data.cvel,
            "com": data.subtree_com[1],
        }
        told = {
            "time_s": (),
            "target": (model.nu,),
            "tilt": (2,),
            "foot_height": (2,),
            "self_contact": (),
            "estimate": (2,),
            "planned_zmp": (2,),
        }
        shapes = {**{n: a.shape for n, a in sources.items()}, **told}
        self._raw = {n: np.empty((max(rows, 1), *s)) for n, s in shapes.items()}
        # MuJoCo's arrays stay where they are: looked up once, not at each tick.
        self._copies = tuple((self._raw[n], a) for n, a in sources.items())
        self._told = tuple(self._raw[n] for n in told)
        self._biped, self._backend = biped, backend
        self._feet = [model.body(f"{side}_foot").id for side in ("left", "right")]
        self._mass = float(model.body_mass.sum())
        self._support: list[str] = []
        self._key_pose: list[tuple[int, int]] = []
        self._decisions: list[tuple[float, Decision, PanelMessage]] = []

    def add(self, time_s: float, target: Array, plan: Plan) -> None:
        """Record the robot as it is now, before it is told the target."""
        row = len(self._support)
        if row == len(self._told[0]):
            for column in self._raw.values():
                column.resize((2 * row, *column.shape[1:]), refcheck=False)
        for column, source in self._copies:
            column[row] = source
        times, targets, tilts, heights, contacts, estimates, zmps = self._told
        times[row], targets[row] = time_s, target
        tilts[row], heights[row] = self._backend.tilt, self._backend.sole_heights()
        contacts[row] = self._backend.self_contact
        estimate = getattr(plan, "estimate", None)
        estimates[row] = (
            _UNKNOWN if estimate is None else (estimate.roll, estimate.pitch)
        )
        planned_zmp = getattr(plan, "planned_zmp", None)
        zmps[row] = _UNKNOWN if planned_zmp is None else planned_zmp
        self._support.append("stand" if plan.standing else plan.support.value)
        self._note(time_s, plan.decision, plan.panel)

    def _note(
        self, time_s: float, decision: Decision | None, panel: PanelMessage | None
    ) -> None:
        if decision is None or panel is None:
            self._key_pose.append((0, STAND))
            return
        self._key_pose.append((decision.layer, decision.pose))
        if not self._decisions or self._decisions[-1][1] is not decision:
            self._decisions.append((time_s, decision, panel))

    def record(
        self,
        step_ticks: tuple[int, ...],
        fell_at_s: float | None,
        timing: Timing | None = None,
        events: tuple[tuple[float, str], ...] = (),
        commands: tuple[tuple[float, Command], ...] = (),
    ) -> WalkRecord:
        """Return what was recorded; see `WalkRecord` for the arguments."""
        rows, model = len(self._support), self._backend.model
        raw = {name: column[:rows].copy() for name, column in self._raw.items()}
        for name in _OF_FEET:
            raw[name] = raw[name][:, self._feet]
        support = np.array(self._support)
        return WalkRecord(
            **{name: raw[name] for name in _AS_COPIED},
            **columns(self._biped, self._mass, raw, support),
            joint_position=raw["qpos"][:, 7:].copy(),
            joint_velocity=raw["qvel"][:, 6:].copy(),
            estimated_tilt=raw["estimate"],
            self_contact=raw["self_contact"] > 0.0,
            support=support,
            key_pose=np.array(self._key_pose, dtype=np.int64),
            step_ticks=step_ticks,
            fell_at_s=fell_at_s,
            decisions=tuple(self._decisions),
            biped=self._biped,
            timing=timing,
            torque_limit=_limit(model.actuator_forcerange[:, 1]),
            speed_limit=_limit(model.actuator_dynprm[:, _SLEW]),
            events=events,
            commands=commands,
        )


def _limit(each: Array) -> Limit:
    """Return one limit where all joints have the same."""
    values = tuple(each.tolist())
    return values[0] if len(set(values)) == 1 else values
