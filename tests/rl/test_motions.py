"""Reference motions: what was walked, and what each format holds of it."""

import csv
import json
import pickle
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from full_disk import full_disk

from gaitchain.cli import export_motions, run
from gaitchain.errors import CommandError
from gaitchain.gait.command_range import CommandRange
from gaitchain.messages import Command
from gaitchain.rl.cycle import (
    evaluate_single,
    fit_polynomials,
    mean_cycle,
    mean_period,
)
from gaitchain.rl.expert import open_library
from gaitchain.rl.formats import FORMATS
from gaitchain.rl.frames import Motion
from gaitchain.rl.motions import Plan, command_grid, record_motion
from gaitchain.sim.model import build_model

HZ = 50


@pytest.fixture(scope="module")
def plan():
    return Plan(open_library(None), (3, 1, 1), seconds=1.5, rate_hz=HZ)


@pytest.fixture(scope="module")
def motions(plan):
    return [record_motion(plan, asked.command) for asked in plan.commands]


@pytest.fixture(scope="module")
def ahead(motions):
    return motions[-1]


def test_a_grid_reaches_the_ends_and_stays_in_the_range():
    limits = CommandRange((-0.25, 0.5), (-0.125, 0.125), (0.0, 0.0))
    grid = command_grid(limits, (5, 3, 3))
    assert len(grid) == 15  # no yaw
    assert all(limits.share(asked.command) <= 1.0 + 1e-9 for asked in grid)
    ahead = [asked.command.vx for asked in grid if not asked.command.vy]
    assert max(ahead) == 0.5
    assert min(ahead) == pytest.approx(-0.25, abs=1.1e-3)  # rounded into the range
    corner = next(a for a in grid if a.wanted == Command(0.5, 0.125))
    assert corner.command.motion == pytest.approx((0.25, 0.0625, 0.0))


@pytest.mark.parametrize(
    ("ahead", "speeds"),
    [((0.0, 0.4), [0.0, 0.2, 0.4]), ((-0.4, 0.0), [-0.4, -0.2, 0.0])],
)
def test_a_grid_has_no_command_twice(ahead, speeds):
    """A direction that is missing has parts, too, all of which are 0."""
    grid = command_grid(CommandRange(ahead, yaw_rate=(0.0, 0.5)), (5, 3, 3))
    rows = [asked.wanted.motion for asked in grid]
    assert rows == [(vx, 0.0, rate) for vx in speeds for rate in (0.0, 0.5)]


def test_a_motion_is_a_steady_walk(plan, ahead):
    assert not ahead.fell
    assert len(ahead.time) == 75 and ahead.time[1] == pytest.approx(1.0 / HZ)
    speed = (ahead.qpos[-1, 0] - ahead.qpos[0, 0]) / ahead.time[-1]
    assert speed == pytest.approx(plan.commands[-1].command.vx, abs=0.05)
    assert ahead.phase[0] < 0.05 and ahead.phase.max() > 0.9
    assert set(np.unique(ahead.contact)) == {0.0, 1.0}
    ahead_by = np.diff(ahead.phase) % 1.0
    assert ahead_by.max() < 0.1, "no jump of half a cycle"
    # In the middle of the left leg's support the right foot swings.
    swings = np.abs(ahead.phase - 0.25) < 0.05
    assert (ahead.contact[swings] == [1.0, 0.0]).all()


def test_bodies_are_those_of_mujoco(plan, ahead):
    model = build_model(plan.library.robot)
    data = mujoco.MjData(model)
    data.qpos[:] = ahead.qpos[30]
    mujoco.mj_kinematics(model, data)
    assert ahead.body_position[30] == pytest.approx(data.xpos[1:])
    assert ahead.body_quaternion[30] == pytest.approx(data.xquat[1:])
    assert len(plan.names[1]) == model.nbody - 1


def test_velocities_are_the_rates_of_positions(ahead):
    """Of the trunk and a thigh; feet are struck by the ground between frames."""
    way = (ahead.body_position[2:, :2] - ahead.body_position[:-2, :2]) * HZ / 2.0
    off = way - ahead.body_velocity[1:-1, :2]
    assert np.abs(off).mean() < 0.05
    assert ahead.body_velocity[:, 0] == pytest.approx(ahead.qvel[:, :3])


def test_rates_are_those_of_the_attitudes(ahead):
    """In the world; MuJoCo has the trunk's in its own axes."""
    turn = np.empty(9)
    for row in range(len(ahead.time)):
        mujoco.mju_quat2Mat(turn, ahead.qpos[row, 3:7])
        rate = turn.reshape(3, 3) @ ahead.qvel[row, 3:6]
        assert ahead.body_rate[row, 0] == pytest.approx(rate, abs=1e-6)
    before, after = ahead.body_quaternion[:-2, 1], ahead.body_quaternion[2:, 1]
    turned, axis = np.empty(4), np.empty(3)
    off = []
    for row, (one, other) in enumerate(zip(before, after, strict=True), start=1):
        back = one * [1.0, -1.0, -1.0, -1.0]
        mujoco.mju_mulQuat(turned, other, back)
        mujoco.mju_quat2Vel(axis, turned, 2.0 / HZ)
        off.append(np.abs(axis - ahead.body_rate[row, 1]).mean())
    assert np.abs(ahead.body_rate[:, 1]).mean() > 0.1, "else nothing is shown"
    assert np.mean(off) < 0.3 * np.abs(ahead.body_rate[:, 1]).mean()


def test_polynomials_follow_a_cycle():
    phases = np.arange(36) / 36
    rows = np.stack([np.sin(2 * np.pi * phases), np.cos(2 * np.pi * phases)], axis=1)
    fitted = fit_polynomials(rows, 9)
    assert fitted.shape == (2, 10)
    assert evaluate_single(fitted, 36) == pytest.approx(rows, abs=1e-3)
    assert fitted[1, 0] == pytest.approx(1.0, abs=1e-3)  # the constant comes first


def made(seconds, period_s, rate_hz=HZ):
    """A motion of one joint that turns by the number of the cycle."""
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    cycle = np.floor(time / period_s + 1e-9)
    none = np.zeros((len(time), 6))
    return Motion(
        time,
        time / period_s % 1.0,
        none[:, :1],
        np.column_stack([none, none[:, 0], cycle]),
        np.column_stack([none, cycle]),
        none[:, 0],
        none[:, :2],
        *(none[:, None, :3],) * 4,
        fell=False,
    )


def test_every_whole_cycle_counts():
    """Also those that end with the motion, whose last frame is before their end."""
    period_s = 2.0 * 0.47000000000000003
    assert period_s > 0.94
    for cycles in (1, 2, 3):
        mean = mean_cycle(made(0.94 * cycles, period_s), period_s, 47)
        assert mean.joints[20, 0] == pytest.approx((cycles - 1) / 2.0)
    half = mean_cycle(made(1.5 * 0.94, period_s), period_s, 47)
    assert half.joints[20, 0] == 0.0


@pytest.mark.parametrize("seconds", [0.0, 0.3, 0.92])
def test_a_motion_without_a_whole_cycle_has_no_mean(seconds):
    with pytest.raises(CommandError, match=r"no whole cycle of 0\.94 s"):
        mean_cycle(made(seconds, 0.94), 0.94, 47)


PLANNED_S = 0.72


def drifting(each_s):
    """A motion of one joint whose cycles take other times than the planned one.

    In each the joint goes through a sine, the robot 0.3 m ahead and the left foot up at
    0.6; a late step waits at the end of its phase, an early one cuts it.
    """
    begins = np.concatenate([[0.0], np.cumsum(each_s)])
    time = np.arange(round(begins[-1] * HZ)) / HZ
    number = np.searchsorted(begins, time + 1e-9, "right") - 1
    lasts, since = np.array(each_s)[number], np.maximum(time - begins[number], 0.0)
    turn, none = 2.0 * np.pi * since / lasts, np.zeros((len(time), 6))
    rate, ahead = 2.0 * np.pi * np.cos(turn) / lasts, 0.3 / lasts
    left = since / lasts < 0.6
    return Motion(
        time,
        np.minimum(since / PLANNED_S, 1.0) % 1.0,
        none[:, :1],
        np.column_stack([none, none[:, 0], np.sin(turn)]),
        np.column_stack([ahead, none[:, 1:], rate]),
        none[:, 0],
        np.column_stack([left, ~left]).astype(float),
        *(none[:, None, :3],) * 4,
        fell=False,
    )


@pytest.mark.parametrize(
    "each_s",
    [
        [0.76] * 13,
        [0.73, 0.79] * 6,
        [0.67, 0.7] * 6,
        [0.68, 0.72, 0.85, 0.72] * 3,
    ],
    ids=["late", "late by turns", "early", "both"],
)
def test_cycles_are_cut_where_they_begin(each_s):
    """Cut at multiples of the planned time they would be out of phase."""
    period_s = np.mean(each_s)
    motion, phases = drifting(each_s), np.arange(36) / 36
    assert mean_period([motion], PLANNED_S, 36) == pytest.approx(period_s, abs=0.003)
    mean, turn = mean_cycle(motion, PLANNED_S, 36), 2.0 * np.pi * phases
    assert mean.joints[:, 0] == pytest.approx(np.sin(turn), abs=0.03)
    rate = 2.0 * np.pi * np.cos(turn) / period_s
    # The frames on both sides of a start have the rates of two cycles.
    assert mean.rates[2:-2, 0] == pytest.approx(rate[2:-2], abs=0.3)
    assert mean.velocity[2:-2, 0] == pytest.approx(0.3 / period_s, abs=0.003)
    away = np.abs(phases - 0.6) > 0.04
    inside = away & (phases > 0.02) & (phases < 0.97)
    assert (mean.contact[inside, 0] == (phases[inside] < 0.6)).all()


def test_a_walk_without_a_whole_cycle_has_no_mean():
    """Although it is as long as the planned one."""
    motion = drifting([0.8])
    cut = replace(motion, time=motion.time[:35], phase=motion.phase[:35])
    assert cut.time[-1] > 0.94 * PLANNED_S
    with pytest.raises(CommandError, match=r"such as 1\.44 s, as steps may be late"):
        mean_cycle(cut, PLANNED_S, 36)


def test_who_stands_has_the_planned_cycle(motions):
    stands = motions[1]
    assert not stands.phase.any()
    assert mean_period([stands], PLANNED_S, 36) == PLANNED_S
    walks = drifting([0.76] * 6)
    both = mean_period([stands, walks], PLANNED_S, 36)
    assert both == mean_period([walks], PLANNED_S, 36)


def test_npz_has_every_motion(plan, motions, tmp_path):
    (path,) = FORMATS["npz"].write(plan, motions, tmp_path / "all.npz")
    with np.load(path) as found:
        assert found["qpos"].shape == (3, 75, 19)
        assert found["command"][1].tolist() == [0.0, 0.0, 0.0]
        assert found["qpos"][2] == pytest.approx(motions[2].qpos)
        assert found["joint_names"][0] == "left_hip_yaw"


def test_csv_has_units_and_an_index(plan, motions, tmp_path):
    *tables, index = FORMATS["csv"].write(plan, motions, tmp_path)
    rows = list(csv.DictReader(tables[2].read_text().splitlines()))
    angle = float(rows[7]["left_knee [rad]"])
    own = motions[2]
    assert angle == pytest.approx(own.qpos[7, 7 + 3], rel=1e-6)
    for head, value in (
        ("base_vx [m/s]", own.qvel[7, 0]),
        ("left_knee [rad/s]", own.qvel[7, 6 + 3]),
        ("left_contact [1]", own.contact[7, 0]),
        ("left_knee_target [rad]", own.target[7, 3]),
    ):
        assert float(rows[7][head]) == pytest.approx(value, rel=1e-6)
    named = list(csv.DictReader(index.read_text().splitlines()))
    assert named[2]["file"] == tables[2].name
    assert float(named[2]["vx [m/s]"]) == pytest.approx(
        plan.commands[2].command.vx, abs=1e-6
    )


def test_mjlab_finds_its_arrays(plan, motions, tmp_path):
    """Those that `MotionLoader` of mjlab 1.6 takes, with frames first."""
    *files, _ = FORMATS["mjlab"].write(plan, motions, tmp_path)
    with np.load(files[2]) as found:
        assert found["fps"].tolist() == [50.0]
        for name, size in (("pos", 3), ("quat", 4), ("lin_vel", 3), ("ang_vel", 3)):
            assert found[f"body_{name}_w"].shape == (75, 7, size), name
        assert found["joint_pos"].dtype == np.float32
        assert found["joint_vel"] == pytest.approx(motions[2].qvel[:, 6:], abs=1e-5)
        trunk = found["body_quat_w"][:, 0]
        assert trunk == pytest.approx(motions[2].qpos[:, 3:7], abs=1e-5)
        rates = found["body_ang_vel_w"]
        assert rates == pytest.approx(motions[2].body_rate, abs=1e-5)


@pytest.mark.parametrize("to", sorted(FORMATS))
def test_a_full_disk_leaves_no_part_of_a_file(plan, motions, tmp_path, to):
    kind = FORMATS[to]
    path = tmp_path / f"f{kind.suffix}" if kind.suffix else tmp_path
    with full_disk(1000), pytest.raises(CommandError, match="cannot be written"):
        kind.write(plan, motions, path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("to", "suffix"), [("csv", ".csv"), ("mjlab", ".npz")])
def test_motions_of_an_earlier_export_are_removed(plan, motions, tmp_path, to, suffix):
    """And no file that only looks like one."""
    others = {f"motion_2{suffix}", f"motion_0001{suffix}", f"my_motion_001{suffix}"}
    others |= {f"motion_001 (copy){suffix}", "motion_001.txt"}
    for name in (*others, f"motion_1000{suffix}"):
        (tmp_path / name).write_text("", "utf-8")
    FORMATS[to].write(plan, motions, tmp_path)
    many = {path.name for path in tmp_path.iterdir()}
    assert many == {
        *others,
        *(f"motion_{n}{suffix}" for n in ("000", "001", "002", 1000)),
        "index.csv",
    }
    fewer = replace(plan, grid=(1, 1, 1))
    FORMATS[to].write(fewer, motions[1:2], tmp_path)
    found = {path.name for path in tmp_path.iterdir()}
    assert found == {*others, f"motion_000{suffix}", "index.csv"}


def test_in_its_own_model_a_robot_moves_all_its_joints_in_the_files_order(
    toy_path, toy_library, tmp_path
):
    plan = Plan(toy_library, (1, 1, 1), seconds=1.5, rate_hz=HZ, own_file=toy_path)
    motion = record_motion(plan, Command(0.2))
    file = mujoco.MjModel.from_xml_path(str(toy_path))
    named = [file.joint(j).name for j in range(1, file.njnt)]
    bodies = [file.body(b).name for b in range(1, file.nbody)]
    *files, _ = FORMATS["mjlab"].write(plan, [motion], tmp_path)
    with np.load(files[0]) as found:
        assert found["joint_names"].tolist() == named, "the arms among them"
        assert found["body_names"].tolist() == bodies
        places, turns = found["body_pos_w"], found["body_quat_w"]
    data = mujoco.MjData(file)
    data.qpos[:] = motion.qpos[40]
    mujoco.mj_kinematics(file, data)
    assert places[40] == pytest.approx(data.xpos[1:], abs=1e-5)
    assert turns[40] == pytest.approx(data.xquat[1:], abs=1e-5)
    speed = (motion.qpos[-1, 0] - motion.qpos[0, 0]) / motion.time[-1]
    assert speed == pytest.approx(0.2, rel=0.2)
    assert set(np.unique(motion.contact)) == {0.0, 1.0}
    arm = named.index("left_shoulder")
    assert motion.target[:, arm] == pytest.approx(0.0), "held"
    assert np.ptp(motion.target[:, named.index("left_knee")]) > 0.1


def test_a_heading_is_the_pelvis_yaw(ahead):
    assert ahead.heading == pytest.approx(0.0, abs=0.2)
    w, x, y, z = ahead.qpos[:, 3:7].T
    yaw = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    assert ahead.heading == pytest.approx(yaw)


def test_open_duck_finds_its_polynomials(plan, motions, tmp_path):
    """Read as `PolyReferenceMotion` does: keys, a whole grid, frames of a period."""
    path, beside = FORMATS["open-duck"].write(plan, motions, tmp_path / "poly.pkl")
    with path.open("rb") as file:
        found = pickle.load(file)
    speeds = [tuple(map(float, key.split("_"))) for key in found]
    assert speeds == [asked.wanted.motion for asked in plan.commands]
    about = found[list(found)[2]]
    assert int(about["period"] * about["fps"]) == about["nb_steps_in_period"] == 36
    values = list(about["coefficients"].values())
    read = [np.polyval(np.flip(np.array(v, np.float32)), 9 / 36) for v in values]
    cycle = mean_cycle(motions[2], 0.72, 36)
    joints = len(plan.library.robot.legs.joint_names)
    assert read[:joints] == pytest.approx(cycle.joints[9], abs=0.02)
    assert read[2 * joints + 2] == pytest.approx(cycle.velocity[9, 0], abs=0.1)
    told = json.loads(beside.read_text())
    assert told["joint_error_rad"] < 0.03
    assert list(told["walked"]) == list(told["motions"]) == list(found)
    done = [list(asked.command.motion) for asked in plan.commands]
    assert list(told["walked"].values()) == done


def test_open_duck_has_the_time_of_a_cycle_that_was_walked(plan, tmp_path):
    one = replace(plan, grid=(1, 1, 1))
    to = tmp_path / "poly.pkl"
    _, beside = FORMATS["open-duck"].write(one, [drifting([0.76] * 13)], to)
    found = json.loads(beside.read_text())
    assert found["true_period_s"] == pytest.approx(0.76, abs=0.003)
    (about,) = found["motions"].values()
    assert int(about["period"] * about["fps"]) == about["nb_steps_in_period"] == 38


def test_the_verb_writes_and_says_what(tmp_path, capsys):
    words = f"export res --to npz --grid 1,1,1 --seconds 1 -o {tmp_path}/a.npz"
    assert run([*words.split(), "--workers", "1"]) == 0
    assert ": 1 motion for npz" in capsys.readouterr().out
    assert (tmp_path / "a.npz").is_file()


def test_one_cycle_is_enough_for_polynomials(tmp_path):
    words = f"export res --to open-duck --grid 1,1,1 -o {tmp_path}/a.pkl --workers 1"
    for length in ("--seconds 0.72", "--seconds 0.73 --rate 25"):
        assert run([*words.split(), *length.split()]) == 0
        (about,) = json.loads((tmp_path / "a.json").read_text())["motions"].values()
        assert np.isfinite(list(about["coefficients"].values())).all()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--to npz --grid 2,1,1", "three odd numbers, such as 5,3,3"),
        ("--to npz -o a.csv", "name it *.npz"),
        (f"--to npz -o {'a' * 250}.npz", "File name too long; name another file"),
        ("--to npz -o /proc/a.npz", "/proc/a.npz: cannot be written: No such file"),
        ("--to csv -o /proc", "csv: cannot be written: No such file"),
        ("--to npz --seconds 0.5", "a cycle takes 0.72, give 0.72 to 600"),
        ("--to open-duck --seconds 0.71", "a cycle takes 0.72, give 0.72 to 600"),
        ("--to open-duck --seconds 0.72 --rate 25", "give 0.73 to 600"),
        ("--to npz --seconds -1", "--seconds -1: a cycle takes 0.72, give 0.72 to 600"),
        ("--to npz --seconds 601", "give 0.72 to 600"),
        ("--to npz --seconds nan", "give 0.72 to 600"),
        ("--to npz --own-model no.xml", "no.xml"),
    ],
)
def test_what_cannot_be_written_is_refused(words, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(export_motions, "record_motions", None)  # nothing is walked
    assert run(["export", "res", *words.split()]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "there", "says"),
    [
        (
            "open-duck -o a.pkl",
            "a.json",
            "a.json: it is there, and not the polynomials of motions that can be read; "
            "name another file for the motions, as a.json is written beside a.pkl",
        ),
        (
            "csv -o .",
            "index.csv",
            "index.csv: it is there, and not the index of motions that can be read; "
            "name another file for the motions",
        ),
        (
            "csv -o .",
            "motion_000.csv",
            "motion_000.csv: it is there, without the index.csv of an export; name "
            "another folder for the motions",
        ),
        (
            "mjlab -o .",
            "motion_000.npz",
            "motion_000.npz: it is there, without the index.csv of an export; name "
            "another folder for the motions",
        ),
    ],
)
def test_files_of_somebody_else_stay(words, there, says, capsys, tmp_path, monkeypatch):
    """They were replaced without a word."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(export_motions, "record_motions", None)  # nothing is walked
    path = tmp_path / there
    path.write_text('{"mine": 1}', "utf-8")
    assert run(["export", "res", "--grid", "1,1,1", "--to", *words.split()]) == 2
    assert capsys.readouterr().err == f"gaitchain: {says}\n"
    assert path.read_text("utf-8") == '{"mine": 1}'
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize(
    ("to", "out", "named"),
    [
        ("npz", "a.npz", "a.npz"),
        ("csv", "a", "a"),
        ("mjlab", "a", "a"),
        ("open-duck", "a.pkl", "a.pkl and a.json"),
    ],
)
def test_an_earlier_export_is_replaced_and_all_files_are_named(
    motions, to, out, named, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(export_motions, "record_motions", lambda *_: iter(motions))
    words = f"export res --grid 3,1,1 --seconds 1.5 --to {to} -o {out} --json all.json"
    for _ in range(2):
        assert run(words.split()) == 0
        assert f"\n{named}: 3 motions for {to}\n" in capsys.readouterr().out
    told = json.loads((tmp_path / "all.json").read_text("utf-8"))["files"]
    found = {p for p in tmp_path.rglob("*") if p.is_file()} - {tmp_path / "all.json"}
    assert {tmp_path / name for name in told} == found


@pytest.mark.parametrize("to", sorted(FORMATS))
def test_nothing_is_written_where_a_motion_falls(
    motions, monkeypatch, tmp_path, capsys, to
):
    came = [*motions[:-1], replace(motions[-1], fell=True)]
    monkeypatch.setattr(export_motions, "record_motions", lambda *_: iter(came))
    kind = FORMATS[to]
    path = tmp_path / f"f{kind.suffix}" if kind.suffix else tmp_path / "out"
    words = ["export", "res", "--to", to, "-o", str(path), "--grid", "3,1,1"]
    assert run([*words, "--seconds", "1.5", "--rate", str(HZ)]) == 1
    assert "nothing written: 1 of 3 motions fell" in capsys.readouterr().out
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]
