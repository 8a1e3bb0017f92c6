"""`gaitchain inspect`, `build` and `walk` on robots from MJCF, as a user has them."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from commands import call
from other_robots import with_legs
from PIL import Image
from toy_file import toy

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.record_file import load_record, save_record
from gaitchain.analysis.rules import Rule
from gaitchain.build.own_trials import describe_own_model
from gaitchain.discover.loaded_robot import load_robot, load_with_findings
from gaitchain.errors import LibraryError
from gaitchain.figures import snapshots
from gaitchain.gait.library_file import check_robot, load_library, save_library
from gaitchain.gait.qualification import OwnReport
from gaitchain.robot.leg_model import LegModel

SHARED = Path(__file__).parents[3] / "shared" / "robots"
REAL = Path(os.environ.get("MENAGERIE_ROOT") or SHARED)


@pytest.fixture(autouse=True)
def wide(monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_inspect_shows_every_finding_and_draws_it(toy_path, tmp_path, capsys):
    picture = tmp_path / "seen" / "toy.png"
    code, out, err = call(capsys, "inspect", toy_path, "-o", picture)
    assert (code, err) == (0, "")
    for row in load_with_findings(toy_path).findings.evidence:
        assert all(cell in out for cell in row)
    for name in ("left_knee", "right_tilt", "0 to 126", "+y", "300", "actuator"):
        assert name in out
    assert "Held still, 2 joints [deg]: left_shoulder 0.0" in out
    assert "ZMP of the links as points" in out
    assert "femur_length" in out
    assert picture.stat().st_size > 20_000
    assert str(picture) in out


@pytest.mark.slow
def test_a_slide_outside_the_legs_is_shown_in_metres(toy_path, tmp_path, capsys):
    spec = mujoco.MjSpec.from_file(str(toy_path))
    trunk = spec.joint("left_shoulder").parent.parent
    head = trunk.add_body(pos=[0, 0, 0.3], mass=0.5, inertia=[0.01] * 3)
    kind = mujoco.mjtJoint.mjJNT_SLIDE
    head.add_joint(name="lift", type=kind, axis=[0, 0, 1], range=[0.02, 0.2])
    head.explicitinertial = True
    spec.compile()
    lifted = tmp_path / "lifted.xml"
    lifted.write_text(spec.to_xml())
    code, out, _ = call(capsys, "inspect", lifted)
    assert code == 0
    assert "lift 0.020 m" in out


@pytest.mark.slow
def test_where_nothing_can_be_rendered_the_rest_is_drawn(
    toy_path, tmp_path, capsys, monkeypatch
):
    sizes = {}
    for name in ("with.png", "without.png"):
        picture = tmp_path / name
        code, out, _ = call(capsys, "inspect", toy_path, "-o", picture)
        assert code == 0
        with Image.open(picture) as image:
            sizes[name] = image.width / image.height

        def fail():
            raise OSError("no library")

        monkeypatch.setattr(snapshots, "_gl_class", fail)
    assert "no portrait: no off-screen OpenGL here (no library)" in out
    assert sizes["with.png"] > 1.2 * sizes["without.png"]


@pytest.mark.slow
def test_the_picture_goes_where_all_runs_go(toy_path, tmp_path, capsys):
    code, out, _ = call(capsys, "inspect", toy_path)
    assert code == 0
    assert (tmp_path / "runs" / "inspect" / "toy.png").is_file()
    assert "runs/inspect/toy.png" in out


@pytest.mark.slow
def test_a_profile_overrides_what_is_found(toy_path, tmp_path, capsys):
    profile = tmp_path / "profile.toml"
    profile.write_text("[servo.left_knee]\nstiffness = 123\n", "utf-8")
    code, out, _ = call(capsys, "inspect", toy_path, "--profile", profile)
    assert code == 0
    rows = [line for line in out.splitlines() if line.startswith("│ left_knee")]
    assert "123" in rows[-1]
    assert "profile" in rows[-1]


def test_a_library_of_a_full_robot_shows_its_joints(toy_library, tmp_path, capsys):
    save_library(toy_library, tmp_path / "toy.gait")
    (tmp_path / "toy.bin").write_bytes((tmp_path / "toy.gait").read_bytes())
    for name in ("toy.gait", "toy.bin"):
        code, out, _ = call(capsys, "inspect", tmp_path / name)
        assert code == 0
        assert "Gait library" in out
        assert "left_knee" in out


def test_a_library_says_where_the_gains_of_its_legs_come_from(
    toy_library, tmp_path, capsys
):
    """By the robot's file, or if that is gone by what was walked of it."""
    file, path = tmp_path / "soft.xml", tmp_path / "soft.gait"
    file.write_text(toy(kp=5.0), "utf-8")
    poses = replace(toy_library.poses, robot=load_robot(file))
    config = replace(toy_library.config, robot=str(file))
    model = describe_own_model(file, replace(toy_library, poses=poses))
    walked = replace(toy_library.qualification, own=OwnReport(True, model=model))
    save_library(
        replace(toy_library, poses=poses, config=config, qualification=walked), path
    )
    said = "derived: placeholder gains; the file's are not believed: left_roll: kp 5 N"
    code, out, _ = call(capsys, "inspect", path)
    assert code == 0
    assert said in out and "servo from" in out
    _, out, _ = call(capsys, "inspect", path, "--json", "-")
    assert json.loads(out)["leg_gains"].startswith(said)
    file.unlink()
    _, out, _ = call(capsys, "inspect", path, "--json", "-")
    assert json.loads(out)["leg_gains"] == model.gains != ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["inspect", "noise.bin"], "neither a gait library nor a robot"),
        (["inspect", "empty.xml"], "empty.xml: it is empty"),
        (["inspect", "missing.xml"], "missing.xml: no such file"),
        (["inspect", "no_robot"], "no such file and no robot of that name"),
        (["inspect", "res", "-o", "a.png"], "--output: res is a robot of boxes"),
        (["inspect", "x.gait", "--profile", "p.toml"], "x.gait is a gait library"),
        (["inspect", "toy.xml", "--profile", "nope.toml"], "nope.toml: No such file"),
        (["inspect", "toy.xml", "-o", "/"], "/: cannot be written"),
        (["walk", "toy.gait", "--profile", "p.toml"], "give --robot"),
        (["walk", "--profile", "p.toml"], "profile p.toml: res is a robot of boxes"),
        (
            ["build", "res", "-o", "x.gait", "--profile", "nope.toml"],
            "a profile is for a robot's MJCF or URDF",
        ),
        (
            ["build", "toy.xml", "-o", "o.gait", "--preset", "table1"],
            "use 'default'",
        ),
    ],
)
def test_bad_input_is_told_in_one_line(words, message, tmp_path, capsys):
    (tmp_path / "noise.bin").write_bytes(bytes(range(1, 40)))
    (tmp_path / "empty.xml").write_text("", "utf-8")
    (tmp_path / "toy.xml").write_text(toy(), "utf-8")
    code, _, err = call(capsys, *words)
    assert code == 2
    assert err.startswith("gaitchain: ")
    assert err.count("\n") == 1
    assert message in err


@pytest.mark.slow
def test_the_walk_of_a_full_robot_is_recorded_by_its_own_names(
    toy_library, toy_path, tmp_path, capsys
):
    save_library(toy_library, tmp_path / "toy.gait")
    code, _, err = call(
        capsys, "walk", "toy.gait", "--robot", toy_path,
        "--schedule", "0.1,0,0@2", "--out", "walk",
    )  # fmt: skip
    assert (code, err.count("gaitchain:")) == (0, 0)
    assert json.loads((tmp_path / "walk" / "walk.json").read_text())["fell"] is False
    record = load_record(tmp_path / "walk" / "walk.rec")
    own = toy_library.robot.legs
    assert record.joint_names == own.joint_names
    assert isinstance(record.robot.legs, LegModel)
    assert record.robot.fingerprint == toy_library.robot.fingerprint
    assert record.target.shape == (len(record.time_s), 12)
    weak = record.joint_names.index("right_knee")
    limits = tuple(0.5 if j == weak else 500.0 for j in range(12))
    save_record(replace(record, torque_limit=limits), tmp_path / "weak.rec")
    found = explain(record.robot, load_record(tmp_path / "weak.rec")).findings
    broken = [f for f in found if f.rule is Rule.TORQUE]
    assert {f.joint for f in broken} == {"right_knee"}
    assert {f.limit for f in broken} == {0.5}


@pytest.mark.slow
def test_a_fall_names_the_robots_own_joint(toy_library, tmp_path, capsys):
    save_library(toy_library, tmp_path / "toy.gait")
    code, _, _ = call(
        capsys, "walk", "toy.gait", "--schedule", "0.2,0,0@6",
        "--push", "40@90@3", "--torque-limit", "0.3", "--out", "walk",
    )  # fmt: skip
    assert code == 1
    code, out, _ = call(capsys, "explain", "walk", "--json", "why.json")
    assert code == 0
    findings = json.loads((tmp_path / "why.json").read_text())["findings"]
    joints = {f["joint"] for f in findings} - {None}
    assert joints
    assert joints <= set(toy_library.robot.legs.joint_names)
    assert (tmp_path / "walk" / "timeline.png").stat().st_size > 20_000
    assert "joint_torque_limit" not in out


def changed(robot, **arrays):
    return with_legs(robot, replace(robot.legs, **arrays))


def test_a_library_for_another_robot_says_what_differs(toy_library, toy_path, res):
    robot = toy_library.robot
    full = robot.legs
    check_robot(toy_library, load_robot(toy_path))
    check_robot(toy_library, changed(robot, stand=full.stand + 1e-12))
    stiff = full.stiffness.copy()
    stiff[:2] = 250.0
    heavy = full.link_mass.copy()
    heavy[1, 3] = 2.0
    names = ("left_z", *full.joint_names[1:])
    held = {**full.held, "left_shoulder": 0.5}
    for other, message in (
        (
            changed(robot, stiffness=stiff),
            r"kp of left_yaw .* 300 / 250 and 1",
        ),
        (
            changed(robot, link_mass=heavy),
            "mass of the link at right_knee .* 0.6 / 2",
        ),
        (changed(robot, joint_names=names), "leg joint left_yaw / left_z"),
        (changed(robot, held=held), "held angle of left_shoulder .* 0 / 0.5"),
        (res, "12 joints of a full robot / a robot of boxes"),
    ):
        with pytest.raises(LibraryError, match=message):
            check_robot(toy_library, other)


def test_the_file_keeps_the_anatomy(toy_library, tmp_path):
    save_library(toy_library, tmp_path / "toy.gait")
    loaded = load_library(tmp_path / "toy.gait", toy_library.robot)
    assert loaded.robot.fingerprint == toy_library.robot.fingerprint
    for name, array in toy_library.robot.legs.arrays().items():
        assert np.array_equal(loaded.robot.legs.arrays()[name], array)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robotis_op3/op3.xml", "unitree_g1/g1.xml"])
def test_inspect_of_vendors_robots(name, tmp_path, capsys):
    if not (REAL / name).is_file():
        pytest.skip(f"no {REAL / name}; set MENAGERIE_ROOT")
    code, out, err = call(capsys, "inspect", REAL / name, "-o", "robot.png")
    assert (code, err) == (0, "")
    assert "what was found" in out
    assert (tmp_path / "robot.png").stat().st_size > 20_000


def test_inspect_says_what_was_not_walked_and_what_cannot_be_drawn(
    toy_library, tmp_path, capsys
):
    own = OwnReport(passed=False, fault="toy.xml cannot be simulated as it is: why")
    verdicts = replace(toy_library.qualification, own=own)
    config = replace(toy_library.config, robot="gone/toy.xml")
    path = tmp_path / "toy.gait"
    save_library(replace(toy_library, qualification=verdicts, config=config), path)
    code, out, _ = call(capsys, "inspect", path)
    assert code == 0
    words = " ".join(re.sub(r"[^\w.:,\'/-]+", " ", out).split())
    assert "qualified yes, but not in the robot's own model" in words
    assert "in the robot's own model NOT WALKED: toy.xml cannot be" in words
    assert "gone/toy.xml: no such file to draw the robot from; work in" in out
