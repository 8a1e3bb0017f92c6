"""From telemetry to a walk's record: what is judged when a robot fell in the loop."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.record_columns import columns
from gaitchain.errors import RecordError
from gaitchain.gait.family import STAND
from gaitchain.gait.motion import Timing
from gaitchain.live.messages import Choice, Mode, Telemetry, Truth
from gaitchain.messages import Array, Command, PanelMessage
from gaitchain.robot.box_robot import anatomy_of
from gaitchain.robot.reduced_biped import Biped
from gaitchain.walker.generator import Decision

_FELL = "fell"  # how the reason of a stop begins after a fall
_BASE = 7  # generalised positions of the trunk
_OF_SWING = ("sway", "outward")
_OF_MOVE = ("hip_x", "hip_height", "turn")
_OF_FEET = {"place": (2, 3), "turn": (2, 9), "wrench": (2, 6), "twist": (2, 6)}


def fell(telemetry: Telemetry) -> bool:
    """Whether the loop stopped because the robot fell."""
    return telemetry.mode == Mode.STOPPED and telemetry.reason.startswith(_FELL)


def record_of(
    biped: Biped,
    telemetries: Iterable[Telemetry],
    timing: Timing | None = None,
    since_s: float | None = None,
) -> WalkRecord:
    """Put a walk's record together from the loop's telemetry, up to the last fall.

    It begins after the fall before that, if there is one; without a fall all is in it.
    In simulation the rows with the simulator's truth count. Of a real robot all rows
    do, and what it did not measure is NaN; without the loads on its feet its support
    is "stand" throughout, so that no touch-down is judged.

    Args:
        biped: the robot.
        telemetries: of the loop, in order.
        timing: planned times of a step.
        since_s: of the loop's clock, the record's 0; the first row's by default [s].

    Returns:
        The record.

    Raises:
        RecordError: there are fewer than two rows before the fall, they are of another
            robot, or their times do not rise.
    """
    told, fall = _up_to_fall(list(telemetries))
    walked = told[: None if fall is None else -1]
    rows = [t for t in walked if t.truth is not None] or walked
    _check(biped, rows)
    zero_s = rows[0].time_s if since_s is None else since_s
    return WalkRecord(
        **_told(rows, zero_s),
        **_measured(biped, rows),
        step_ticks=_step_ticks(rows),
        fell_at_s=None if fall is None else fall.time_s - zero_s,
        decisions=_decisions(rows, zero_s),
        biped=biped,
        timing=timing,
        events=tuple(
            (event.time_s - zero_s, event.text)
            for t in told
            for event in t.events
            if event.kind == "push"
        ),
        commands=_commands(rows, zero_s),
    )


def feet_rows(rows: Sequence[Telemetry]) -> dict[str, Array]:
    """Return what `record_columns.columns` needs of rows that have their truth."""
    truths = [t.truth for t in rows]
    return {
        "time_s": np.array([t.time_s for t in rows]),
        "planned_zmp": np.array([t.planned_zmp for t in rows]),
        "com": _stacked(truths, "com"),
        **{name: _stacked(truths, name, shape) for name, shape in _OF_FEET.items()},
    }


def _up_to_fall(
    told: list[Telemetry],
) -> tuple[list[Telemetry], Telemetry | None]:
    """Return the rows from one fall to the next, the last one's row, and that row."""
    down = [fell(t) for t in told]
    falls = [i for i, (was, now) in enumerate(pairwise([False, *down])) if now > was]
    if not falls:
        return told, None
    end = falls[-1]
    begin = next((i + 1 for i in range(end - 1, -1, -1) if down[i]), 0)
    return told[begin : end + 1], told[end]


def _check(biped: Biped, rows: Sequence[Telemetry]) -> None:
    if len(rows) < 2:
        raise RecordError(f"telemetry of {len(rows)} rows up to a fall; give 2 or more")
    joints = len(anatomy_of(biped).joint_names)
    for t in rows:
        if len(t.joint_position) != joints:
            raise RecordError(
                f"telemetry of {len(t.joint_position)} joints; {biped.name} has "
                f"{joints}: give that of the robot that sent it"
            )
    for one, other in pairwise(rows):
        if not other.time_s > one.time_s:
            raise RecordError(
                f"telemetry at {other.time_s:g} s comes after {one.time_s:g} s; give "
                "the rows of one run of the loop, in order"
            )


def _told(rows: Sequence[Telemetry], zero_s: float) -> dict[str, Any]:
    """Return the columns that the loop itself tells."""
    return {
        "time_s": np.array([t.time_s for t in rows]) - zero_s,
        "target": np.array([t.joint_target for t in rows]),
        "joint_position": np.array([t.joint_position for t in rows]),
        "joint_velocity": np.array([t.joint_velocity for t in rows]),
        "torque": np.array([t.joint_torque for t in rows]),
        "estimated_tilt": np.array([t.estimated_tilt for t in rows]),
        "key_pose": np.array(
            [
                (0, STAND) if t.choice is None else (t.choice.layer, t.choice.pose)
                for t in rows
            ],
            dtype=np.int64,
        ),
    }


def _measured(biped: Biped, rows: Sequence[Telemetry]) -> dict[str, Any]:
    """Return the columns that only a simulator knows; NaN where there was none."""
    if rows[0].truth is None:
        return _unmeasured(rows)
    truths, support = [t.truth for t in rows], np.array([t.support for t in rows])
    return {
        **columns(biped, anatomy_of(biped).mass, feet_rows(rows), support),
        "qpos": _stacked(truths, "qpos"),
        "tilt": _stacked(truths, "tilt"),
        "foot_height": _stacked(truths, "foot_height"),
        "self_contact": np.array([t is not None and t.self_contact for t in truths]),
        "support": support,
    }


def _unmeasured(rows: Sequence[Telemetry]) -> dict[str, Any]:
    count = len(rows)

    def unknown(*shape: int) -> Array:
        return np.full((count, *shape), math.nan)

    base = unknown(_BASE)
    return {
        "qpos": np.hstack([base, [t.joint_position for t in rows]]),
        "zmp": unknown(2),
        "planned_zmp": unknown(2),
        "feet": unknown(2, 3),
        "soles": unknown(2, 4, 2),
        "foot_load": unknown(2),
        "foot_height": unknown(2),
        "foot_speed": unknown(2),
        "touch_down": np.zeros((count, 2), dtype=np.bool_),
        "tilt": unknown(2),
        "self_contact": np.zeros(count, dtype=np.bool_),
        "support": np.full(count, "stand"),
    }


def _stacked(
    truths: Sequence[Truth | None], name: str, shape: tuple[int, ...] = (-1,)
) -> Array:
    values = np.array([getattr(truth, name) for truth in truths], dtype=np.float64)
    return values.reshape(len(truths), *shape)


def _step_ticks(rows: Sequence[Telemetry]) -> tuple[int, ...]:
    begun = [
        row for row in range(1, len(rows)) if rows[row].steps > rows[row - 1].steps
    ]
    return (*begun, len(rows))


def _commands(
    rows: Sequence[Telemetry], zero_s: float
) -> tuple[tuple[float, Command], ...]:
    found: list[tuple[float, Command]] = []
    for t in rows:
        command = Command(*t.command)
        if not found or found[-1][1] != command:
            found.append((t.time_s - zero_s, command))
    return tuple(found)


def _decisions(
    rows: Sequence[Telemetry], zero_s: float
) -> tuple[tuple[float, Decision, PanelMessage], ...]:
    found, last = [], None
    for t in rows:
        choice = t.choice
        if choice is not None and _key(choice) != last:
            found.append((t.time_s - zero_s, *_as_decided(choice)))
        last = None if choice is None else _key(choice)
    return tuple(found)


def _key(choice: Choice) -> tuple[object, ...]:
    # Without its costs, which may be NaN: then a choice would differ from itself.
    return choice.layer, choice.pose, choice.target, choice.left_support


def _as_decided(choice: Choice) -> tuple[Decision, PanelMessage]:
    """Return a choice as the walker had it; what telemetry does not tell is NaN."""
    parts = choice.primitives
    decision = Decision(
        choice.layer,
        choice.pose,
        choice.cost,
        choice.runners_up,
        choice.target,
        math.nan,
    )
    panel = PanelMessage(
        key_moment=choice.key_moment,
        left_support=choice.left_support,
        duration_s=math.nan,
        swing={n: x for n, x in parts.items() if n in _OF_SWING},
        lift={n: x for n, x in parts.items() if n not in _OF_SWING + _OF_MOVE},
        move={n: x for n, x in parts.items() if n in _OF_MOVE},
        frontal={},
        sagittal={},
    )
    return decision, panel
