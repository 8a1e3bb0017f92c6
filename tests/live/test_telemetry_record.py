"""From telemetry to a record: against the recorder's own, and of falls in the loop."""

import dataclasses
import math
from dataclasses import fields

import numpy as np
import pytest
from msgspec.structs import replace
from planned_library import planned_library
from telemetry_factory import FALLEN, GIVEN_UP, event, seen, told, walked

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.record_file import load_record, save_record
from gaitchain.analysis.recorder import Recorder, observe
from gaitchain.analysis.rules import Rule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import RecordError
from gaitchain.gait.motion import Timing
from gaitchain.live.messages import Choice, Mode, TroubleKind
from gaitchain.live.telemetry_record import before_fall, record_of
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
BEGAN_S = 7.0


def begin(speed=0.3):
    """A walker that has just been told to walk."""
    walker, backend = Walker(planned_library(RES)), MujocoBackend(RES)
    backend.connect(walker.stand)
    for _ in range(100):
        backend.write(walker.step(backend.read()).position)
    walker.command(Command(speed))
    return walker, backend


@pytest.fixture(scope="module")
def both():
    """A walk as telemetry, and as the recorder has it."""
    walker, backend = begin()
    recorder, rows, step_ticks = Recorder(RES, backend), [], []
    for tick in range(300):
        target = walker.step(backend.read()).position
        recorder.add(observe(0.01 * tick, target, walker.gait, backend))
        rows.append(
            seen(
                walker, backend, BEGAN_S + 0.01 * tick, target, steps=walker.gait.steps
            )
        )
        if walker.gait.steps > len(step_ticks):
            step_ticks.append(tick)
        backend.write(target)
    timing = walker.library.timing
    record = recorder.record((*step_ticks, 300), None, timing)
    return rows, record, timing


def test_telemetry_makes_the_record_that_the_recorder_makes(both):
    rows, record, timing = both
    same = record_of(RES, rows, timing)
    for field in fields(record):
        one, other = getattr(record, field.name), getattr(same, field.name)
        if not isinstance(one, np.ndarray):
            continue
        assert one.dtype.kind == other.dtype.kind, field.name
        if one.dtype.kind == "U":
            assert list(one) == list(other)
        else:
            np.testing.assert_allclose(other, one, atol=1e-9, err_msg=field.name)
    assert same.step_ticks == record.step_ticks
    assert same.timing == timing
    assert same.fell_at_s is None
    assert len(same.decisions) == len(record.decisions) > 10
    for (t, one, panel), (s, other, shown) in zip(
        record.decisions, same.decisions, strict=True
    ):
        assert s == pytest.approx(t)
        assert (one.layer, one.pose, one.target) == (
            other.layer,
            other.pose,
            other.target,
        )
        assert (one.cost, one.runners_up) == (other.cost, other.runners_up)
        assert (panel.key_moment, panel.left_support) == (
            shown.key_moment,
            shown.left_support,
        )
        assert (panel.swing, panel.lift, panel.move) == (
            shown.swing,
            shown.lift,
            shown.move,
        )


def test_a_record_of_telemetry_can_be_kept_as_a_file(both, tmp_path):
    rows, _, timing = both
    record = dataclasses.replace(record_of(RES, rows, timing), notes=((1.0, "reset"),))
    save_record(record, tmp_path / "walk.rec")
    again = load_record(tmp_path / "walk.rec")
    np.testing.assert_array_equal(again.qpos, record.qpos)
    assert again.commands == record.commands
    assert again.notes == record.notes


def test_rows_between_those_with_truth_are_left_out(both):
    rows, whole, _ = both
    thin = [r if i % 3 == 0 else replace(r, truth=None) for i, r in enumerate(rows)]
    record = record_of(RES, thin)
    np.testing.assert_array_equal(record.qpos, whole.qpos[::3])
    # 50 ms in the air are two rows then, and not five.
    late = np.flatnonzero(whole.touch_down.any(axis=1)) / 3
    found = np.flatnonzero(record.touch_down.any(axis=1))
    assert len(found) == len(late) > 0
    assert np.abs(found - late).max() <= 1


def test_time_may_count_from_when_the_log_began(both):
    rows, _, _ = both
    assert record_of(RES, rows).time_s[0] == 0.0
    assert record_of(RES, rows, since_s=5.0).time_s[0] == pytest.approx(2.0)


@pytest.fixture(scope="module")
def fallen():
    """A push that throws the robot over, as the loop tells of it."""
    walker, backend = begin()
    rows = []
    for row in walked(walker, backend, 600, began_s=BEGAN_S):
        rows.append(row)
        if len(rows) == 151:
            backend.push(40.0, 90.0)
            push = event(row.time_s, "push", "a push of 40 N s to 90 deg")
            rows[-1] = replace(row, events=(push,))
    assert rows[-1].mode == Mode.STOPPED
    return rows


def test_a_fall_is_explained_as_that_of_a_walk(fallen):
    record = record_of(RES, fallen, planned_library(RES).timing)
    assert record.fell_at_s == pytest.approx(fallen[-1].time_s - BEGAN_S)
    assert record.time_s[-1] < record.fell_at_s  # a record ends at the fall
    assert record.events == ((pytest.approx(1.5), "a push of 40 N s to 90 deg"),)
    why = explain(RES, record)
    assert why.cause is not None
    assert why.cause.time_s >= 1.5
    assert "after a push of 40 N s to 90 deg" in why.sentence
    assert f"fell at {record.fell_at_s:.2f} s" in why.sentence


def test_the_last_fall_counts_and_nothing_before_or_after_it(fallen):
    """Rows of a robot that lies there are neither."""
    first = record_of(RES, fallen)
    lying = [replace(fallen[-1], time_s=50.0 + i) for i in range(3)]
    again = [replace(row, time_s=row.time_s + 100.0) for row in fallen]
    up = [replace(row, time_s=row.time_s + 200.0) for row in fallen[:50]]
    record = record_of(RES, before_fall([*fallen, *lying, *again, *up]))
    assert record.fell_at_s == pytest.approx(first.fell_at_s)
    np.testing.assert_allclose(record.time_s, first.time_s, atol=1e-9)
    np.testing.assert_array_equal(record.qpos, first.qpos)
    assert len(record.events) == 1
    lies = record_of(RES, before_fall([*fallen, *lying]))
    assert lies.fell_at_s == first.fell_at_s


def test_a_get_up_that_fails_belongs_to_no_record(fallen):
    """Neither as a fall, nor as what led to the one after it."""
    first = record_of(RES, fallen)
    up = [told(RES, 50.0 + 0.1 * i, mode=Mode.GETTING_UP) for i in range(20)]
    given_up = told(RES, 53.0, **GIVEN_UP)
    again = [replace(row, time_s=row.time_s + 100.0) for row in fallen]
    for rows in ([*fallen, *up, given_up], [*fallen, *up, *again], [*up, *again]):
        record = record_of(RES, before_fall(rows))
        assert record.fell_at_s == pytest.approx(first.fell_at_s)
        np.testing.assert_array_equal(record.qpos, first.qpos)
    with pytest.raises(RecordError, match="no row with the torque on; nothing to"):
        record_of(RES, up)


def test_a_robot_without_torque_is_not_judged_and_what_stopped_it_is_noted():
    """Limp it goes down, and a reset puts it back on its feet."""
    stop = TroubleKind.EMERGENCY_STOP
    limp = {"mode": Mode.STOPPED, "trouble": stop, "estimated_tilt": (1.0, 0.0)}
    lies = tuple(angle + 1.0 for angle in RES.legs.stand)
    modes = [Mode.WALKING] * 50 + [None] * 100 + [Mode.RISING] * 50
    modes += [Mode.STANDING] * 100
    rows = [
        told(RES, 0.01 * i, mode=mode)
        if mode
        else told(RES, 0.01 * i, joint_position=lies, **limp)
        for i, mode in enumerate(modes)
    ]
    said = {
        0: "standing to walking",
        50: "walking to stopped: emergency stop by rest",
        150: "reset by rest",
        200: "rising to standing",
    }
    for i, text in said.items():
        rows[i] = replace(rows[i], events=(event(0.01 * i, "mode", text),))
    record = record_of(RES, rows, since_s=0.0)
    assert (record.time_s[0], record.time_s[-1]) == pytest.approx((1.5, 2.99))
    assert record.notes == ((0.5, said[50]), (1.5, said[150]))
    assert record.events == ()
    why = explain(RES, record)
    assert (why.findings, why.notes) == ((), record.notes)
    assert record_of(RES, rows[:140]).time_s[-1] == pytest.approx(0.49)
    safe = [replace(t, mode=Mode.SAFE) for t in rows[:50]]  # of which a reset is, too
    anew = [replace(t, time_s=t.time_s + 1.0) for t in rows[150:]]
    assert len(record_of(RES, [*safe, *anew]).time_s) == 150


@pytest.mark.parametrize("mode", [Mode.STOPPED, Mode.SAFE])
def test_an_emergency_stop_is_no_fall(both, mode):
    rows, _, _ = both
    stop = TroubleKind.EMERGENCY_STOP
    stopped = replace(rows[-1], time_s=20.0, mode=mode, reason="fell", trouble=stop)
    assert record_of(RES, [*rows, stopped]).fell_at_s is None
    rising = replace(stopped, mode=Mode.RISING, trouble=TroubleKind.FALL)
    assert record_of(RES, [*rows, rising]).fell_at_s is None


def test_commands_are_noted_when_they_change(both):
    rows, _, _ = both
    asked = [
        replace(row, command=((0.1, 0.0, 0.0) if 100 <= i < 200 else (0.0, 0.0, 0.0)))
        for i, row in enumerate(rows)
    ]
    times, commands = zip(*record_of(RES, asked).commands, strict=True)
    assert times == pytest.approx((0.0, 1.0, 2.0))
    assert commands == (Command(), Command(0.1), Command())


def test_a_choice_whose_cost_is_unknown_is_one_choice(both):
    rows, _, _ = both
    choice = Choice("kp_2", 1, 2, 3, math.nan, ((4, math.nan),), True, {"sway": 0.1})
    again = Choice("kp_2", 1, 2, 3, math.nan, ((4, math.nan),), True, {"sway": 0.1})
    two = [replace(rows[0], choice=choice), replace(rows[1], choice=again)]
    record = record_of(RES, two)
    assert len(record.decisions) == 1
    assert record.decisions[0][2].swing == {"sway": 0.1}
    np.testing.assert_array_equal(record.key_pose, [[1, 2], [1, 2]])


def real():
    """Rows of a robot that measures its joints alone, and by plan walks."""
    supports = ("ls", "lr", "rs", "rl")
    plans = [supports[i // 30 % 4] for i in range(300)]
    tilt = 0.5, 0.5
    return [
        told(RES, 0.01 * i, mode=Mode.WALKING, support=plan, estimated_tilt=tilt)
        for i, plan in enumerate(plans)
    ]


def test_of_a_real_robot_what_was_not_measured_breaks_no_rule():
    record = record_of(RES, real(), Timing(0.6, 0.15, 0.15))
    for name in ("zmp", "feet", "soles", "foot_load", "tilt", "torque"):
        assert np.isnan(getattr(record, name)).all(), name
    assert np.isnan(record.qpos[:, :7]).all()
    np.testing.assert_array_equal(record.qpos[:, 7:], record.joint_position)
    assert explain(RES, record).findings == ()


def test_of_a_real_robot_speeds_are_judged_and_torques_if_they_are_measured():
    rows = real()
    fast, heavy = [0.0] * 12, [0.0] * 12
    fast[3], heavy[4] = (
        1.1 * RES.reduced.joint_speed_limit,
        RES.reduced.joint_torque_limit,
    )
    for i in range(100, 150):
        rows[i] = replace(rows[i], joint_velocity=tuple(fast))
    found = explain(RES, record_of(RES, rows)).findings
    assert [(f.rule, f.joint) for f in found] == [(Rule.SPEED, "left_knee")]
    measured = [replace(r, joint_load=(0.0,) * 12) for r in rows]
    lag = list(measured[0].joint_position)
    lag[0] += 0.2
    for i in range(200, 290):
        load = tuple(heavy)
        measured[i] = replace(measured[i], joint_load=load, joint_position=tuple(lag))
    fall = replace(rows[-1], time_s=3.0, **FALLEN)
    why = explain(RES, record_of(RES, [*measured, fall]))
    assert {f.rule for f in why.findings} == {Rule.SPEED, Rule.TORQUE, Rule.TRACKING}
    assert why.cause.rule is Rule.TORQUE


def test_too_few_rows_and_rows_of_another_robot_are_refused(both):
    rows, _, _ = both
    for few, many in (
        ([], "no row"),
        (rows[:1], "one row alone"),
        ([replace(rows[0], **FALLEN)], "no row"),
    ):
        with pytest.raises(RecordError, match=f"^{many} with the torque on; nothing"):
            record_of(RES, few)
    bare = [replace(row, truth=None) for row in rows[1:]]
    with pytest.raises(RecordError, match="one row alone"):  # of those with their truth
        record_of(RES, [rows[0], *bare])
    with pytest.raises(RecordError, match="of 3 joints; Robo-Erectus Senior has 12"):
        record_of(RES, [replace(r, joint_position=(0.0,) * 3) for r in rows])
    with pytest.raises(RecordError, match="comes after"):
        record_of(RES, [*rows, *rows])
