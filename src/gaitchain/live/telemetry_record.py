"""From telemetry to a walk's record: what led to a fall in the loop, and is judged."""

import math
import re
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.recorder import Recorder, WalkSample
from gaitchain.errors import CommandError, RecordError
from gaitchain.gait.motion import Timing
from gaitchain.live.messages import UNPLANNED, Choice, Mode, Telemetry
from gaitchain.messages import Command, PanelMessage
from gaitchain.robot.robot import Robot
from gaitchain.walker.generator import Decision

LONGEST_S = 60.0
"""So much before a fall is looked at [s]."""
_FROM_OUTSIDE = ("push", "world")  # kinds of events that disturb the robot
_PLAIN = re.compile(r"\w+ to \w+")  # a change of mode without a reason, as to walk
_OF_SWING = ("sway", "outward")
_OF_MOVE = ("hip_x", "hip_height", "turn")


class _Rows:
    """What led up to now: at most the last minute, up to where torque went."""

    def __init__(self) -> None:
        self.kept: deque[Telemetry] = deque()
        self.powered = False
        """Whether the robot had torque in any of them."""
        self._powered_s = self._last_s = -math.inf

    def follows(self, t: Telemetry) -> bool:
        """Whether a row comes after these in the same run of the loop."""
        return t.time_s > self._last_s

    def take(self, t: Telemetry) -> None:
        """Take a row; one that was limp for long tells nothing, if it is no fall."""
        self._last_s = t.time_s
        if t.mode not in UNPLANNED:
            self.powered, self._powered_s = True, t.time_s
        limp_s = t.time_s - self._powered_s
        if self.powered and limp_s > LONGEST_S and not t.fell:
            return
        self.kept.append(t)
        until_s = self._powered_s if self.powered and not t.fell else t.time_s
        while self.kept[0].time_s < until_s - LONGEST_S:
            self.kept.popleft()


def before_fall(
    telemetries: Iterable[Telemetry], number: int | None = None
) -> tuple[Telemetry, ...]:
    """Return the rows that led to a fall, at most the last minute of them.

    They begin after the fall before, or where the loop was started again. A robot that
    fell is down until it has got up: an attempt that fails is no other fall.

    Args:
        telemetries: of a log, in order.
        number: of the fall, 1 for the first; the last one by default.

    Returns:
        The rows, the last one that of the fall. If the robot never fell, the last
        minute in which it had torque, and up to another one that it was limp.

    Raises:
        CommandError: there is no fall of this number.
    """
    rows, found = _Rows(), None
    falls, down = 0, False
    for t in telemetries:
        was_down, down = down, t.down
        if was_down and down:
            continue
        if was_down or not rows.follows(t):
            found = rows if rows.powered and not falls else found
            rows = _Rows()
        rows.take(t)
        if t.fell:
            falls, found = falls + 1, rows
            if falls == number:
                break
    if number is not None and falls != number:
        often = {0: "no fall", 1: "one fall"}.get(falls, f"{falls} falls")
        raise CommandError(f"--fall {number}: the log has {often}")
    if found is None or (rows.powered and not falls):
        found = rows
    return tuple(found.kept)


def record_of(
    robot: Robot,
    telemetries: Sequence[Telemetry],
    timing: Timing | None = None,
    since_s: float | None = None,
    gait: str = "",
) -> WalkRecord:
    """Build a walk's record from the loop's telemetry, up to a fall in its last row.

    It begins where the robot rose last: one that was limp, or was put back on its feet,
    was moved by others. Without a fall all since then is in it up to where the robot
    went limp. What stopped and reset it is noted.
    In simulation the rows with the simulator's truth count. Of a real robot all rows
    do, and what it did not measure is NaN; without the loads on its feet its support
    is "stand" throughout, so that no touch-down is judged.

    Args:
        robot: the robot.
        telemetries: of the loop, as `before_fall` gives them.
        timing: planned times of a step.
        since_s: of the loop's clock, the record's 0; the first row's by default [s].
        gait: name of the gait's family.

    Returns:
        The record.

    Raises:
        RecordError: there are fewer than two rows before the fall in which the robot
            had torque, they are of another robot, or their times do not rise.
    """
    fall = next((t for t in telemetries[-1:] if t.fell), None)
    before = telemetries[: None if fall is None else -1]
    rows = _last_powered_run([t for t in before if t.truth is not None] or before)
    _check(robot, rows)
    zero_s = rows[0].time_s if since_s is None else since_s
    recorder = Recorder(robot, gait=gait)
    for t in rows:
        recorder.add(_sample_of(t, zero_s))
    record = recorder.record(
        step_ticks=_step_ticks(rows),
        fell_at_s=None if fall is None else fall.time_s - zero_s,
        timing=timing,
        events=_events(telemetries, _FROM_OUTSIDE, zero_s),
        commands=_commands(rows, zero_s),
    )
    noted = _events(before, ("mode",), zero_s)
    notes = tuple(note for note in noted if not _PLAIN.fullmatch(note[1]))
    return replace(record, notes=notes)


def _events(
    rows: Sequence[Telemetry], kinds: Sequence[str], zero_s: float
) -> tuple[tuple[float, str], ...]:
    return tuple(
        (event.time_s - zero_s, event.text)
        for t in rows
        for event in t.events
        if event.kind in kinds
    )


def _last_powered_run(rows: Sequence[Telemetry]) -> list[Telemetry]:
    """Return the last rows with torque, since the robot rose.

    Of the last few periods of a log, too few for a record, nothing could be said.
    """
    runs: list[list[Telemetry]] = [[]]
    before = Mode.OFF
    for t in rows:
        rose = t.mode is Mode.RISING and before is not Mode.RISING
        if t.mode not in UNPLANNED:
            if rose or before in UNPLANNED:
                runs.append([])
            runs[-1].append(t)
        before = t.mode
    return next((run for run in reversed(runs) if len(run) > 1), runs[-1])


def _sample_of(t: Telemetry, zero_s: float) -> WalkSample:
    decision, panel = (None, None) if t.choice is None else decision_of(t.choice)
    return WalkSample(
        time_s=t.time_s - zero_s,
        target=t.joint_target,
        joint_position=t.joint_position,
        joint_velocity=t.joint_velocity,
        torque=t.joint_torque,
        estimated_tilt=t.estimated_tilt,
        planned_zmp=t.planned_zmp,
        support=t.support,
        decision=decision,
        panel=panel,
        truth=t.truth,
    )


def _check(robot: Robot, rows: Sequence[Telemetry]) -> None:
    if len(rows) < 2:
        few = "one row alone" if rows else "no row"
        raise RecordError(f"{few} with the torque on; nothing to explain")
    joints = len(robot.legs.joint_names)
    for t in rows:
        arrays = t.joint_position, t.joint_velocity, t.joint_target, t.joint_torque
        for count in map(len, arrays):
            if count != joints:
                raise RecordError(
                    f"telemetry of {count} joints; {robot.name} has {joints}: give "
                    "that of the robot that sent it"
                )
    for one, other in pairwise(rows):
        if not other.time_s > one.time_s:
            raise RecordError(
                f"telemetry at {other.time_s:g} s comes after {one.time_s:g} s; give "
                "the rows of one run of the loop, in order"
            )


def _step_ticks(rows: Sequence[Telemetry]) -> tuple[int, ...]:
    steps = [t.steps for t in rows]
    begun = [row for row, (a, b) in enumerate(pairwise(steps), start=1) if b > a]
    return (*begun, len(rows))


def _commands(
    rows: Sequence[Telemetry], zero_s: float
) -> tuple[tuple[float, Command], ...]:
    return tuple(
        (next(same).time_s - zero_s, Command(*asked))
        for asked, same in groupby(rows, lambda t: (*t.command, t.crouch))
    )


def decision_of(choice: Choice) -> tuple[Decision, PanelMessage]:
    """Return a choice as the walker had it; what telemetry does not carry is NaN."""
    parts = choice.primitives
    decision = Decision(
        choice.layer,
        choice.pose,
        choice.cost,
        choice.runners_up,
        choice.target,
        math.nan,
        choice.sizes,
        choice.ends,
        choice.expected,
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
