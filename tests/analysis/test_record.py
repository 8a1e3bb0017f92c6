"""The record of a walk: its columns against the simulator's own words, and its file."""

import json
import math
from dataclasses import fields
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save
from standing_record import record as by_hand

from gaitchain.analysis.record_file import load_record, save_record
from gaitchain.analysis.recorder import Recorder, observe
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import GaitchainError, RecordError
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import Segment
from gaitchain.gait.zmp import Support
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
BIPED = RES.reduced
SCHEDULE = (Segment(Command(0.04), steps=1), Segment(Command(0.05), steps=1))
# Everything that can be told of a walk at once: a rough world with a push.
ROUGH = World(
    slope_deg=2.0, blocks_m=0.003, torque_limit=0.9, push=(Push(2.0, -90.0, at_s=0.5),)
)


@pytest.fixture(scope="module")
def walked(library):
    backend = MujocoBackend(library.robot, ROUGH)
    return run_schedule(Walker(library, feedback=False), backend, SCHEDULE)


def arrays(record):
    values = {f.name: getattr(record, f.name) for f in fields(record)}
    return {n: v for n, v in values.items() if isinstance(v, np.ndarray)}


def test_every_column_has_a_row_per_tick(walked):
    rows = 2 * 300 + 100
    assert {len(column) for column in arrays(walked).values()} == {rows}
    np.testing.assert_allclose(np.diff(walked.time_s), CONTROL_PERIOD_S)
    assert walked.robot == RES
    assert walked.timing == Timing()
    assert walked.torque_limit == pytest.approx(0.9 * BIPED.joint_torque_limit)
    assert walked.speed_limit == pytest.approx(BIPED.joint_speed_limit)
    assert walked.events == ((0.5, "a push of 2 N s to -90 deg"),)
    for name in ("estimated_tilt", "planned_zmp"):  # open loop
        assert np.isnan(getattr(walked, name)).all()
    assert walked.decisions[0][0] == 0.0


def foot_speed(backend, side):
    """Horizontal speed of the sole's centre, by MuJoCo's own function."""
    sole, velocity = backend.model.geom(f"{side}_foot_box"), np.empty(6)
    geom = mujoco.mjtObj.mjOBJ_GEOM
    mujoco.mj_objectVelocity(backend.model, backend.data, geom, sole.id, velocity, 0)
    turn = backend.data.geom_xmat[sole.id].reshape(3, 3)
    arm = turn @ [0.0, 0.0, -0.5 * BIPED.ankle_height]
    return np.linalg.norm((velocity[3:] + np.cross(velocity[:3], arm))[:2])


def test_columns_say_what_the_simulator_says(library):
    """The columns that are worked out against the backend's own functions."""
    backend, walker = MujocoBackend(RES, ROUGH), Walker(library, feedback=False)
    recorder, said = Recorder(RES, backend), []
    backend.connect(walker.stand)
    rng = np.random.default_rng(0)
    for tick in range(150):
        target = walker.stand + rng.normal(0.0, 0.1, 12)
        recorder.add(observe(tick * CONTROL_PERIOD_S, target, walker.gait, backend))
        said.append(
            {
                "target": target,
                "joint_position": backend.data.qpos[7:].copy(),
                "joint_velocity": backend.data.qvel[6:].copy(),
                "torque": backend.data.actuator_force.copy(),
                "qpos": backend.data.qpos.copy(),
                "zmp": backend.zmp(),
                "feet": np.column_stack(
                    [backend.foot_positions()[:, :2], backend.foot_yaws()]
                ),
                "foot_load": backend.foot_loads(),
                "foot_height": backend.sole_heights(),
                "foot_speed": [foot_speed(backend, s) for s in ("left", "right")],
                "tilt": backend.tilt,
                "self_contact": backend.self_contact,
            }
        )
        backend.write(target)
    record = recorder.record((0, 150), None)
    assert record.foot_speed.max() > 0.05
    for name in said[0]:
        expected = np.array([tick[name] for tick in said])
        np.testing.assert_allclose(getattr(record, name), expected, atol=1e-9)


def test_soles_lie_where_the_feet_do(walked):
    centre = walked.soles.mean(axis=2)
    yaw = walked.feet[..., 2]
    ahead = BIPED.sole_offset * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    # A foot that is not level has its sole's centre a little off.
    assert np.abs(centre - walked.feet[..., :2] - ahead).max() < 0.02
    sides = np.linalg.norm(np.diff(walked.soles, axis=2), axis=-1)
    np.testing.assert_allclose(sides[0, 0], [0.22, 0.13, 0.22], atol=1e-4)


def test_touch_down_is_where_a_foot_comes_back(walked):
    low = 0.02 * BIPED.mass * 9.81
    rows, feet = np.nonzero(walked.touch_down)
    assert len(rows)
    for row, foot in zip(rows, feet, strict=True):
        assert walked.foot_load[row, foot] > 0.9 * low
        assert (walked.foot_load[row - 5 : row, foot] < 1.1 * low).all()


@pytest.mark.parametrize("support", [None, *Support])
def test_what_the_walker_believes_and_plans(support):
    """Its ZMP is in the frame of the support foot, left leg as support."""
    backend = MujocoBackend(RES)
    recorder = Recorder(RES, backend)
    backend.connect(np.zeros(12))
    plan = SimpleNamespace(
        standing=support is None,
        support=support,
        decision=None,
        panel=None,
        estimate=SimpleNamespace(roll=0.1, pitch=-0.2, yaw=0.3),
        planned_zmp=np.array([0.03, -0.05]),
    )
    recorder.add(observe(0.0, np.zeros(12), plan, backend))
    plan.estimate = plan.planned_zmp = None
    recorder.add(observe(0.01, np.zeros(12), plan, backend))
    record = recorder.record((0, 2), None)
    assert list(record.support) == ["stand" if support is None else support.value] * 2
    np.testing.assert_array_equal(record.estimated_tilt[0], [0.1, -0.2])
    left = support is None or support.value.startswith("l")
    foot = record.feet[0, 0 if left else 1]
    ahead = (0.03 - 0.05j if left else 0.03 + 0.05j) * np.exp(1j * foot[2])
    moved = record.planned_zmp[0] - foot[:2]
    np.testing.assert_allclose(moved, [ahead.real, ahead.imag])
    assert np.isnan(record.estimated_tilt[1]).all()
    assert np.isnan(record.planned_zmp[1]).all()


def test_a_record_stays_when_more_rows_come():
    backend = MujocoBackend(RES)
    backend.connect(np.zeros(12))
    plan = SimpleNamespace(
        standing=True, decision=None, panel=None, estimate=None, planned_zmp=None
    )
    recorder = Recorder(RES, backend)
    for tick in range(9):
        recorder.add(observe(0.01 * tick, np.full(12, tick), plan, backend))
    first = recorder.record((0, 9), None)
    before = first.target.copy()
    recorder.add(observe(0.09, np.full(12, 9.0), plan, backend))
    np.testing.assert_array_equal(first.target, before)
    np.testing.assert_array_equal(before[:, 0], np.arange(9))
    assert len(recorder.record((0, 10), None).time_s) == 10


def assert_same(one, other):
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b)
            assert a.dtype.kind == b.dtype.kind
        else:
            assert a == b, field.name


def test_a_file_gives_the_record_back(walked, tmp_path):
    path = tmp_path / "new" / "walk.rec"
    size = save_record(walked, path)
    assert size == path.stat().st_size
    again = load_record(path)
    assert_same(walked, again)
    save_record(again, tmp_path / "again.rec")
    assert path.read_bytes() == (tmp_path / "again.rec").read_bytes()


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"fell_at_s": 0.05},
        {"events": ((0.01, "a push"), (0.02, "another"))},
        {"speed_limit": math.inf, "torque_limit": 3.0},
        {"torque_limit": (*[3.0] * 11, math.inf)},
        {"fell_at_s": 0.05, "step_ticks": (0, 300, 600)},
        {"robot": RES, "timing": Timing(1.0, 0.2, 0.4)},
        {"support": np.array(["ls", "lr", "rs", "rl", "stand"])},
        {"zmp": np.full((5, 2), math.nan)},
    ],
)
def test_records_by_hand_come_back_too(changes, tmp_path):
    record = by_hand(np.zeros(5), **changes)
    save_record(record, tmp_path / "walk.rec")
    assert_same(record, load_record(tmp_path / "walk.rec"))


def refuse(path, words):
    with pytest.raises(RecordError, match=words) as caught:
        load_record(path)
    assert isinstance(caught.value, GaitchainError)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_record_are_refused(tmp_path):
    refuse(tmp_path / "none.rec", "No such file")
    refuse(tmp_path, "Is a directory")
    path = tmp_path / "walk.rec"
    for data in (b"", b"{}", b"hello, world", b"\x00" * 100, b"\xff" * 100):
        path.write_bytes(data)
        refuse(path, "damaged, or not the record of a walk")
    path.write_bytes(save({"a": np.zeros(3)}))
    refuse(path, "not the record of a walk")
    path.write_bytes(save({"a": np.zeros(3)}, {"gaitchain": "[1]"}))
    refuse(path, "its header is no table")
    path.write_bytes(save({"a": np.zeros(3)}, {"gaitchain": '{"schema": 9}'}))
    refuse(path, "record schema 9, this version reads 1")
    with pytest.raises(RecordError, match="cannot be written"):
        save_record(by_hand(np.zeros(3)), tmp_path)


@pytest.fixture
def parts(tmp_path):
    """The arrays and the header of a file, and how to write them again."""
    path = tmp_path / "walk.rec"
    record = by_hand(np.zeros(5), robot=RES, timing=Timing(), events=((0.01, "a"),))
    save_record(record, path)
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["gaitchain"])

    def write(arrays, header):
        path.write_bytes(save(arrays, {"gaitchain": json.dumps(header)}))
        return path

    return load(data), header, write


def cut(shape, last, kind=np.float64):
    """A column without measurements, but for the last of its numbers."""
    column = np.full(shape, math.nan, kind)
    column.flat[-1] = last
    return column


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"zmp": None}, "columns missing: zmp"),
        ({"other": np.zeros(5)}, "columns unknown: other"),
        ({"zmp": np.zeros((4, 2))}, "zmp is float64"),
        ({"zmp": np.zeros((5, 3))}, "zmp is float64"),
        ({"zmp": np.zeros((5, 2), dtype=np.int64)}, "zmp is int64"),
        ({"self_contact": np.zeros(5)}, "self_contact is float64"),
        ({"support": np.full(5, 9, dtype=np.uint8)}, "inconsistent"),
        ({"time_s": np.full(5, math.nan)}, "a time is no number"),
        ({"time_s": np.array([0.0, 0.1, 0.2, math.inf, 0.4])}, "inf in row 3, at most"),
        (
            {"time_s": np.array([0.0, 0.1, 0.2, 0.2, 0.4])},
            "is 0.2 in row 3, needs more",
        ),
        (
            {"zmp": cut((5, 2), math.inf)},
            r"zmp has a value of inf in row 4, at most 1e\+12",
        ),
        (
            {"soles": cut((5, 2, 4, 2), -1e308)},
            r"soles has a value of -1e\+308 in row 4",
        ),
        (
            {"tilt": cut((5, 2), math.inf, np.float16)},
            "tilt has a value of inf in row 4",
        ),
        ({"torque": cut((5, 12), 1e13)}, r"torque has a value of 1e\+13 in row 4"),
    ],
)
def test_columns_that_do_not_fit_are_refused(changes, words, parts):
    arrays, header, write = parts
    wrong = {n: a for n, a in {**arrays, **changes}.items() if a is not None}
    refuse(write(wrong, header), words)


@pytest.mark.parametrize(
    "changes",
    [
        {"step_ticks": 3},
        {"step_ticks": ["a"]},
        {"fell_at_s": "soon"},
        {"events": [[1.0]]},
        {"decisions": [[0.0, {}, {}]]},
        {"robot": {"name": "x", "numbers": {}}},
        {"robot": {"name": "x", "numbers": None}},
        {"robot": 7},
        {"timing": [1.0, 2.0]},
        {"timing": [1.0, 0.6, 0.6]},
        {"limits": [1.0]},
        {"limits": None},
        {"limits": [[1.0, 2.0, 3.0], None]},
        {"limits": [None, [3.0] * 13]},
        {"limits": [math.nan, None]},
        {"limits": [None, [*[3.0] * 11, math.nan]]},
        {"limits": [-1.0, None]},
        {"fell_at_s": math.nan},
        {"fell_at_s": math.inf},
        {"fell_at_s": 1e9},
        {"fell_at_s": 0.02},
        {"step_ticks": [-5, 3]},
        {"step_ticks": [3, 1]},
        {"step_ticks": [0, 6]},
        {"events": [[math.nan, "a push"]]},
        {"commands": [[math.inf, 0.1]]},
        {"commands": [[]]},
    ],
)
def test_headers_that_do_not_fit_are_refused(changes, parts):
    arrays, header, write = parts
    refuse(write(arrays, {**header, **changes}), "inconsistent")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"limits": [[3.0] * 3, None]}, "torque limit has 3 numbers, needs one or 12"),
        ({"limits": [None, math.nan]}, "a speed limit is nan, needs 0 or more"),
        ({"fell_at_s": 7.0}, r"the fall is at 7\.0 s, needs 0\.04 s.* to 1\.04 s"),
        ({"step_ticks": [0, 6]}, "at row 6 without a fall before it, needs 5 or less"),
        ({"events": [[math.nan, "a"]]}, "an event is at nan s, needs a finite time"),
    ],
)
def test_what_would_fit_is_said(changes, words, parts):
    arrays, header, write = parts
    refuse(write(arrays, {**header, **changes}), words)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (10**400, "servo_damping of the robot is 1000.*, must be finite"),
        ("x" * 100_000, "servo_damping of the robot is 'xxx.*, must be a number"),
        ([], r"servo_damping of the robot is \[\], must be a number"),
    ],
)
def test_what_is_no_number_of_a_robot_is_told_in_part(number, words, parts):
    arrays, header, write = parts
    header["robot"]["numbers"]["servo_damping"] = number
    brief(write(arrays, header), words)


def test_what_a_foreign_header_says_is_told_in_part(parts):
    arrays, header, write = parts
    long = "x" * 100_000
    brief(write(arrays, {**header, "schema": long}), "record schema 'xxx")
    brief(write({**arrays, long: arrays["tilt"]}, header), "columns unknown: xxx")


def brief(path, words):
    with pytest.raises(RecordError, match=words) as caught:
        load_record(path)
    assert len(str(caught.value)) < 600 + len(str(path))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 255))
def test_a_changed_byte_is_refused_or_does_no_harm(tmp_path_factory, place, value):
    path = tmp_path_factory.getbasetemp() / "changed.rec"
    record = by_hand(np.zeros(3), robot=RES)
    save_record(record, path)
    data = bytearray(path.read_bytes())
    data[place % len(data)] = value
    path.write_bytes(bytes(data))
    try:
        again = load_record(path)
    except RecordError as error:
        assert "\n" not in str(error)
    else:
        assert len(again.time_s) == 3


def test_a_cut_file_is_refused(tmp_path):
    path = tmp_path / "walk.rec"
    save_record(by_hand(np.zeros(3)), path)
    data = path.read_bytes()
    for length in (1, 7, 8, 100, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        refuse(path, "damaged")


def test_a_fall_ends_the_record(library, tmp_path):
    backend = MujocoBackend(RES, World(servo_gain=0.1))
    walk = run_schedule(Walker(library, feedback=False), backend, SCHEDULE)
    assert walk.fell_at_s == pytest.approx(0.01 * len(walk.time_s))
    save_record(walk, tmp_path / "walk.rec")
    assert load_record(tmp_path / "walk.rec").fell_at_s == walk.fell_at_s
