"""Exercises: inside the limits, on feet that stay, their preview, and their log."""

import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from other_robots import resized
from safetensors import safe_open
from safetensors.numpy import save_file
from servo_bench import RES

from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.cli import run
from gaitchain.errors import BackendError, LogError
from gaitchain.identify.log import ExerciseLog, MotionLog, load_log, save_log
from gaitchain.identify.simulated import exercise_hidden, preview, replay, run_exercise
from gaitchain.live.exercise import Motion, exercise, sway
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY
from gaitchain.sim.bodies import FOOT, SIDES
from gaitchain.sim.model import build_model
from gaitchain.sim.truth import SimulatorTruth
from gaitchain.sim.world import World

MOTIONS = exercise(RES)


def test_it_takes_less_than_a_minute_and_stays_inside_the_limits():
    legs = RES.legs
    assert sum(len(m.targets) for m in MOTIONS) * CONTROL_PERIOD_S <= 60.0
    for motion in MOTIONS:
        assert (motion.targets >= legs.lower).all()
        assert (motion.targets <= legs.upper).all()
        speed = np.abs(np.diff(motion.targets, axis=0)) / CONTROL_PERIOD_S
        assert (speed < 0.5 * legs.speed_limit).all()
        np.testing.assert_allclose(motion.targets[0], motion.targets[-1], atol=1e-9)


def test_hung_legs_stay_apart():
    """Links pass through each other in simulation, not on a robot."""
    shown, model = preview(RES), build_model(RES)
    data = mujoco.MjData(model)
    truth = SimulatorTruth(model, data, World())
    for row in shown.qpos[: len(MOTIONS[0].targets) : 5]:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        assert not truth.self_contact


def test_nothing_is_shown_of_legs_that_meet(monkeypatch):
    """As of legs whose hips roll against each other."""
    against = np.where(np.arange(12) == 1, -1.0, 1.0)
    monkeypatch.setattr("gaitchain.live.exercise._same_way", lambda robot: against)
    with pytest.raises(BackendError, match=r"the legs of Robo.* meet in"):
        preview(RES)


def test_every_joint_moves():
    for motion in MOTIONS:
        assert (np.ptp(motion.targets, axis=0) > 0.01).all()


@pytest.mark.parametrize("crus_m", [0.246, 0.346])
def test_feet_stay_on_the_ground(crus_m):
    """In physics: it stays upright, its soles level by joints and accelerometer."""
    robot = resized(RES, crus_length=crus_m, femur_length=0.592 - crus_m)
    standing = sway(robot)
    seen = replay(robot, standing, np.zeros(2))
    assert len(seen.joint_position) == len(standing.targets)
    joints, felt = (
        np.apply_along_axis(np.convolve, 0, rows, np.full(50, 0.02), "valid")
        for rows in (seen.joint_position, seen.acceleration)
    )
    legs, lean = legs_of(robot), []
    for row, up in zip(joints[::10], felt[::10], strict=True):
        soles = posture(legs, np.ascontiguousarray(row)).feet[..., 2]
        lean.append(np.degrees(np.arccos(soles @ up / np.linalg.norm(up))))
    assert np.mean(lean) < 1.5
    assert np.max(lean) < 8.0


def swaying():
    """MuJoCo's kinematics of a sway, wherever no knee ends before what that takes."""
    legs, targets = RES.legs, sway(RES).targets
    inside = ((targets > legs.lower + 1e-6) & (targets < legs.upper - 1e-6)).all(axis=1)
    assert inside.mean() > 0.7
    model = build_model(RES)
    data = mujoco.MjData(model)
    joints = [model.joint(name).qposadr[0] for name in legs.joint_names]
    for row in targets[inside][::20]:
        data.qpos[joints] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        left, right = (data.body(f"{side}_foot") for side in ("left", "right"))
        yield data.subtree_com[0], left, right, left.xmat.reshape(3, 3).T


def test_the_targets_of_a_sway_leave_the_feet_where_they_are():
    places = []
    for _, left, right, turn in swaying():
        places.append(turn @ (right.xpos - left.xpos))
        np.testing.assert_allclose(
            turn @ right.xmat.reshape(3, 3), np.eye(3), atol=1e-6
        )
    assert np.ptp(places, axis=0).max() < 1e-6


def test_a_sway_keeps_the_weight_over_the_soles_however_the_trunk_turns():
    places, pitches = [], []
    for com, left, right, turn in swaying():
        places.append(turn @ (com - 0.5 * (left.xpos + right.xpos)))
        pitches.append(np.degrees(np.arcsin(-turn[0, 2])))
    assert np.ptp(pitches) > 20.0
    ahead, aside = np.ptp(places, axis=0)[:2]
    assert ahead < 0.2 * RES.reduced.sole_length
    assert aside < 0.2 * RES.reduced.hip_width


def test_a_trunk_that_is_held_stays_where_it_is():
    held, _ = MOTIONS
    lean = np.array([0.03, -0.02])
    seen = replay(RES, held, lean)
    mean = seen.acceleration.mean(axis=0)
    np.testing.assert_allclose(np.linalg.norm(mean), GRAVITY, rtol=0.01)
    assert np.abs(seen.angular_velocity).max() < 0.2
    roll, pitch = np.arctan2(mean[1], mean[2]), -np.arcsin(mean[0] / GRAVITY)
    np.testing.assert_allclose([roll, pitch], lean, atol=0.006)


@pytest.mark.slow
def test_a_log_is_read_as_it_was_written(tmp_path):
    log = exercise_hidden(RES, 4)
    save_log(log, tmp_path / "a.log")
    again = load_log(tmp_path / "a.log")
    assert again.fingerprint == RES.fingerprint
    for one, other in zip(log.parts, again.parts, strict=True):
        assert one.motion.support == other.motion.support
        np.testing.assert_array_equal(one.motion.targets, other.motion.targets)
        for name, column in vars(one.measured).items():
            np.testing.assert_array_equal(column, getattr(other.measured, name))
    save_log(exercise_hidden(RES, 4), tmp_path / "b.log")
    assert (tmp_path / "a.log").read_bytes() == (tmp_path / "b.log").read_bytes()


@pytest.fixture
def short():
    """The log of 2.5 s of legs that swing."""
    motion = Motion("held", MOTIONS[0].targets[:250])
    part = MotionLog(motion, replay(RES, motion, np.zeros(2)))
    names = RES.legs.joint_names
    return ExerciseLog(RES.name, RES.fingerprint, names, CONTROL_PERIOD_S, (part,))


def test_logs_without_times_are_read(short, tmp_path):
    """As they were written before."""
    path = tmp_path / "a.log"
    save_log(short, path)
    with safe_open(path, "np") as file:
        header = file.metadata()
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    del arrays["time_s_0"], arrays["turnaround_s_0"]
    save_file(arrays, path, header)
    again = load_log(path)
    assert again.late_s == 0.0
    assert again.turnarounds_s.size == 0
    seen, same = again.parts[0].measured, short.parts[0].measured
    np.testing.assert_array_equal(seen.joint_position, same.joint_position)


def test_times_have_to_be_numbers(short, tmp_path):
    short.parts[0].measured.time_s[7] = np.nan
    save_log(short, tmp_path / "a.log")
    with pytest.raises(LogError, match="time_s has a value that is no number"):
        load_log(tmp_path / "a.log")


def test_no_target_is_written_before_its_read_began(short, tmp_path):
    short.parts[0].measured.turnaround_s[[3, 7]] = 0.004, -0.001
    save_log(short, tmp_path / "a.log")
    with pytest.raises(LogError, match="turnaround_s has a value below 0"):
        load_log(tmp_path / "a.log")


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("acceleration", "acceleration has a value of 1e.200 in row 7, at most 1000"),
        ("joint_position", "joint_position has a value of 1e.200"),
        ("time_s", "time_s has a value of 1e.200 in row 7, at most 1e.10"),
    ],
)
def test_absurd_values_are_refused_by_name(short, tmp_path, column, said):
    getattr(short.parts[0].measured, column)[7, ...] = 1e200
    save_log(short, tmp_path / "a.log")
    with pytest.raises(LogError, match=said):
        load_log(tmp_path / "a.log")


@pytest.mark.parametrize(
    "column", ["acceleration", "angular_velocity", "joint_position"]
)
def test_infinity_is_absurd_and_not_a_measurement_that_misses(short, tmp_path, column):
    getattr(short.parts[0].measured, column)[7, 1] = -np.inf
    save_log(short, tmp_path / "a.log")
    with pytest.raises(
        LogError, match=f"{column} has a value of -inf in row 7, at most"
    ):
        load_log(tmp_path / "a.log")


def test_a_name_in_a_log_is_one_short_line_that_no_terminal_obeys(short, tmp_path):
    evil = replace(short, robot="evil\x1b[31m\n" + "x" * 100_000)
    save_log(evil, tmp_path / "a.log")
    name = load_log(tmp_path / "a.log").robot
    assert name.startswith("evil [31m xxx")
    assert name.endswith("x...")
    assert len(name) == 60


def rewritten(log, path, change):
    """Write a log whose header and arrays were changed."""
    save_log(log, path)
    with safe_open(path, "np") as file:
        header = json.loads(file.metadata()["gaitchain"])
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    header = change(header, arrays) or header
    save_file(arrays, path, {"gaitchain": json.dumps(header)})


def cast(kind):
    return lambda _, arrays: arrays.update(target_0=arrays["target_0"].astype(kind))


WRONG = {
    "target is of float32, must be of float64": cast(np.float32),
    "target is of int32, must be of float64": cast(np.int32),
    r"target has shape (250, 12), must be (250, 11), by the 250 rows of target and 11 "
    "joint_names": lambda header, _: header["joint_names"].pop(),
    "target has shape (), must be (1, 12)": lambda _, arrays: arrays.update(
        target_0=np.array(1.0)
    ),
    "the motion 'held' has no target": lambda _, arrays: arrays.pop("target_0"),
    "Expected `object`, got `array`": lambda *_: [1],
    "missing required field `kind`": lambda header, _: header.pop("kind"),
    "Expected `array`, got `null` - at `$.supports`": lambda header, _: header.update(
        supports=None
    ),
    "Invalid enum value 'hung' - at `$.supports[0]`": lambda header, _: header.update(
        supports=["hung"]
    ),
    "Invalid enum value 'xxx": lambda header, _: header.update(supports=["x" * 10**5]),
    "supports is empty": lambda header, _: header.update(supports=[]),
    "period_s is 0, must be 0.001 to 0.1": lambda header, _: header.update(period_s=0),
    "its kind and schema are 'exercise', 2, must be 'exercise', 1": lambda header, _: (
        header.update(schema=2)
    ),
    f"its kind and schema are 'evil  {'x' * 51}...', 1, must be": lambda header, _: (
        header.update(kind="evil\x1b\n" + "x" * 100_000)
    ),
    "the motion 'held' has 1 s, needs 2": lambda header, _: header.update(
        period_s=0.004
    ),
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_wrong_with_a_log_is_said(said, short, tmp_path):
    """With what it is and what it must be; no error of Python's own."""
    path, change = tmp_path / "a.log", WRONG[said]
    rewritten(short, path, lambda *parts: as_header(change(*parts)))
    with pytest.raises(LogError, match=re.escape(said)) as caught:
        load_log(path)
    assert len(str(caught.value)) < 600 + len(str(path))


def as_header(changed):
    """What replaces the header, if a change gave that."""
    return changed if isinstance(changed, list) else None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "it is empty"),
        (b"0123", "it has no header of safetensors"),
        ((2).to_bytes(8, "little") + b"[]", "it has no header of safetensors"),
        ((2).to_bytes(8, "little") + b"{}", "its metadata has no entry 'gaitchain'"),
    ],
)
def test_what_is_no_log_is_said(content, said, tmp_path):
    (tmp_path / "a.log").write_bytes(content)
    with pytest.raises(LogError, match=rf"not a log that .* wrote \({said}"):
        load_log(tmp_path / "a.log")


def test_numbers_of_a_type_that_numpy_lacks_are_said(short, tmp_path):
    path = tmp_path / "a.log"
    save_log(short, path)
    with safe_open(path, "np") as file:
        notes = file.metadata()
    target = {"dtype": "BF16", "shape": [1], "data_offsets": [0, 2]}
    half = json.dumps({"__metadata__": notes, "target_0": target}).encode()
    path.write_bytes(len(half).to_bytes(8, "little") + half + bytes(2))
    with pytest.raises(LogError, match="numbers are of 'BF16', must be of float64"):
        load_log(path)


def test_a_file_that_is_far_too_large_is_not_read(tmp_path):
    path = tmp_path / "a.log"
    with path.open("wb") as file:
        file.truncate(900_000_000_000)  # sparse: it takes no space
    with pytest.raises(LogError, match=r"900000\.0 MB, such a file at most 64"):
        load_log(path)


def test_a_log_is_kept_until_another_one_is_whole(short, tmp_path, monkeypatch):
    path = tmp_path / "a.log"
    save_log(short, path)
    before = path.read_bytes()

    def full(own, data):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(LogError, match="No space left"):
            save_log(short, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_one_and_no_pipe_is_replaced(short, tmp_path):
    path, link = tmp_path / "a.log", tmp_path / "latest.log"
    link.symlink_to(path)
    save_log(short, link)
    assert link.is_symlink() and load_log(path).robot == short.robot
    save_log(short, Path(os.devnull))
    assert not Path(os.devnull).is_file()


@pytest.mark.parametrize("cut", [0, 7, 200, -100])
def test_damaged_logs_are_refused(tmp_path, cut):
    path = tmp_path / "cut.log"
    save_log(exercise_hidden(RES, 4), path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(LogError, match="exercise"):
        load_log(path)


@pytest.mark.parametrize("inside", [False, True])
def test_a_log_nested_without_end_is_refused(tmp_path, inside):
    """In the header of the file, and in the text that is its metadata."""
    path, deep = tmp_path / "a.log", "[" * 100_000
    header = json.dumps({"__metadata__": {"gaitchain": deep}}) if inside else deep
    path.write_bytes(len(header).to_bytes(8, "little") + header.encode())
    with pytest.raises(LogError, match="not a log"):
        load_log(path)


def test_who_cannot_stand_is_told_so():
    world = World(encoder_offset_deg=25.0, seed=2)
    with pytest.raises(BackendError, match="falls even when it sways by 25%"):
        run_exercise(RES, world, np.zeros(2))


def test_the_preview_is_of_the_same_targets():
    """Its joints follow them, its trunk is held, then its soles are on the floor."""
    shown, model = preview(RES), build_model(RES)
    assert shown.qpos.shape == (len(shown.time_s), model.nq)
    np.testing.assert_allclose(np.diff(shown.time_s), CONTROL_PERIOD_S)
    sent = np.concatenate([motion.targets for motion in MOTIONS])
    assert np.abs(shown.qpos[:, 7:] - sent).max() < 0.2
    held = shown.qpos[: len(MOTIONS[0].targets)]
    assert np.ptp(held[:, :3], axis=0).max() < 0.01  # what a soft hold gives
    data, heights = mujoco.MjData(model), []
    for row in shown.qpos[len(held) :: 100]:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        heights.append([data.body(f"{side}_{FOOT}").xpos[2] for side in SIDES])
    assert np.ptp(heights, axis=0).max() < 0.005


def test_nothing_is_shown_of_a_robot_that_falls():
    with pytest.raises(BackendError, match="after it begins to sway, of 28 s"):
        preview(RES.with_servo_gain(0.05))


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")
def test_the_preview_is_there_before_anybody_is_asked(tmp_path, monkeypatch, capsys):
    """Nobody answers, so that no motor moves."""
    pytest.importorskip("dynamixel_sdk")
    page, log = tmp_path / "look.html", tmp_path / "a.log"
    words = ["calibrate", "res", "--preview", str(page), "--exercise", str(log)]
    reading, writing = os.pipe()
    os.close(writing)
    with os.fdopen(reading) as answers:
        monkeypatch.setattr(sys, "stdin", answers)
        assert run([*words, "--port", "emulated"]) == 2
    said = capsys.readouterr()
    assert "nobody answers" in said.err
    assert f"{page}: the 56 s in simulation" in said.out.replace("\n", "")
    assert "<title>Robo-Erectus Senior: exercise<" in page.read_text("utf-8")
    assert not log.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", "x"], "--preview: moves no robot; give --exercise FILE as well"),
        (["--robot-hidden", "1"], "--preview: moves no robot"),
        (["-o", "a.toml"], "--preview: not with -o"),
    ],
)
def test_a_preview_alone_needs_no_robot(words, said, tmp_path, capsys):
    page = tmp_path / "look.html"
    assert run(["calibrate", "res", "--preview", str(page), *words]) == 2
    assert said in capsys.readouterr().err
    assert not page.exists()
