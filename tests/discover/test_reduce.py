"""Full robots reduced to their legs' anatomy, against MuJoCo's model of the whole."""

import os
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_file import toy as toy_file
from toy_robot import Builder, Toy, built, tie_hip_pitches
from whole_robot import Whole

from gaitchain.balance.leg_kinematics import com_from_pelvis, legs_of, posture
from gaitchain.discover.find import find
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.reduce import reduce
from gaitchain.errors import RobotFileError
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.sim.model import build_model

RES = load_box_robot("res")
SHARED = Path(__file__).parents[3] / "shared" / "robots"
REAL = Path(os.environ.get("MENAGERIE_ROOT") or SHARED)
STOCK = ("robotis_op3/op3.xml", "unitree_g1/g1.xml")
SEEDS = st.integers(0, 2**32 - 1)


def reduced(toy, seed=0):
    model, builder = built(toy, seed)
    found = find(model, "toy")
    return model, builder, found, reduce(model, found, "toy")


def check_whole(whole, tolerance=1e-6):
    """Dynamics and soles of the skeleton are the whole robot's."""
    theirs, ours = whole.masses()
    np.testing.assert_allclose(ours, theirs, atol=tolerance * np.abs(theirs).max())
    scale = np.abs(whole.data.qfrc_bias).max()
    bias = whole.motion.T @ whole.data.qfrc_bias
    np.testing.assert_allclose(
        whole.skeleton.qfrc_bias, bias, atol=tolerance * scale, err_msg="gravity"
    )
    rates = whole.rng.uniform(-3.0, 3.0, len(whole.dofs))
    whole.data.qvel[whole.dofs] = whole.skeleton.qvel[6:] = rates
    whole.forward()
    bias = whole.motion.T @ whole.data.qfrc_bias
    np.testing.assert_allclose(
        whole.skeleton.qfrc_bias, bias, atol=tolerance * np.abs(bias).max()
    )
    check_com(whole, tolerance)
    soles = whole.soles()
    np.testing.assert_allclose(soles[1], soles[0], atol=1e-4)


def check_com(whole, tolerance):
    """Mass and CoM, by the skeleton and by what walks online."""
    base = whole.model.body(whole.found.base).id
    mass = float(whole.model.body_subtreemass[base])
    assert whole.robot.reduced.mass == pytest.approx(mass, rel=1e-9)
    com = whole.data.subtree_com[base]
    np.testing.assert_allclose(whole.skeleton.subtree_com[1], com, atol=tolerance)
    legs = legs_of(whole.robot)
    mine = com_from_pelvis(legs, posture(legs, whole.angles))
    seen = (com - whole.skeleton.body("trunk").xpos) @ whole.turn
    np.testing.assert_allclose(mine, seen, atol=1e-9)


# --- the box robot, read from its own model


@pytest.fixture(scope="module")
def read_back():
    model = build_model(RES)
    return reduce(model, find(model, "res"), "res")


def test_the_boxes_numbers_come_back(read_back):
    full, box = read_back.legs, box_legs(RES.reduced)
    assert full.joint_names == box.joint_names
    assert full.knee == box.knee
    assert full.held == {}
    for name, expected in box.arrays().items():
        if name != "stand":  # of its own choice
            np.testing.assert_allclose(getattr(full, name), expected, atol=1e-12)


@pytest.mark.parametrize(
    "name",
    [
        "crus_length",
        "femur_length",
        "trunk_length",
        "ankle_height",
        "hip_width",
        "sole_length",
        "sole_width",
        "sole_offset",
        "crus_mass",
        "femur_mass",
        "trunk_mass",
        "foot_mass",
        "joint_angle_limit",
        "joint_speed_limit",
        "joint_torque_limit",
        "servo_stiffness",
        "servo_damping",
        "joint_armature",
    ],
)
def test_the_reduced_bipeds_numbers_come_back(read_back, name):
    assert getattr(read_back.reduced, name) == pytest.approx(
        getattr(RES.reduced, name), abs=1e-9
    )


def test_what_was_reduced_reduces_to_itself(read_back):
    """Its skeleton, read as a robot's file, is the same robot again."""
    model = build_model(read_back)
    again = reduce(model, find(model, "res"), "res").legs
    for name, array in read_back.legs.arrays().items():
        if name != "stand":
            np.testing.assert_allclose(getattr(again, name), array, atol=1e-9)


# --- toys


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ("pos|size|fromto", "crus_length is 200 m, .* 2 m .* in mm, divide"),
        ("mass", "crus_mass is 700 kg, .* 200 kg .* in g, divide"),
    ],
)
def test_files_in_other_units_are_refused(tmp_path, numbers, message):
    def larger(found):
        values = " ".join(str(1e3 * float(v)) for v in found[2].split())
        return f'{found[1]}="{values}"'

    path = tmp_path / "toy.xml"
    text = re.sub(rf'\b({numbers})="([^"]*)"', larger, toy_file())
    path.write_text(text, "utf-8")
    with pytest.raises(RobotFileError, match=message):
        load_with_findings(path)


WAIST_TOY = Toy(waist=True)
TOYS = {
    "plain": Toy(),
    "waist": WAIST_TOY,
    "welded soles": Toy(foot="welded"),
    "toes": Toy(toes=True),
    "drawn bent": Toy(bent=0.5),
    "other order": Toy(hip=("roll", "pitch", "yaw"), ankle=("roll", "pitch")),
    "five joints": Toy(hip=("roll", "pitch")),
    "turned": Toy(turn=-0.7, tilt=0.3, signs=0b1011010, waist=True, toes=True),
}


@pytest.mark.parametrize("name", TOYS)
def test_a_toys_skeleton_moves_as_the_toy(name):
    model, _, found, robot = reduced(TOYS[name])
    for seed in range(3):
        check_whole(Whole(model, found, robot, seed))


@pytest.mark.slow
@settings(max_examples=10)
@given(
    toy=st.builds(
        Toy,
        turn=st.sampled_from([0.0, 0.5 * np.pi, np.pi, -0.7]),
        tilt=st.sampled_from([0.0, 0.5 * np.pi, 0.3]),
        signs=st.integers(0, 2**20 - 1),
        left_first=st.booleans(),
        waist=st.booleans(),
        toes=st.booleans(),
        foot=st.sampled_from(["box", "welded"]),
    ),
    seed=SEEDS,
)
def test_any_toys_skeleton_moves_as_the_toy(toy, seed):
    model, _, found, robot = reduced(toy, seed % 10)
    check_whole(Whole(model, found, robot, seed))


@pytest.mark.parametrize("turn", [0.5 * np.pi, np.pi, -0.7])
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_the_bases_own_axes_do_not_matter(turn, tilt):
    """But for where the file's base is in the pelvis frame."""
    plain, other = (reduced(toy)[3].legs for toy in (Toy(), Toy(turn=turn, tilt=tilt)))
    assert other.joint_names == plain.joint_names
    for name, array in plain.arrays().items():
        if not name.startswith("base_"):
            atol = 2e-3 if name == "stand" else 1e-6
            np.testing.assert_allclose(getattr(other, name), array, atol=atol)
    expected = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    if tilt == 0.0:
        np.testing.assert_allclose(other.base_turn[:2, :2], expected, atol=1e-6)


def test_signs_turn_axes_and_ranges_about():
    plain, other = (reduced(Toy(signs=s))[3].legs for s in (0, 2**20 - 1))
    np.testing.assert_allclose(other.axis, -plain.axis, atol=1e-9)
    np.testing.assert_allclose(other.lower, -plain.upper, atol=1e-9)
    np.testing.assert_allclose(other.stand, -plain.stand, atol=2e-3)
    np.testing.assert_allclose(other.at, plain.at, atol=1e-9)
    np.testing.assert_allclose(other.com, plain.com, atol=1e-9)


def test_waist_arms_and_toes_are_held_where_they_stand():
    toy = Toy(waist=True, toes=True)
    _, builder, found, robot = reduced(toy)
    full = robot.legs
    others = {n: a for n, a in found.stand.items() if n not in full.joint_names}
    assert dict(full.held) == others
    assert builder.made["waist"][0] in full.held
    assert builder.made[0, "toe"][0] in full.held
    assert len(full.held) == 1 + 6 + 2


def test_the_toes_belong_to_the_foot():
    plain, toed = (reduced(Toy(toes=toes))[3] for toes in (False, True))
    more = toed.legs.link_mass - plain.legs.link_mass
    assert more[0, -1] == more[1, -1] > 0.0
    assert more[:, :-1] == pytest.approx(0.0)
    assert toed.reduced.sole_length == pytest.approx(
        plain.reduced.sole_length + 0.04, abs=2e-3
    )


def test_a_sole_that_tapers_keeps_its_corners_and_stands_on_them():
    toy = Toy(foot="wedge", heel=0.03)  # narrow where the ankle is
    *_, robot = reduced(toy)
    assert reduced(Toy())[-1].legs.soles == ()
    rear, front, half = -toy.heel, toy.forefoot, 0.04
    expected = [(rear, 0.0), (front, -half), (front, half)]
    for sole in robot.legs.soles:
        np.testing.assert_allclose(sorted(sole), expected, atol=1e-6)
    assert len(robot.legs.soles) == 2
    assert 2.0 * robot.reduced.sole_width == pytest.approx(2.0 * half), "equal area"
    model = build_model(robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = robot.legs.stand
    mujoco.mj_forward(model, data)
    feet = [model.body(f"{side}_foot").id for side in ("left", "right")]
    data.qpos[2] -= data.xpos[feet, 2].mean() - robot.reduced.ankle_height + 1e-4
    mujoco.mj_forward(model, data)
    for foot in feet:
        own = [c for c in data.contact if foot in model.geom_bodyid[c.geom]]
        turn = data.xmat[foot].reshape(3, 3)
        touched = sorted(((c.pos - data.xpos[foot]) @ turn).tolist() for c in own)
        assert len(touched) == 3
        np.testing.assert_allclose([at[:2] for at in touched], expected, atol=1e-3)


def test_held_joints_move_the_trunks_com():
    """An arm that is held elsewhere weighs elsewhere."""
    model, builder = built(Toy())
    found = find(model, "toy")
    arm = builder.made["arm1.00"][0]
    lifted = replace(found, stand=found.stand | {arm: found.stand[arm] - 1.2})
    robot, other = reduce(model, found, "toy"), reduce(model, lifted, "toy")
    off = other.legs.trunk_com - robot.legs.trunk_com
    assert off[0] > 1e-3
    assert other.reduced.mass == robot.reduced.mass
    check_whole(Whole(model, lifted, other, 0))


def test_coupled_leg_joints_are_held():
    """A joint that an equality holds is none of the leg's own."""
    builder = Builder(Toy(hip=("yaw", "roll", "pitch", "pitch")))
    tie_hip_pitches(builder, 0.0)
    model = builder.model()
    found = find(model, "toy")
    robot = reduce(model, found, "toy")
    assert builder.made[0, "hip_pitch"][0] in robot.legs.held
    check_whole(Whole(model, found, robot, 0))


# --- robots of vendors


@pytest.fixture(scope="module", params=STOCK)
def stock(request):
    path = REAL / request.param
    if not path.is_file():
        pytest.skip(f"no {path}; set MENAGERIE_ROOT")
    return load_with_findings(path)


@pytest.mark.parametrize("seed", range(3))
def test_a_vendors_robot_moves_as_its_skeleton(stock, seed):
    check_whole(Whole(stock.model, stock.findings, stock.robot, seed))


def test_a_vendors_joints_servos_and_ranges_are_the_files(stock):
    full, model = stock.robot.legs, stock.model
    for i, name in enumerate(full.joint_names):
        joint = model.joint(name)
        limited = model.jnt_limited[joint.id]
        expected = joint.range if limited else [-np.pi, np.pi]
        np.testing.assert_array_equal([full.lower[i], full.upper[i]], expected)
        dof = int(joint.dofadr[0])
        assert full.armature[i] == (model.dof_armature[dof] or full.armature[i])
        assert full.friction_loss[i] == model.dof_frictionloss[dof]
        assert full.joint_damping[i] == min(model.dof_damping[dof], full.damping[i])
        servo = stock.findings.servos[name]
        assert full.stiffness[i] == servo.stiffness
        assert full.torque_limit[i] == servo.torque_limit
        assert full.speed_limit[i] <= servo.speed_limit
