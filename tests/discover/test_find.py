"""Legs, soles and stance of toy robots whose names, order and frames say nothing."""

import math
import os
import re
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robot_text import write
from toy_file import toy as toy_file
from toy_robot import (
    ANKLE,
    ANKLE_HEIGHT,
    AXES,
    GEOM,
    HIP,
    Builder,
    Toy,
    built,
    quat,
    tie_hip_pitches,
)
from toy_urdf import toy_urdf

from gaitchain.discover.find import find
from gaitchain.discover.load import load_model
from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.discover.profile import Profile, parse_profile
from gaitchain.discover.reduce import reduce
from gaitchain.discover.sole import corners_of, outline_of
from gaitchain.errors import RobotFileError
from gaitchain.figures.robot import draw_robot
from gaitchain.figures.style import drawing
from gaitchain.sim.model import build_model

STOCK = {
    "robotis_op3/op3.xml": ("l_knee", "l_ank_roll_link", 0.077),
    "unitree_g1/g1.xml": ("left_knee_joint", "left_ankle_roll_link", 0.05),
    "booster_t1/t1.xml": ("Left_Knee_Pitch", "left_foot_link", 0.1),
    "pal_talos/talos.xml": ("leg_left_4_joint", "leg_left_6_link", 0.12),
}


def check_standing(model, found):
    """Let MuJoCo judge: soles level, on one height, apart, under the CoM."""
    robot = PinnedRobot(model, model.body(found.base).id, found.up, found.forward)
    pose = np.array(robot.neutral)
    for joint in robot.joints:
        pose[robot.address(joint)] = found.stand[robot.joint_name(joint)]
        low, high = robot.bounds(joint)
        assert low - 1e-9 <= pose[robot.address(joint)] <= high + 1e-9
    robot.place(pose)
    feet, centres = [], []
    for leg in found.legs:
        foot = model.body(leg.sole.body).id
        turn = robot.turn(foot) @ leg.sole.rotation
        assert np.linalg.det(leg.sole.rotation) == pytest.approx(1.0)
        np.testing.assert_allclose(turn[:, 2], [0, 0, 1], atol=3e-3)
        np.testing.assert_allclose(turn[:, 0], [1, 0, 0], atol=2e-2)
        feet.append(robot.point(foot, leg.sole.origin))
        centres.append(robot.point(foot, leg.sole.centre))
    left, right = feet
    assert left[1] > right[1]
    assert left[2] == pytest.approx(right[2], abs=2e-3)
    assert left[0] == pytest.approx(right[0], abs=3e-3)
    com = robot.com()
    assert com[0] == pytest.approx(np.mean(centres, axis=0)[0], abs=3e-3)
    widths = found.left.sole.half_width + found.right.sole.half_width
    assert left[1] - right[1] > 1.05 * widths
    for leg in found.legs:  # knees ahead of the line from hip to ankle
        ids = [model.joint(j).id for j in leg.joints]
        knee, ends = robot.anchor(ids[leg.knee]), (ids[0], ids[-1])
        assert knee[0] > min(robot.anchor(j)[0] for j in ends)
    return robot


def check_toy(toy, model, builder, found):
    """Compare with how the toy was built."""
    keys = [*(f"hip_{k}" for k in toy.hip), "knee", *(f"ankle_{k}" for k in toy.ankle)]
    for number, leg in enumerate(found.legs):
        assert leg.joints == tuple(builder.made[number, k][0] for k in keys)
        name, sign = builder.made[number, "knee"]
        assert leg.joints[leg.knee] == name
        assert leg.knee_bends == sign
    robot = PinnedRobot(model, model.body("base").id, found.up, found.forward)
    ahead = robot.turn(model.body("inner").id)[:, 0]
    np.testing.assert_allclose(ahead, [1, 0, 0], atol=1e-2)
    check_standing(model, found)


@pytest.mark.slow
@settings(max_examples=12)
@given(
    toy=st.builds(
        Toy,
        hip=st.permutations(HIP).map(tuple),
        ankle=st.permutations(ANKLE).map(tuple),
        turn=st.sampled_from([0.0, 0.5 * np.pi, np.pi, -0.7]),
        tilt=st.sampled_from([0.0, 0.5 * np.pi, 0.3]),
        signs=st.integers(0, 2**20 - 1),
        left_first=st.booleans(),
        waist=st.booleans(),
        arms=st.booleans(),
    ),
    seed=st.integers(0, 9),
)
def test_toys_of_any_order_name_and_frame(toy, seed):
    model, builder = built(toy, seed)
    check_toy(toy, model, builder, find(model, "toy"))


@pytest.mark.parametrize(
    ("foot", "front", "rear", "half"),
    [
        ("box", 0.13, -0.07, 0.04),
        ("pair", 0.13, -0.07, 0.04),
        ("visual", 0.13, -0.07, 0.04),
        ("spheres", 0.13, -0.07, 0.04),
        ("ellipsoids", 0.13, -0.07, 0.04),
        ("capsules", 0.13, -0.07, 0.04),
        ("welded", 0.13, -0.07, 0.04),
        ("mesh", 0.13, -0.07, 0.04),
    ],
)
def test_soles_of_every_shape(foot, front, rear, half):
    model, builder = built(Toy(foot=foot))
    found = find(model, "toy")
    check_toy(builder.toy, model, builder, found)
    for leg in found.legs:
        sole = leg.sole
        assert (sole.front, sole.rear) == pytest.approx((front, rear), abs=2e-3)
        assert sole.half_width == pytest.approx(half, abs=1e-3)
        assert sole.origin @ sole.rotation[:, 2] == pytest.approx(
            -ANKLE_HEIGHT, abs=1e-4
        )
        x, y = sole.outline.T
        area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert area > 0.9 * 2.0 * half * (front - rear)  # counter-clockwise
    told = " ".join(" ".join(row) for row in found.evidence)
    assert ("as none of it collides" in told) == (foot == "visual")
    assert ("none of its shapes collides" in told) == (foot == "visual")
    assert ("contact pairs" in told) == (foot == "pair")


@pytest.mark.parametrize("turn", [0.3, -0.7, 2.0])
@pytest.mark.parametrize("digits", [9, 6, 4])
def test_a_sole_is_no_shorter_by_rounded_numbers(turn, digits):
    """It was, by a step of the grid."""
    _, builder = built(Toy())
    for number in range(2):
        sole = builder.spec.geom(f"sole{number}")
        roll = builder.spec.joint(builder.made[number, "ankle_roll"][0])
        roll.parent.quat = np.round(quat((0, 0, 1), turn), digits)
        sole.quat = quat((0, 0, 1), -turn)
        way = np.array([np.cos(turn), -np.sin(turn), 0.0])  # ahead
        sole.pos = sole.pos[0] * way + [0, 0, sole.pos[2]]
        roll.axis = roll.axis[0] * way
    for leg in find(builder.spec.compile(), "toy").legs:
        sole, within = leg.sole, 3.0 * 10.0**-digits + 1e-9
        assert sole.front - sole.rear == pytest.approx(0.2, abs=within)
        assert 2.0 * sole.half_width == pytest.approx(0.08, abs=within)


def test_a_round_sole_holds_its_rectangle():
    model, _ = built(Toy(foot="cylinder"))
    sole = find(model, "toy").left.sole
    corners = np.array([sole.front, sole.rear])[:, None] - 0.02
    assert np.hypot(corners, sole.half_width).max() < 0.0801
    assert sole.half_width > 0.04


@given(
    st.lists(
        st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=3, max_size=20
    )
)
def test_few_corners_make_up_most_of_an_outline(points):
    outline = outline_of(np.array(points, dtype=float))
    corners = corners_of(outline)
    assert len(corners) == min(len(outline), 6)
    at = [np.flatnonzero((outline == corner).all(axis=1))[0] for corner in corners]
    assert at == sorted(at), "in their order"
    if len(outline):  # at least what a regular hexagon has of its circle
        assert area_of(corners) >= 0.82 * area_of(outline)


def area_of(polygon):
    x, y = polygon.T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_a_curved_bottom_is_said():
    model, _ = built(Toy(foot="rocker"))
    found = find(model, "toy")
    assert any("curved" in row[2] for row in found.evidence)
    assert found.left.sole.front - found.left.sole.rear > 0.05


@pytest.mark.parametrize(
    ("hip", "ankle"),
    [
        (("roll", "pitch"), ANKLE),
        (("yaw", "roll", "pitch"), ("pitch",)),
        (("yaw", "roll", "pitch", "yaw"), ANKLE),
    ],
)
def test_legs_of_five_and_seven_joints(hip, ankle):
    toy = Toy(hip=hip, ankle=ankle)
    model, builder = built(toy)
    found = find(model, "toy")
    assert len(found.left.joints) == len(hip) + len(ankle) + 1
    assert found.left.joints[found.left.knee] == builder.made[0, "knee"][0]
    check_standing(model, found)


def test_a_hip_axis_that_leans_turns_the_robot_and_bears_load(monkeypatch):
    """As the hip rolls of T1 and G1 lean, where these stand on bent legs."""
    monkeypatch.setitem(AXES, "yaw", (math.sqrt(1.0 - 0.65**2), 0.0, 0.65))
    model, builder = built(Toy(servo="none"))
    found = find(model, "toy")
    assert "turning" not in [row[0] for row in found.evidence]
    leans, bears = (
        found.servos[builder.made[0, name][0]].stiffness for name in ("hip_yaw", "knee")
    )
    assert leans == bears


@pytest.mark.parametrize("bent", [0.0, 0.6, 1.2])
def test_the_drawn_pose_may_squat(bent):
    toy = Toy(bent=bent)
    model, builder = built(toy)
    check_toy(toy, model, builder, find(model, "toy"))


def test_symmetric_feet_and_knees_go_along_x():
    toy = Toy(forefoot=0.1, heel=0.1, knee_range=(-2.0, 2.0))
    model, builder = built(toy)
    check_toy(toy, model, builder, find(model, "toy"))


def test_feet_outvote_the_base_axis():
    toy = Toy(turn=np.pi)  # as iCub's base looks backward
    model, _ = built(toy)
    found = find(model, "toy")
    np.testing.assert_allclose(found.forward, [-1, 0, 0], atol=1e-6)


def test_front_and_back_alike_ask_for_the_key():
    toy = Toy(forefoot=0.1, heel=0.1, knee_range=(-2.0, 2.0), turn=0.5 * np.pi)
    model, _ = built(toy)
    with pytest.raises(
        RobotFileError, match=r"look alike .* give forward in a profile"
    ):
        find(model, "toy")
    told = find(model, "toy", Profile(forward=(0.0, -1.0, 0.0)))
    np.testing.assert_allclose(told.forward, [0, -1, 0], atol=1e-6)


def test_toes_are_part_of_the_foot():
    toy = Toy(toes=True)
    model, builder = built(toy)
    found = find(model, "toy")
    assert found.left.passive == (builder.made[0, "toe"][0],)
    assert found.left.sole.front == pytest.approx(0.17, abs=2e-3)
    assert found.servos[found.left.passive[0]].source == "passive"
    check_toy(toy, model, builder, found)


@pytest.mark.parametrize("shape", ["drawn", "none", "across"])
@pytest.mark.parametrize("shift", [0.0, 0.06])
def test_toes_that_touch_nothing_are_of_the_foot_but_not_of_its_sole(shape, shift):
    """Whatever is drawn of them: what touches the floor is the foot alone."""
    builder = Builder(Toy(toes=True, forefoot=0.13 - shift))

    def hide():
        for number in range(2):
            toe = builder.spec.joint(builder.made[number, "toe"][0])
            (drawn,) = toe.parent.geoms
            drawn.contype = drawn.conaffinity = 0
            if shape == "none":
                builder.spec.delete(drawn)
            if shape == "across":
                toe.axis = [1, 0, 0]

    model = with_more(builder, hide)
    found = find(model, "toy")
    plain, _ = built(Toy(forefoot=0.13 - shift))
    sole, same = found.left.sole, find(plain, "toy").left.sole
    assert found.left.passive == (builder.made[0, "toe"][0],)
    assert len(found.left.joints) == 6
    assert (sole.front, sole.rear) == pytest.approx((same.front, same.rear))


def test_long_toes_that_were_taken_for_the_foot_are_named():
    builder = Builder(Toy(toes=True, forefoot=0.04, heel=0.01))

    def lengthen():
        for number in range(2):
            toe = builder.spec.joint(builder.made[number, "toe"][0]).parent
            toe.geoms[0].size, toe.geoms[0].pos = [0.06, 0.04, 0.01], [0.07, 0, 0]

    model = with_more(builder, lengthen)
    words = (
        r"above the sole; .* give sole\.front .* or legs\.left and legs\.right where"
    )
    with pytest.raises(RobotFileError, match=words):
        find(model, "toy")


def test_a_foot_drawn_under_an_ankle_that_collides_is_no_toe():
    """What collides is far above it, so that the foot lost its own shapes."""
    builder = Builder(Toy(foot="visual", ankle=("roll", "pitch")))

    def pad():
        for number in range(2):
            link = builder.spec.joint(builder.made[number, "ankle_roll"][0]).parent
            builder.box(link, (0.01, 0.01, 0.01), (0, 0, 0))

    found = find(with_more(builder, pad), "toy")
    assert (len(found.left.joints), found.left.passive) == (6, ())
    assert found.left.sole.front == pytest.approx(0.13, abs=2e-3)


@pytest.mark.parametrize("ankle", [("pitch", "roll"), ("roll", "pitch")])
def test_the_last_joint_of_an_ankle_is_no_toe_on_a_link_just_as_low(ankle):
    builder = Builder(Toy(ankle=ankle))

    def widen():
        for number in (0, 1):
            link = builder.spec.joint(builder.made[number, f"ankle_{ankle[0]}"][0])
            builder.box(link.parent, (0.06, 0.04, 0.01), (0, 0, 0.01 - ANKLE_HEIGHT))

    model = with_more(builder, widen)
    found = find(model, "toy")
    assert (len(found.left.joints), found.left.passive) == (6, ())
    check_toy(builder.toy, model, builder, found)


@pytest.mark.parametrize("curve", [(0.0, 1.0), (0.1, -0.5), (0.0, 1.0, 0.0, 0.2)])
@pytest.mark.parametrize("leads", [False, True])
def test_of_two_coupled_joints_the_undriven_one_follows(curve, leads):
    builder = Builder(Toy())

    def couple():
        knee = builder.made[0, "knee"][0]
        pointer = builder.body(builder.spec.joint(knee).parent, [0, 0, 0], 0.05)
        joint = builder.hinge(pointer, "pitch", "pointer", (-9, 9), driven=False)
        tie = builder.spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT)
        tie.name1, tie.name2 = (knee, joint.name) if leads else (joint.name, knee)
        tie.data[: len(curve)] = curve

    model = with_more(builder, couple)
    found = find(model, "toy")
    check_toy(builder.toy, model, builder, found)
    names = [builder.made[0, "knee"][0], builder.made["pointer"][0]]
    knee, pointer = (found.stand[n] for n in names)
    first, second = (knee, pointer) if leads else (pointer, knee)
    assert knee > 0.3
    assert first == pytest.approx(np.polynomial.polynomial.polyval(second, curve))


def test_a_tendon_that_is_driven_is_no_driven_leg_joint():
    builder = Builder(Toy(servo="none"))

    def pull():
        for number in range(8):  # so that the last has the number of a leg's joint
            tendon = builder.spec.add_tendon(name=f"tendon{number}")
            tendon.wrap_joint(builder.made["arm1.00"][0], 1.0)
        kind = mujoco.mjtTrn.mjTRN_TENDON
        builder.spec.add_actuator(target=tendon.name, trntype=kind)

    model = with_more(builder, pull)
    found = find(model, "toy")
    reached = model.joint(int(model.actuator_trnid[0, 0])).name
    assert reached in found.left.joints + found.right.joints
    assert [len(leg.joints) for leg in found.legs] == [6, 6]


def with_more(builder, add):
    """Build a toy with what a test adds before its servos."""
    original = builder.servos

    def servos():
        add()
        original()

    builder.servos = servos
    return builder.model()


def test_a_joint_that_moves_with_one_that_walks_is_refused():
    """Held, it would be right in the standing pose and wrong in every other."""
    builder = Builder(Toy(hip=("yaw", "roll", "pitch", "pitch")))
    tie_hip_pitches(builder, 0.5)
    model = builder.model()
    tied = builder.made[0, "hip_pitch"][0]
    with pytest.raises(RobotFileError, match=f"{tied} is between hip and foot"):
        find(model, "toy")


def found_with(tmp_path, old, new):
    path = tmp_path / "toy.xml"
    path.write_text(toy_file().replace(old, new), "utf-8")
    return load_with_findings(path)


@pytest.mark.parametrize("gear", [1.0, -2.0])
def test_a_joint_goes_no_further_than_its_servo_can_be_told(tmp_path, gear):
    ends = sorted((0.0, 1.3 * gear))
    limits = 'gear="{}" ctrllimited="true" ctrlrange="{} {}"'.format(gear, *ends)
    loaded = found_with(tmp_path, '_knee" kp=', f'_knee" {limits} kp=')
    legs = loaded.robot.legs
    knees = [legs.joint_names.index(f"{side}_knee") for side in ("left", "right")]
    np.testing.assert_allclose(legs.upper[knees], 1.3)
    assert max(legs.stand[knees]) <= 1.3
    rows = {what: (found, why) for what, found, why in loaded.findings.evidence}
    found, why = rows["range of left_knee"]
    assert found == "0 to 74.5 deg"
    assert "0 to 126 deg" in why


def test_servos_that_cannot_bend_a_knee_are_named(tmp_path):
    limits = 'ctrllimited="true" ctrlrange="0 0.1"'
    named = r"2 joints \(left_knee, right_knee\) by the ctrlrange of the servo"
    with pytest.raises(RobotFileError, match=named):
        found_with(tmp_path, '_knee" kp=', f'_knee" {limits} kp=')


def test_springs_that_pull_where_it_stands_are_told_or_refused(tmp_path):
    knee = 'name="left_knee" axis="0 1 0"'
    loaded = found_with(tmp_path, knee, f'{knee} stiffness="10" springref="0"')
    bent = loaded.findings.stand["left_knee"]
    rows = {what: (found, why) for what, found, why in loaded.findings.evidence}
    assert rows["leg springs"][0] == "1 not planned with"
    assert f"{10.0 * bent:.3g} N m of 60 N m at left_knee" in rows["leg springs"][1]
    with pytest.raises(RobotFileError, match=r"springs take .* of 60 N m at left_knee"):
        found_with(tmp_path, knee, f'{knee} stiffness="100" springref="0"')


def test_a_ball_joint_in_a_leg_is_refused(tmp_path):
    tilt = '<joint name="left_tilt" axis="1 0 0" range="-0.7 0.7"/>'
    servo = '<position joint="left_tilt" kp="300.0" kv="6" forcerange="-60 60"/>'
    assert tilt in toy_file() and servo in toy_file()
    path = tmp_path / "toy.xml"
    ball = toy_file().replace(tilt, '<joint name="left_tilt" type="ball"/>')
    path.write_text(ball.replace(servo, ""), "utf-8")
    told = Profile(foot={"left": "left6", "right": "right6"})
    loaded = load_model(path)
    with pytest.raises(RobotFileError, match="left_tilt in a leg is a ball joint"):
        find(loaded.model, "toy", told, balls=loaded.balls)


@pytest.mark.parametrize("gone", [("yaw",), HIP], ids=["beside hinges", "alone"])
def test_a_ball_joint_at_the_hip_is_refused(tmp_path, gone):
    """What hangs on it is welded to the base, and no link of the leg any more."""
    text = with_ball_hips(gone)
    loaded = load_model(write(tmp_path, text))
    with pytest.raises(RobotFileError, match="left_yaw in a leg is a ball joint"):
        find(loaded.model, "toy", balls=loaded.balls)


def test_legs_of_too_few_hinges_are_told_with_their_balls(tmp_path):
    ends = ("ankle", "tilt")
    path = write(tmp_path, with_ball_hips((*HIP, *ends), {"yaw", "ankle"}))
    welded = r"no legs: .*; the file: 4 ball joints \(left_yaw, .*\) welded as drawn"
    with pytest.raises(RobotFileError, match=welded):
        load_with_findings(path)


def with_ball_hips(gone, balls=frozenset({"yaw"})):
    """A toy without some hinges of its legs, and balls in the place of some."""
    text = toy_file()
    for name in (f"{side}_{joint}" for side in ("left", "right") for joint in gone):
        hinge = re.search(f'<joint name="{name}"[^>]*/>', text)[0]
        ball = f'<joint name="{name}" type="ball"/>'
        text = text.replace(hinge, ball if name.split("_")[1] in balls else "")
        text = re.sub(f'<position joint="{name}"[^>]*/>', "", text)
    return text


def test_a_ball_joint_that_both_legs_share_is_held(tmp_path):
    """As a waist, whose weld only makes the trunk one."""
    waist = '<body name="waist"><joint name="waist" type="ball"/><geom size=".02"/>'
    text = toy_file().replace('<body name="left1"', f'{waist}<body name="left1"')
    text = text.replace("</worldbody>", "</body></worldbody>")
    loaded = load_with_findings(write(tmp_path, text))
    assert "1 ball joint (waist) welded as drawn" in " ".join(loaded.notes)
    assert len(loaded.findings.left.joints) == 6


TIE = '</actuator><equality><joint joint1="{}" joint2="{}" polycoef="{}"/></equality>'


def without_actuators(*joints):
    text = toy_file()
    for name in joints:
        text, count = re.subn(f'<position joint="{name}"[^>]*/>', "", text)
        assert count == 1
    return text


@pytest.mark.parametrize(
    ("follower", "leader", "driven"),
    [
        ("right_yaw", "left_yaw", False),
        ("left_yaw", "right_yaw", False),
        ("right_yaw", "left_yaw", True),
    ],
)
def test_hips_that_one_motor_turns_are_both_held(tmp_path, follower, leader, driven):
    """As those of NAO."""
    text = without_actuators(*(() if driven else (follower,)))
    text = text.replace("</actuator>", TIE.format(follower, leader, "0 -1"))
    loaded = load_with_findings(write(tmp_path, text))
    found = loaded.findings
    assert [len(leg.joints) for leg in found.legs] == [5, 5]
    assert [leg.passive for leg in found.legs] == [("left_yaw",), ("right_yaw",)]
    (row,) = (row for row in found.evidence if row[0] == "turning")
    assert row[1] == "it will not turn"
    assert f"{leader} moves {follower} with it by an equality" in row[2]
    assert f"{follower} follows {leader} by an equality" in row[2]
    check_standing(loaded.model, found)


def test_a_joint_whose_actuator_is_missing_on_one_side_is_named(tmp_path):
    path = write(tmp_path, without_actuators("right_tilt"))
    with pytest.raises(RobotFileError) as caught:
        load_with_findings(path)
    assert str(caught.value).endswith(
        ": the legs have 6 and 5 driven joints, they must have the same number; "
        "right_tilt has no actuator; to settle it, give legs.left and legs.right in a "
        "profile, or actuators for right_tilt in the file"
    )
    joints = ("yaw", "roll", "pitch", "knee", "ankle", "tilt")
    legs = {side: [f"{side}_{name}" for name in joints] for side in ("left", "right")}
    model = load_model(path).model
    told = find(model, "toy", parse_profile({"legs": legs}, "p.toml"))
    assert told.servos["right_tilt"].source == "derived: none"


def test_a_servo_of_one_leg_that_is_unlike_the_others_is_told(tmp_path):
    text, count = re.subn(
        r'(<position joint="right_knee"[^>]*kp=")[^"]*', r"\g<1>77", toy_file()
    )
    assert count == 1
    (kp,) = re.findall(r'<position joint="left_knee"[^>]*kp="([^"]*)"', text)

    def told(file):
        evidence = load_with_findings(write(tmp_path, file)).findings.evidence
        return [row[1:] for row in evidence if row[0] == "left and right"]

    assert told(toy_file()) == []
    ((what, why),) = told(text)
    assert what == "their servos differ"
    assert f"left_knee kp {float(kp):g}, right_knee 77 N m/rad" in why


def test_legs_of_too_few_driven_joints_say_what_the_others_lack(tmp_path):
    text = without_actuators("left_tilt", "left_yaw")
    path = write(tmp_path, text)
    said = "4 driven joints .* among them; left_yaw has no actuator; left_tilt has no"
    with pytest.raises(RobotFileError, match=said):
        load_with_findings(path)


def test_legs_with_slides_are_told_so(tmp_path):
    """They are mirrored; that they are no hinges is what is wrong."""
    text = re.sub(
        r'<joint name="(\w+_yaw)"', r'<joint type="slide" name="\1"', toy_file()
    )
    assert text.count("slide") == 2
    with pytest.raises(RobotFileError, match="left_yaw in a leg is no hinge; legs"):
        load_with_findings(write(tmp_path, text))


def test_slides_outside_the_legs_are_held_where_the_profile_says():
    builder = Builder(Toy())

    def lift():
        head = builder.body(builder.spec.body("inner"), [0, 0, 0.3], 2.0)
        kind = mujoco.mjtJoint.mjJNT_SLIDE
        head.add_joint(name="lift", type=kind, axis=[0, 0, 1], range=[0.02, 0.2])

    model = with_more(builder, lift)
    plain = find(model, "toy")
    told = parse_profile({"stand": {"angles": {"lift": 0.15}}}, "p.toml")
    raised = find(model, "toy", told)
    assert plain.stand["lift"] == 0.02
    legs = [reduce(model, found, "toy").legs for found in (plain, raised)]
    assert [own.held["lift"] for own in legs] == [0.02, 0.15]
    rise = (legs[1].trunk_com - legs[0].trunk_com)[2]
    assert rise == pytest.approx(2.0 * 0.13 / legs[0].trunk_mass)


def test_offset_joints_use_qpos():
    builder = Builder(Toy())
    original = builder.servos

    def shift():
        for joint in builder.spec.joints:
            if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
                joint.ref = 0.2
                joint.range = joint.range + 0.2
        original()

    builder.servos = shift
    model = builder.model()
    check_toy(builder.toy, model, builder, find(model, "toy"))


def test_a_keyframe_tells_the_arms():
    model, builder = built(Toy())
    spec = builder.spec
    arm = builder.made["arm1.00"][0]
    qpos = np.array(model.qpos0)
    qpos[model.joint(arm).qposadr[0]] = 0.7
    lying = np.array(qpos)
    lying[3:7] = quat((0, 1, 0), 1.5)
    lying[model.joint(arm).qposadr[0]] = -0.9
    spec.add_key(name="lying", qpos=lying)
    spec.add_key(name="ready", qpos=qpos)
    found = find(spec.compile(), "toy")
    assert found.stand[arm] == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("toy", "words"),
    [
        (Toy(legs=0, arms=False), "no legs"),
        (Toy(legs=1, arms=False), "no mirror image: an arm or a single leg"),
        (Toy(legs=1), "no mirror image: an arm or a single leg"),
        (Toy(legs=4), "4 limbs reach the ground"),
        (Toy(legs=6), "6 limbs reach the ground"),
        (Toy(foot="wheel"), "rolls on wheels"),
        (Toy(foot="point"), r"no flat sole: 0\.000 m long.* at least about"),
        (Toy(ankle=(), foot="point"), "4 driven joints"),
        (Toy(knee_range=(0.0, 0.1), bent=0.05), "no standing pose"),
    ],
)
def test_refusals_name_their_reason(toy, words):
    model, _ = built(toy)
    with pytest.raises(RobotFileError, match=f"^toy: .*{words}"):
        find(model, "toy")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("left_knee_link", None, r"right_\w+ weighs [\d.]+ kg, not|left_\w+ weighs"),
        (
            'xyz="0 0 -0.2"',
            'xyz="0 0 -0.25"',
            r"reaches 0\.2 m|reaches 0\.\d+ m beyond",
        ),
        ('lower="-2.0" upper="1.0"', 'lower="-2.0" upper="-1.5"', "bent otherwise"),
    ],
)
def test_what_keeps_two_legs_from_being_alike_is_said(tmp_path, old, new, words):
    lighter = new is None
    text = toy_urdf(weighs=lambda n, mass: None if lighter and n == old else mass)
    text = text if lighter else text.replace(old, new, 1)
    with pytest.raises(
        RobotFileError, match=f"no mirror image: that which .*({words})"
    ):
        load_with_findings(write(tmp_path, text, "toy.urdf"))


@pytest.mark.parametrize("short", ["left", "right"])
def test_legs_of_which_one_lacks_a_joint_are_told_both_numbers(tmp_path, short):
    joint = f'name="{short}_tilt" type='
    text = toy_urdf().replace(f'{joint}"revolute"', f'{joint}"fixed"')
    with pytest.raises(
        RobotFileError, match=r"that which ends in \w+ has (5 joints, not 6|6.* not 5);"
    ):
        load_with_findings(write(tmp_path, text, "toy.urdf"))


def test_a_robot_whose_legs_have_no_yaw_is_said_not_to_turn():
    found = find(Builder(Toy(hip=("roll", "pitch"))).model(), "toy")
    (row,) = (row for row in found.evidence if row[0] == "turning")
    assert row[1:] == ("it will not turn", "no joint of its legs is about the vertical")


def test_a_fixed_base_is_an_arm():
    spec = mujoco.MjSpec()
    arm = spec.worldbody
    for i in range(6):
        arm = arm.add_body(pos=[0, 0, 0.2])
        arm.add_joint(name=f"j{i}", axis=[0, 1, 0])
        arm.add_geom(type=GEOM.mjGEOM_BOX, size=[0.02, 0.02, 0.1])
    with pytest.raises(RobotFileError, match="no free joint"):
        find(spec.compile(), "arm")


def test_closed_loops_are_named():
    builder = Builder(Toy())
    original = builder.servos

    def close():
        bodies = [b.name for b in builder.spec.bodies]
        tie = builder.spec.add_equality()
        tie.type = mujoco.mjtEq.mjEQ_CONNECT
        tie.objtype = mujoco.mjtObj.mjOBJ_BODY
        tie.name1, tie.name2 = bodies[6], bodies[4]
        original()

    builder.servos = close
    with pytest.raises(RobotFileError, match=r"closed loop at .* not supported"):
        find(builder.model(), "toy")


def test_bad_numbers_are_named():
    model, _ = built(Toy())
    model.body_mass[3] = np.nan
    with pytest.raises(RobotFileError, match=r"mass nan kg"):
        find(model, "toy")


def test_a_profile_gives_a_point_foot_its_sole():
    model, _ = built(Toy(foot="point"))
    told = {"sole": {"front": 0.1, "rear": -0.05, "half_width": 0.03, "below": 0.07}}
    sole = find(model, "toy", parse_profile(told, "p.toml")).left.sole
    assert (sole.front, sole.rear, sole.half_width) == (0.1, -0.05, 0.03)
    assert sole.origin[2] == pytest.approx(-0.07)


@pytest.mark.parametrize(
    "told", [{"below": 0.06}, {"front": 0.1}, {"front": 0.1, "below": 0.06}]
)
def test_a_sole_says_what_of_it_is_the_profiles(told):
    model, _ = built(Toy())
    found = find(model, "toy", parse_profile({"sole": told}, "p.toml"))
    why = {row[0]: row[2] for row in found.evidence}[f"sole of {found.left.sole.body}"]
    assert why == f"1 collision geoms of {found.left.sole.body}, and the profile"
    whole = {"front": 0.1, "rear": -0.05, "half_width": 0.03, "below": 0.07}
    found = find(model, "toy", parse_profile({"sole": whole}, "p.toml"))
    assert [r[2] for r in found.evidence if "sole of" in r[0]] == ["the profile"] * 2


def test_a_foot_without_shapes_needs_all_of_its_sole():
    model, _ = built(Toy(foot="none"))
    told = {"front": 0.1, "rear": -0.05, "half_width": 0.03}
    with pytest.raises(RobotFileError, match=r"no shape .* and sole\.below in a pro"):
        find(model, "toy", parse_profile({"sole": told}, "p.toml"))
    found = find(model, "toy", parse_profile({"sole": {**told, "below": 0.07}}, "p"))
    assert found.left.sole.front == 0.1


def test_a_profile_names_legs_by_joints_or_feet():
    model, builder = built(Toy())
    plain = find(model, "toy")
    legs = {"left": list(plain.left.joints), "right": list(plain.right.joints)}
    feet = {"left": plain.left.sole.body, "right": plain.right.sole.body}
    for told in ({"legs": legs}, {"foot": feet}, {"legs": feet}):
        found = find(model, "toy", parse_profile(told, "p.toml"))
        assert found.left.joints == plain.left.joints
        check_toy(builder.toy, model, builder, found)
    wrong = {"legs": {**legs, "left": ["nowhere", *legs["left"][1:]]}}
    with pytest.raises(
        RobotFileError, match=r"legs\.left = 'nowhere': not in the model"
    ):
        find(model, "toy", parse_profile(wrong, "p.toml"))


@pytest.mark.parametrize("stray", ["arm1.00", "waist", (1, "hip_yaw"), None])
def test_joints_that_a_profile_gives_a_leg_are_on_it(stray):
    model, builder = built(Toy(waist=True))
    found = find(model, "toy")
    left, right = (list(leg.joints) for leg in found.legs)
    name = builder.made[stray][0] if stray else left[-1]
    last = left[-1] if stray else left[0]
    named = [name, *left[1:]] if stray else left[::-1]
    told = parse_profile({"legs": {"left": named, "right": right}}, "p.toml")
    with pytest.raises(RobotFileError) as caught:
        find(model, "toy", told)
    assert str(caught.value) == (
        f"p.toml: legs.left: {name} is not between {found.pelvis} and {last}; list "
        "the joints of that leg, hip to ankle"
    )


def test_a_foot_ends_the_leg_whose_joints_a_profile_names():
    model, _ = built(Toy())
    plain = find(model, "toy")
    told = {
        "legs": {"left": list(plain.left.joints), "right": list(plain.right.joints)},
        "foot": {"left": plain.left.sole.body, "right": plain.right.sole.body},
    }
    found = find(model, "toy", parse_profile(told, "p.toml"))
    assert found.left.joints == plain.left.joints
    knee = model.joint(plain.left.joints[plain.left.knee]).bodyid[0]
    told["foot"]["left"] = model.body(knee).name
    with pytest.raises(
        RobotFileError, match=r"legs\.left: .* is not between inner and"
    ):
        find(model, "toy", parse_profile(told, "p.toml"))


@pytest.mark.parametrize("inner", [False, True])
def test_a_profile_whose_legs_are_one_is_refused(inner):
    model, _ = built(Toy())
    leg = find(model, "toy").left
    shank = model.body(model.joint(leg.joints[leg.knee]).bodyid[0]).name
    feet = {"left": leg.sole.body, "right": shank if inner else leg.sole.body}
    with pytest.raises(RobotFileError, match=r"one leg is part of the other; to"):
        find(model, "toy", parse_profile({"foot": feet}, "p.toml"))


@pytest.mark.parametrize("foot", ["base", "inner", "world"])
def test_a_profile_whose_foot_is_no_limb_is_refused(foot):
    model, _ = built(Toy())
    told = {"foot": {"left": find(model, "toy").left.sole.body, "right": foot}}
    with pytest.raises(
        RobotFileError, match="no joint lies between it and base, the base"
    ):
        find(model, "toy", parse_profile(told, "p.toml"))


def test_servos_are_read_or_derived():
    model, _ = built(Toy())
    servo = next(iter(find(model, "toy").servos.values()))
    assert (servo.stiffness, servo.torque_limit, servo.source) == (
        400.0,
        90.0,
        "actuator",
    )
    weight = float(model.body_subtreemass[1]) * 9.81
    for toy, source in (
        (Toy(servo="motor"), "derived: motor"),
        (Toy(servo="none"), "derived: none"),
        (Toy(kp=5.0), "derived: placeholder gains"),
        (Toy(kp=1e6), "derived: placeholder gains"),
    ):
        model, _ = built(toy)
        found = find(model, "toy")
        servos = [found.servos[j] for leg in found.legs for j in leg.joints]
        assert {s.source for s in servos} == {source}
        assert 1.0 < max(s.stiffness for s in servos) / weight < 5.0
        if toy.servo == "motor":
            assert {s.torque_limit for s in servos} == {60.0}
        assert all(np.isfinite(s.torque_limit) and s.damping > 0.0 for s in servos)


@pytest.mark.parametrize("limit", [0.5, 1.5, 60.0, 2e3])
def test_the_torque_limits_of_weak_motors_are_the_files(limit):
    found = find(with_motors(limit), "toy")
    servos = [found.servos[j] for leg in found.legs for j in leg.joints]
    assert {(s.torque_limit, s.source) for s in servos} == {(limit, "derived: motor")}
    assert "leg torque limits" not in [row[0] for row in found.evidence]


@pytest.mark.parametrize(
    ("limit", "said"),
    [(1e5, "1e+05 to 1e+05 N m"), (0.0, "0 to 0 N m"), (None, "none")],
)
def test_torque_limits_that_are_not_the_files_are_said(limit, said):
    model = with_motors(limit)
    weight = float(model.body_subtreemass[1]) * 9.81
    found = find(model, "toy")
    servos = [found.servos[j] for leg in found.legs for j in leg.joints]
    (derived,) = {s.torque_limit for s in servos}
    assert 0.3 * weight < derived < weight
    (row,) = (row for row in found.evidence if row[0] == "leg torque limits")
    assert row[1] == f"{len(servos)} derived: {derived:.3g} N m"
    assert f"the file gives {said}; " in row[2] and "50 m g h" in row[2]


def with_motors(limit):
    """A toy whose torque motors all have this limit, or none [N m]."""
    model, _ = built(Toy(servo="motor"))
    model.actuator_forcelimited[:] = model.actuator_ctrllimited[:] = False
    model.actuator_gear[:, 0] = 1.0
    if limit is not None:
        model.actuator_forcelimited[:] = True
        model.actuator_forcerange[:] = -limit, limit
    return model


def test_legs_without_rotor_inertia_are_given_one():
    model, _ = built(Toy())
    found = find(model, "toy")
    legs = [*found.left.joints, *found.right.joints]
    first, others = legs[0], legs[1:]
    assert [found.servos[n].armature for n in legs] == [400.0 / 200.0**2] * len(legs)
    assert found.servos[first].source == "actuator"
    assert all(s.armature == 0.0 for n, s in found.servos.items() if n not in legs)
    (row,) = (row for row in found.evidence if row[0] == "leg armature")
    assert row[1:] == (
        f"{len(legs)} derived: 0.01 to 0.01 kg m^2",
        "no rotor inertia in the file: stiffness / (200 rad/s)^2",
    )
    model.dof_armature[model.joint(first).dofadr] = 0.03
    told = {"servo": {others[0]: {"armature": 0.0}, others[1]: {"stiffness": 800}}}
    found = find(model, "toy", parse_profile(told, "p.toml"))
    assert [found.servos[n].armature for n in legs[:3]] == [0.03, 0.0, 0.02]
    told = {"servo": {"*": {"armature": 0.05}}}
    found = find(model, "toy", parse_profile(told, "p.toml"))
    assert {found.servos[n].armature for n in legs} == {0.05}
    assert "leg armature" not in [row[0] for row in found.evidence]
    assert set(reduce(model, found, "toy").legs.armature) == {0.05}


def test_speeds_that_only_the_text_has_limit_the_servos():
    model, _ = built(Toy())
    found = find(model, "toy")
    knee = found.left.joints[found.left.knee]
    found = find(model, "toy", speeds={knee: 6.0, "gone": 1.0})
    assert found.servos[knee].speed_limit == 6.0
    assert found.servos[found.left.joints[0]].speed_limit == np.inf
    told = parse_profile({"servo": {knee: {"speed_limit": 8.0}}}, "p.toml")
    found = find(model, "toy", told, {knee: 6.0})
    assert found.servos[knee].speed_limit == 8.0


def test_a_sole_longer_than_its_leg_is_in_mm():
    model, _ = built(Toy(foot="mesh"))
    own = np.flatnonzero(model.geom_type == int(GEOM.mjGEOM_MESH))
    model.mesh_vert[:] *= 1e3
    model.geom_pos[own] *= 1e3
    with pytest.raises(
        RobotFileError, match=r'm long .* in mm, give it scale="0\.001 0\.001 0\.001"'
    ):
        find(model, "toy")


@pytest.mark.parametrize("ankle", [ANKLE, ("pitch", "roll", "pitch")])
def test_a_foot_without_a_sole_may_be_toes_or_a_robot_that_lies(ankle):
    model, _ = built(Toy(foot="point", ankle=ankle))
    with pytest.raises(RobotFileError, match=r"no flat sole.* or up if z") as caught:
        find(model, "toy")
    assert ("legs.left and legs.right where" in str(caught.value)) == (len(ankle) > 2)


def test_a_foot_that_lost_its_meshes_says_what_would_settle_it():
    model, _ = built(Toy())
    feet = [model.body(leg.sole.body).id for leg in find(model, "toy").legs]
    model.geom_contype[:] = model.geom_conaffinity[:] = 0
    own = np.isin(model.body_weldid[model.geom_bodyid], feet)
    model.geom_bodyid[own] = 1  # of the trunk now
    model.body_geomnum[feet] = 0
    with pytest.raises(
        RobotFileError, match=r"no shape .* such as \.wrl, to \.stl .* give sole\.front"
    ):
        find(model, "toy")


def test_a_robot_that_lost_all_shapes_is_drawn_by_its_joints(tmp_path):
    model, _ = built(Toy())
    model.body_geomnum[:] = 0
    model.geom_contype[:] = model.geom_conaffinity[:] = 0
    model.geom_bodyid[:] = 0
    told = {"sole": {"front": 0.1, "rear": -0.05, "half_width": 0.04, "below": 0.05}}
    found = find(model, "toy", parse_profile(told, "p.toml"))
    draw_robot(tmp_path / "robot.png", model, "toy", found)
    assert (tmp_path / "robot.png").stat().st_size > 10_000


@pytest.mark.parametrize("portrait", [None, np.full((400, 300, 3), 200, np.uint8)])
def test_a_long_name_leaves_the_titles_of_the_panels_free(
    tmp_path, monkeypatch, portrait
):
    drawn = []

    @contextmanager
    def kept(*size):
        with drawing(*size) as figure:
            drawn.append(figure)
            yield figure

    monkeypatch.setattr("gaitchain.figures.robot.drawing", kept)
    model, _ = built(Toy())
    found = find(model, "toy")
    draw_robot(tmp_path / "robot.png", model, "toy of a name " * 4, found, portrait)
    (figure,) = drawn
    title = next(t for t in figure.get_children() if "toy of" in str(t))
    above = title.get_window_extent().y0
    for panel in figure.axes:
        assert panel.title.get_window_extent().y1 < above - 2.0


def test_a_profile_overrides_servos_and_angles():
    model, builder = built(Toy())
    arm = builder.made["arm1.00"][0]
    told = {
        "servo": {"*": {"stiffness": 300}, arm: {"stiffness": 20, "speed_limit": 4}},
        "stand": {"hip_height": 0.5, "angles": {arm: 0.4}},
    }
    found = find(model, "toy", parse_profile(told, "p.toml"))
    assert found.servos[arm].stiffness == 20.0
    assert found.servos[arm].speed_limit == 4.0
    assert {s.source for s in found.servos.values()} == {"profile"}
    assert found.servos[found.left.joints[0]].stiffness == 300.0
    assert found.hip_height == 0.5
    assert found.stand[arm] == 0.4


def test_angles_of_joints_that_walk_are_refused():
    model, _ = built(Toy())
    for joint in find(model, "toy").left.joints:
        told = {"stand": {"angles": {joint: 0.1}}}
        with pytest.raises(RobotFileError) as caught:
            find(model, "toy", parse_profile(told, "p.toml"))
        assert str(caught.value) == (
            f"p.toml: stand.angles.{joint} = 0.1: the joint walks, and stands as it "
            "has to; give angles of joints outside the legs: stand.hip_height bends "
            "the legs"
        )


def test_a_held_joint_of_a_leg_may_be_given_an_angle(tmp_path):
    path = write(tmp_path, without_actuators("left_yaw", "right_yaw"))
    told = {"stand": {"angles": {"left_yaw": 0.05, "right_yaw": -0.05}}}
    found = find(load_model(path).model, "toy", parse_profile(told, "p.toml"))
    assert [found.stand[f"{s}_yaw"] for s in ("left", "right")] == [0.05, -0.05]


@pytest.mark.parametrize(
    ("tie", "why"),
    [
        ('joint2="left_yaw" polycoef="0 1 0 0 0"', "the joint follows left_yaw, by an"),
        ('polycoef="0.1 0 0 0 0"', "the file holds the joint, by an <equality>"),
    ],
)
def test_angles_of_joints_that_follow_others_are_refused(tmp_path, tie, why):
    """They had no effect: where the joint is, the equality says."""
    text = without_actuators("left_yaw", "right_yaw")
    tied = f'<equality><joint joint1="right_yaw" {tie}/></equality>'
    path = write(tmp_path, text.replace("</mujoco>", f"{tied}</mujoco>"))
    told = {"stand": {"angles": {"right_yaw": 0.05}}}
    with pytest.raises(
        RobotFileError, match=f"^p.toml: stand.angles.right_yaw = 0.05: {why}"
    ):
        find(load_model(path).model, "toy", parse_profile(told, "p.toml"))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_angles_beyond_a_range_are_refused_with_both_ends(sign):
    model, builder = built(Toy())
    arm = builder.made["arm1.00"][0]
    low, high = model.joint(arm).range
    end = low if sign < 0 else high
    for angle, fits in ((end - 0.01 * sign, True), (end + 0.01 * sign, False)):
        told = parse_profile({"stand": {"angles": {arm: angle}}}, "p.toml")
        if fits:
            assert find(model, "toy", told).stand[arm] == angle
            continue
        ends = rf"it can be sent from {low:g} to {high:g} rad"
        with pytest.raises(
            RobotFileError, match=rf"^p\.toml: stand\..* {angle}: {ends}"
        ):
            find(model, "toy", told)


def test_the_row_of_the_stand_says_what_comes_from_where():
    model, builder = built(Toy(waist=True))
    arm = builder.made["arm1.00"][0]

    def why(**told):
        found = find(model, "toy", parse_profile({"stand": told}, "p.toml"))
        return next(row[2] for row in found.evidence if row[0] == "stand")

    legs = "legs: both soles level under the CoM"
    rest = "others: nearest to the file's, within range, the waist straight"
    assert why() == f"{legs}; {rest}"
    assert why(hip_height=0.5) == f"{legs}, at the profile's height; {rest}"
    assert why(angles={arm: 0.1}) == f"{legs}; {rest}, 1 by the profile"
    builder.spec.add_key(name="ready", qpos=model.qpos0)
    model = builder.spec.compile()
    assert why() == f"{legs}; others: keyframe ready, the waist straight"


def test_res_as_its_numbers_say(res):
    model = build_model(res)
    found = find(model, "res")
    rear, front = res.reduced.sole_x
    for side, leg in zip(("left", "right"), found.legs, strict=True):
        assert leg.joints[leg.knee] == f"{side}_knee"
        assert leg.knee_bends == 1.0
        assert (leg.sole.rear, leg.sole.front) == pytest.approx((rear, front))
        assert leg.sole.half_width == pytest.approx(0.5 * res.reduced.sole_width)
        servo = found.servos[leg.joints[0]]
        assert servo.stiffness == res.reduced.servo_stiffness
        assert servo.speed_limit == pytest.approx(res.reduced.joint_speed_limit)
        assert servo.torque_limit == res.reduced.joint_torque_limit
    assert found.hip_height == pytest.approx(
        0.87 * res.reduced.leg_length + res.reduced.ankle_height
    )
    check_standing(model, found)


SERVOS = {
    "pal_talos/talos.xml": "derived: none",
    "booster_t1/t1.xml": "derived: placeholder gains",  # softer than m g h
}


@pytest.mark.slow
@pytest.mark.parametrize("path", STOCK)
def test_stock_robots(path, tmp_path):
    shared = Path(__file__).parents[3] / "shared" / "robots"
    file = Path(os.environ.get("MENAGERIE_ROOT", shared)) / path
    if not file.exists():
        pytest.skip(f"{path}: not on this computer")
    model = mujoco.MjModel.from_xml_path(str(file))
    found = find(model, path)
    knee, foot, width = STOCK[path]
    assert found.left.joints[found.left.knee] == knee
    assert found.left.sole.body == foot
    assert 2.0 * found.left.sole.half_width == pytest.approx(width, abs=1e-3)
    np.testing.assert_allclose(found.forward, [1, 0, 0], atol=1e-9)
    assert all(len(leg.joints) == 6 for leg in found.legs)
    sources = {found.servos[j].source for j in found.left.joints}
    assert sources == {SERVOS.get(path, "actuator")}
    check_standing(model, found)
    draw_robot(tmp_path / "robot.png", model, path, found)
    assert (tmp_path / "robot.png").stat().st_size > 10_000
