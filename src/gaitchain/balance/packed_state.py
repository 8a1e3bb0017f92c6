"""A walk's numbers as one NumPy row, which machine code takes up in one go.

Of a named tuple Numba looks at every field at each call, which takes longer than the
tick itself; of a row it looks at the type alone. Compiled functions read the fields of
both alike.
"""

from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.compiled import compiled
from gaitchain.balance.gains import Gains
from gaitchain.balance.state import (
    Attitude,
    Foot,
    GaitState,
    Lean,
    Pelvis,
    Planar,
    StepTimes,
    View,
)
from gaitchain.gait.step_target import StepTarget

Row = NDArray[Any]
"""(1,) numbers of a walk; compiled functions read `row[0].gains` and so on."""


class _Fields(NamedTuple):
    gains: Gains
    times: StepTimes
    goal: StepTarget
    attitude: Attitude
    state: GaitState
    seen: View


def _row_type(kind: type) -> np.dtype[Any]:
    """Return the type of a named tuple of numbers, or of other such tuples."""
    fields = get_type_hints(kind).items()
    return np.dtype(
        [(n, _row_type(t) if hasattr(t, "_fields") else t) for n, t in fields]
    )


# One type for all rows: Numba knows it again by its identity.
_ROW = np.dtype((np.record, _row_type(_Fields)))


class WalkRow:
    """A walk's numbers, read and changed between ticks.

    Reading a part makes a named tuple of it, which takes a while; `phase`, `side`,
    `time` and `error` are there for what is asked in every period.
    """

    def __init__(self, gains: Gains, times: StepTimes) -> None:
        """Begin with all that changes at 0."""
        self.numbers: Row = np.zeros(1, _ROW)
        """(1,) what compiled functions take."""
        self.numbers["gains"], self.numbers["times"] = gains, times
        self._goal, self._attitude = self.numbers["goal"], self.numbers["attitude"]
        self._state, self._seen = self.numbers["state"], self.numbers["seen"]
        self._phase, self._time = self._state["phase"], self._state["time"]
        self._side, self._error = self._state["side"], self._state["error"]

    @property
    def phase(self) -> int:
        """Of the state."""
        phase: int = self._phase.item()
        return phase

    @property
    def side(self) -> float:
        """Of the state."""
        side: float = self._side.item()
        return side

    @property
    def time(self) -> float:
        """Of the state [s]."""
        time: float = self._time.item()
        return time

    @property
    def goal(self) -> StepTarget:
        """The chain's choice for this step."""
        return StepTarget(*self._goal.item())

    @goal.setter
    def goal(self, goal: StepTarget) -> None:
        self._goal[0] = goal

    @property
    def attitude(self) -> Attitude:
        """The trunk's orientation."""
        return Attitude(*self._attitude.item())

    @attitude.setter
    def attitude(self, attitude: Attitude) -> None:
        self._attitude[0] = attitude

    @property
    def error(self) -> Planar:
        """Of the state [m]."""
        return Planar(*self._error.item())

    @property
    def view(self) -> View:
        """What the latest tick saw."""
        com, yaw, tilt, swing, clearance = self._seen.item()
        return View(Pelvis(*com), yaw, Planar(*tilt), Foot(*swing), clearance)

    @property
    def state(self) -> GaitState:
        """Where the walk is."""
        phase, side, time, pelvis, yaw, *places = self._state.item()
        lift_off, landing, zmp, first_zmp, error, rate, holds, lean, *past = places
        return GaitState(
            phase,
            side,
            time,
            Pelvis(*pelvis),
            yaw,
            Foot(*lift_off),
            Foot(*landing),
            Planar(*zmp),
            Planar(*first_zmp),
            Planar(*error),
            rate,
            holds,
            Lean(*lean),
            *past,
        )

    @state.setter
    def state(self, state: GaitState) -> None:
        self._state[0] = state


@compiled
def state_in(row: GaitState) -> GaitState:
    """Take a state out of its part of a row."""
    return GaitState(
        row.phase,
        row.side,
        row.time,
        Pelvis(row.pelvis.x, row.pelvis.y, row.pelvis.vx, row.pelvis.vy),
        row.pelvis_yaw,
        Foot(row.lift_off.x, row.lift_off.y, row.lift_off.yaw),
        Foot(row.landing.x, row.landing.y, row.landing.yaw),
        Planar(row.zmp.x, row.zmp.y),
        Planar(row.first_zmp.x, row.first_zmp.y),
        Planar(row.error.x, row.error.y),
        row.rate,
        row.holds,
        Lean(row.lean.angle, row.lean.speed, row.lean.aim),
        row.worst,
        row.caution,
    )


@compiled
def attitude_in(row: Attitude) -> Attitude:
    """Take an attitude out of its part of a row."""
    return Attitude(
        row.roll, row.pitch, row.yaw, row.roll_rate, row.pitch_rate, row.yaw_rate
    )


@compiled
def put_attitude(row: Any, attitude: Attitude) -> None:
    """Write an attitude to its part of a row."""
    row.roll, row.pitch, row.yaw = attitude.roll, attitude.pitch, attitude.yaw
    row.roll_rate, row.pitch_rate = attitude.roll_rate, attitude.pitch_rate
    row.yaw_rate = attitude.yaw_rate


@compiled
def put_state(row: Any, state: GaitState) -> None:
    """Write a state to its part of a row."""
    row.phase, row.side, row.time = state.phase, state.side, state.time
    row.pelvis_yaw, row.rate = state.pelvis_yaw, state.rate
    row.worst, row.caution = state.worst, state.caution
    row.holds, lean = state.holds, state.lean
    row.lean.angle, row.lean.speed, row.lean.aim = lean.angle, lean.speed, lean.aim
    _put_pelvis(row.pelvis, state.pelvis)
    _put_foot(row.lift_off, state.lift_off)
    _put_foot(row.landing, state.landing)
    _put_planar(row.zmp, state.zmp)
    _put_planar(row.first_zmp, state.first_zmp)
    _put_planar(row.error, state.error)


@compiled
def put_view(row: Any, view: View) -> None:
    """Write a view to its part of a row."""
    row.foot_yaw, row.clearance = view.foot_yaw, view.clearance
    _put_pelvis(row.com, view.com)
    _put_planar(row.foot_tilt, view.foot_tilt)
    _put_foot(row.swing, view.swing)


@compiled
def _put_pelvis(row: Any, pelvis: Pelvis) -> None:
    row.x, row.y, row.vx, row.vy = pelvis.x, pelvis.y, pelvis.vx, pelvis.vy


@compiled
def _put_foot(row: Any, foot: Foot) -> None:
    row.x, row.y, row.yaw = foot.x, foot.y, foot.yaw


@compiled
def _put_planar(row: Any, planar: Planar) -> None:
    row.x, row.y = planar.x, planar.y
