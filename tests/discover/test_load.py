"""Robots from files: what loads, what is mended and said, what is refused and why."""

import os
import re
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robot_text import write

from gaitchain.discover.catalogue import list_robots
from gaitchain.discover.load import load_model
from gaitchain.discover.notes import Doubt
from gaitchain.discover.trees import keep_one_tree
from gaitchain.errors import RobotFileError

FREE = mujoco.mjtJoint.mjJNT_FREE
SHARED = Path(__file__).parents[3] / "shared" / "robots"
REAL = Path(os.environ.get("MENAGERIE_ROOT") or SHARED)

LEG = """
<body name="{s}_thigh" pos="0 {y} -0.1"><joint name="{s}_hip" axis="0 1 0"
  range="-60 60"/><geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.04"/>
  <body name="{s}_shin" pos="0 0 -0.3" euler="0 10 0"><joint name="{s}_knee"
    axis="0 1 0" range="0 120"/><geom type="capsule" fromto="0 0 0 0 0 -0.3"
    size="0.03"/><body name="{s}_foot" pos="0 0 -0.3"><joint name="{s}_ankle"
      axis="0 1 0" range="-40 40"/>{foot}</body></body></body>"""
FOOT = '<geom name="{s}_sole" type="box" size="0.1 0.05 0.02"/>'
WORLD = '<light/><geom name="floor" type="plane" size="1 1 1"/><site name="mark"/>'


def mjcf(base="<freejoint/>", foot=FOOT, top="", world="", end="", torso=""):
    """A toy humanoid of two three-jointed legs, with what a test adds to it."""
    legs = "".join(
        LEG.format(s=s, y=y, foot=foot.format(s=s))
        for s, y in (("left", 0.1), ("right", -0.1))
    )
    return (
        f'<mujoco model="toy">{top}<worldbody>{world}<body name="torso" pos="0 0 1">'
        f'{base}<geom type="box" size="0.1 0.1 0.2"/>{torso}{legs}</body></worldbody>'
        f"{end}</mujoco>"
    )


INERTIAL = (
    '<inertial><mass value="{m}"/><inertia ixx="{i}" iyy="0.02" izz="0.02" '
    'ixy="{p}" ixz="0" iyz="0"/></inertial>'
)


def link(name, m=1.0, i=0.02, p=0.0, shape=""):
    return f'<link name="{name}">{INERTIAL.format(m=m, i=i, p=p)}{shape}</link>'


def joint(name, parent, child, kind="revolute", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="0 1 0"/><origin xyz="0 0 -0.3"/>'
        f'<limit lower="-1" upper="1" effort="30" velocity="5"/>{more}</joint>'
    )


def urdf(*more, base=None, knee=None):
    base = link("base") if base is None else base
    parts = [base, link("thigh"), link("shin"), joint("hip", "base", "thigh")]
    parts += [joint("knee", "thigh", "shin") if knee is None else knee]
    return f'<robot name="toy">{"".join([*parts, *more])}</robot>'


def check(robot):
    """Whatever is loaded keeps what `RobotModel` promises."""
    model = robot.spec.compile()
    free = np.flatnonzero(model.jnt_type == FREE)
    assert len(free) == 1 and model.body_parentid[model.jnt_bodyid[free[0]]] == 0
    assert not model.geom_bodyid[model.geom_bodyid == 0].size
    assert not model.nlight
    assert not robot.spec.compiler.degree
    assert all(body.name for body in robot.spec.bodies)
    assert all(joint.name for joint in robot.spec.joints)
    assert all(note.count("\n") == 0 for note in robot.notes)
    again = mujoco.MjSpec.from_string(robot.spec.to_xml()) if not model.nmesh else None
    if again is not None:
        np.testing.assert_allclose(
            again.compile().body_quat, model.body_quat, atol=1e-6
        )
    return model


def load(folder, text, name="robot.xml"):
    robot = load_model(write(folder, text, name))
    return robot, check(robot), " ".join(robot.notes)


def refused(folder, text, match, name="robot.xml"):
    path = write(folder, text, name) if isinstance(text, str) else folder / name
    if isinstance(text, bytes):
        path.write_bytes(text)
    with pytest.raises(RobotFileError, match=match) as caught:
        load_model(path)
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message
    return message


def stl(corners=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))):
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    data = b"\0" * 80 + struct.pack("<I", len(faces))
    for face in faces:
        numbers = [0.0] * 3 + [0.1 * x for corner in face for x in corners[corner]]
        data += struct.pack("<12fH", *numbers, 0)
    return data


# -- MJCF ----------------------------------------------------------------------------


def test_the_robot_is_left_alone_in_radians(tmp_path):
    text = mjcf(
        world=WORLD,
        end='<contact><pair geom1="floor" geom2="left_sole"/></contact>'
        '<sensor><framepos objtype="site" objname="mark"/></sensor>',
    )
    plain = mujoco.MjModel.from_xml_string(text)
    robot, model, notes = load(tmp_path, text)
    assert robot.name == "toy"
    assert robot.origin == str(tmp_path / "robot.xml")
    assert "1 geom, 1 site, 1 light" in notes
    assert "went with it" in notes
    assert "no actuators" in notes
    assert (model.npair, model.nsensor, model.ngeom) == (0, 0, plain.ngeom - 1)
    np.testing.assert_allclose(model.jnt_range, plain.jnt_range, atol=1e-12)
    np.testing.assert_allclose(model.body_quat, plain.body_quat, atol=1e-12)
    assert model.jnt_range.max() == pytest.approx(np.radians(120))
    assert robot.spec.joints[0].name == "base"


@pytest.mark.parametrize(
    ("base", "said"),
    [
        ("", "where it was fixed"),
        (
            '<joint name="x" type="slide"/><joint name="z" type="slide" axis="0 0 1"/>'
            '<joint name="pitch" axis="0 1 0"/>',
            "in place of 3 joints (x, z, pitch)",
        ),
    ],
)
def test_a_base_that_cannot_go_anywhere_is_freed(tmp_path, base, said):
    key = '<keyframe><key name="home" qpos="0 0 0 0 0 0"/></keyframe>'
    key = key if not base else key.replace('"0', '"0 0 0 0')
    _, model, notes = load(tmp_path, mjcf(base=base, end=key))
    assert said in notes
    assert "1 keyframe (home) left out" in notes
    assert (model.nq, model.nkey) == (13, 0)


PLANAR = (
    '<joint name="x" type="slide"/>',
    '<joint name="z" type="slide" axis="0 0 1"/>',
    '<joint name="pitch" axis="0 1 0"/>',
)
DUMMY = '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>'


@pytest.mark.parametrize("bodies", [1, 3])
@pytest.mark.parametrize("motor", ["", '<actuator><motor joint="waist"/></actuator>'])
def test_the_joints_of_a_planar_base_end_where_the_robot_begins(
    tmp_path, bodies, motor
):
    roots = PLANAR if bodies == 3 else ("".join(PLANAR),)
    apart = f'{DUMMY}<body pos="0 0 0.01">'
    pelvis = '<geom size="0.1"/><body><joint name="waist" axis="0 0 1"/>'
    text = mjcf(base=apart.join(roots) + pelvis, end=motor)
    close = "</body>" * bodies
    text = text.replace("</worldbody>", f"{close}</worldbody>")
    _, model, notes = load(tmp_path, text)
    assert "in place of 3 joints (x, z, pitch)" in notes
    names = [model.joint(n).name for n in range(model.njnt)]
    assert names[:2] == ["base", "waist"] and len(names) == 8
    assert model.nu == bool(motor)


def test_a_base_that_motors_move_is_refused(tmp_path):
    end = '<actuator><motor joint="x"/></actuator>'
    message = refused(tmp_path, mjcf(base="".join(PLANAR), end=end), "hangs from")
    assert "'torso'" in message and "'x'" in message


def test_a_driven_joint_of_a_massless_chain_is_kept(tmp_path):
    base = "".join(PLANAR) + '<body><joint name="waist" axis="0 0 1"/>'
    end = '<actuator><motor joint="waist"/></actuator>'
    text = mjcf(base=base, end=end).replace("</worldbody>", "</body></worldbody>")
    _, model, notes = load(tmp_path, text)
    assert "in place of 3 joints (x, z, pitch)" in notes
    assert model.joint("waist").id == 1 and model.nu == 1


BALL = '<body name="hand"><joint name="wrist" type="ball"/><geom size="0.1"/></body>'


def test_ball_joints_are_welded_as_drawn_and_said(tmp_path):
    end = (
        '<sensor><ballquat joint="wrist"/></sensor><keyframe><key name="home" '
        'qpos="0 0 1 1 0 0 0 0.6 0 0.8 0 1 2 3 4 5 6"/></keyframe>'
    )
    robot, model, notes = load(tmp_path, mjcf(torso=BALL, end=end))
    assert "1 ball joint (wrist) welded as drawn" in notes
    assert "1 pairs, sensors" in notes
    assert robot.balls == {"hand": "wrist"}
    assert model.body("hand").weldid == model.body("torso").id
    np.testing.assert_allclose(model.key("home").qpos[7:], [1, 2, 3, 4, 5, 6])
    assert robot.model.nq == model.nq == 13


def test_ball_joints_of_closed_loops_stay(tmp_path):
    end = (
        '<equality><connect body1="hand" body2="left_foot" anchor="0 0 0"/></equality>'
    )
    robot, model, notes = load(tmp_path, mjcf(torso=BALL, end=end))
    assert (robot.balls, model.nq) == ({}, 17)
    assert "welded" not in notes


def test_a_base_on_a_hinge_is_refused(tmp_path):
    message = refused(tmp_path, mjcf(base='<joint name="swivel"/>'), "hangs from")
    assert "'torso'" in message and "'swivel'" in message


def test_of_several_trees_the_robot_is_kept_with_its_pose(tmp_path):
    ball = '<body name="ball"><freejoint/><geom size="0.1"/></body>'
    qpos = " ".join(map(str, [*range(7), 1, 2, 3, 1, 0, 0, 0, 4, 5, 6, 7, 8, 9]))
    end = (
        '<equality><weld body1="ball" body2="torso"/><weld body1="torso"/></equality>'
        f'<keyframe><key qpos="{qpos}"/></keyframe>'
    )
    _robot, model, notes = load(tmp_path, mjcf(world=ball + WORLD, end=end))
    assert "1 tree (ball) left out: 'torso'" in notes
    assert "1 constraints to the world" in notes
    assert model.neq == 0
    np.testing.assert_allclose(model.key_qpos[0, 7:], [4, 5, 6, 7, 8, 9])


ROPE = "".join(
    f'<body pos="0.1 0 0"><joint name="rope{i}" {{}}/><geom size="0.02"/>'
    for i in range(16)
)
ROPE = f'<body name="rope" pos="3 0 1">{ROPE}{"</body>" * 17}'
BIPED = "".join(
    f'<body><joint name="arm{i}" axis="0 1 0"/><geom size="0.02"/></body>'
    for i in range(4)
)


BESIDE = '<body pos="3 0 1">{}<geom type="sphere" size="0.1" mass="5"/></body>'


@pytest.mark.parametrize("name", ['name="torso"', ""])
@pytest.mark.parametrize("held", ["<freejoint/>", ""], ids=["free", "fixed"])
@pytest.mark.parametrize("fuse", ["true", "false"])
def test_a_total_mass_is_that_of_all_trees(tmp_path, held, fuse, name):
    top = f'<compiler settotalmass="60" fusestatic="{fuse}"/>'
    text = mjcf(top=top, world=BESIDE.format(held) + WORLD)
    whole = mujoco.MjModel.from_xml_string(text)
    loaded = load_model(write(tmp_path, text.replace('name="torso"', name)))
    mass = whole.body("torso").subtreemass[0]
    assert loaded.model.body_mass.sum() == pytest.approx(mass)
    alone = load_model(write(tmp_path, mjcf(top=top)))
    assert alone.model.body_mass.sum() == pytest.approx(60.0)


def test_a_total_mass_of_what_cannot_be_weighed_is_refused(tmp_path):
    mesh = '<asset><mesh name="rock" file="rock.stl"/></asset>'
    rock = '<body name="rock"><geom type="mesh" mesh="rock"/></body>'
    text = mjcf(top=f'<compiler settotalmass="60"/>{mesh}', world=rock)
    with pytest.raises(
        RobotFileError, match=r'settotalmass="60" counts 1 tree \(rock\), too, .*rock'
    ):
        load_model(write(tmp_path, text))


@pytest.mark.parametrize("kind", ['type="ball"', 'type="hinge"'])
def test_a_free_robot_goes_before_what_has_more_joints(tmp_path, kind):
    world = ROPE.replace("{}", kind)
    _, model, notes = load(tmp_path, mjcf(world=world, torso=BIPED))
    assert "1 tree (rope) left out: 'torso' is the robot" in notes
    assert model.njnt == 11


def test_a_robot_of_ball_joints_goes_before_an_arm(tmp_path):
    """A ball turns in three ways: two of them and a knee a leg are seven each."""
    ends = '<joint type="ball"/><geom size="0.03"/>'
    shank = '<body pos="0 0 -0.2"><joint axis="0 1 0"/><geom size="0.03"/>{{}}</body>'
    foot = f'<body pos="0 0 -0.2">{ends}</body>'
    legs = 2 * f"<body>{ends}{shank.format(foot)}</body>"
    arm = 7 * '<body><joint axis="0 1 0"/><geom size="0.02"/>' + 7 * "</body>"
    table = f'<body name="table" pos="2 0 0">{arm}</body>'
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="robot"><freejoint/><geom size="0.1"/>'
        f"{legs}</body>{table}</worldbody></mujoco>"
    )
    kept, notes = keep_one_tree(spec)
    assert kept.name == "robot"
    assert "1 tree (table) left out" in notes[0]


def test_legs_that_hang_from_the_world_are_said_to_be_fused(tmp_path):
    leg = LEG.replace('axis="0 1 0"', "").format(s="{s}", y="{y}", foot="")
    more = '<joint name="{s}_yaw" axis="0 0 1"/><joint name="{s}_roll" axis="1 0 0"/>'
    leg = leg.replace('pos="0 {y} -0.1">', 'pos="0 {y} -0.1">' + more)
    legs = "".join(leg.format(s=s, y=y) for s, y in (("left", 0.1), ("right", -0.1)))
    box = '<geom type="box" size="0.1 0.1 0.2"/>'
    text = f"<mujoco><worldbody>{box}{legs}</worldbody></mujoco>"
    message = refused(tmp_path, text, "its base is fused into the world")
    assert "2 trees (left_thigh, right_thigh) on hinges" in message
    assert "put these bodies into one <body> with a <freejoint/>" in message


def test_pairs_and_sensors_of_a_scene_around_the_robot_are_left_out(tmp_path):
    end = (
        '<contact><pair geom1="floor" geom2="left_sole"/><pair geom1="left_sole" '
        'geom2="right_sole"/></contact><sensor><framepos objtype="site" '
        'objname="mark"/><jointpos joint="left_knee"/></sensor>'
    )
    _, model, notes = load(tmp_path, mjcf(end=end))
    assert (model.npair, model.nsensor) == (1, 1)
    assert "1 pair (floor) left out: of what is not in the file" in notes
    assert "1 sensor (mark) left out" in notes and "give the scene" in notes


def test_what_has_no_name_is_not_missed_where_something_unnamed_goes(tmp_path):
    servos = "<actuator><position joint='left_knee' kp='9'/></actuator>"
    held = "<equality><joint joint1='right_knee' polycoef='0.3 0 0 0 0'/></equality>"
    robot = load_model(write(tmp_path, mjcf(world="<site/>", end=servos + held)))
    assert (robot.model.nu, robot.model.neq) == (1, 1)
    assert not [note for note in robot.notes if "went with it" in note]


def test_a_camera_that_follows_what_is_left_out_is_fixed(tmp_path):
    camera = "<camera name='eye' mode='targetbody' target='ball'/>"
    world = "<body name='ball'><freejoint/><geom size='0.1'/></body>"
    robot = load_model(write(tmp_path, mjcf(world=world, torso=camera)))
    fixed = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
    assert robot.model.cam_mode.tolist() == [fixed]
    assert any(
        "1 camera (eye) of what is left out: fixed" in note for note in robot.notes
    )


def test_actuators_of_disabled_groups_are_left_out(tmp_path):
    """As where a file has motors and position servos, and lets one kind act."""
    end = (
        '<actuator><motor name="off" joint="left_hip" group="2"/>'
        '<motor joint="left_knee" group="30"/><motor joint="left_hip" group="31"/>'
        '<position name="on" joint="left_hip" kp="9"/></actuator>'
        '<sensor><actuatorfrc actuator="off"/><actuatorfrc actuator="on"/></sensor>'
        '<keyframe><key qpos="{}" ctrl="1 2 3 4"/></keyframe>'
    ).format(" ".join(["0"] * 13))
    text = mjcf(top='<option actuatorgroupdisable="2 30"/>', end=end)
    data = mujoco.MjData(mujoco.MjModel.from_xml_string(text))
    data.ctrl[:] = 1.0
    mujoco.mj_forward(data.model, data)
    assert np.flatnonzero(data.actuator_force).tolist() == [2, 3]
    _, model, notes = load(tmp_path, text)
    assert model.nu == 2 and model.opt.disableactuator == 0
    assert (model.nsensor, model.nkey) == (1, 1)
    assert "2 actuators (off, left_knee) left out: the file disables" in notes
    assert "1 pairs, sensors" in notes


def test_actuators_that_turn_no_joint_are_said(tmp_path):
    end = (
        '<tendon><fixed name="t"><joint joint="left_knee" coef="1"/>'
        '<joint joint="left_ankle" coef="1"/></fixed></tendon><actuator>'
        '<motor name="pull" tendon="t"/><motor tendon="t"/><motor joint="left_hip"/>'
        "</actuator>"
    )
    _, _, notes = load(tmp_path, mjcf(end=end))
    assert "2 actuators (pull, t) of tendons, sites or bodies not used" in notes


def test_gravity_is_said_in_plain_numbers(tmp_path):
    _, _, notes = load(tmp_path, mjcf(top='<option gravity="0 0 -1.62"/>'))
    assert "Gravity was [0, 0, -1.62]; now" in notes


DEGREES = (
    ('range="-60 60"', 'range="-1.05 1.05"'),
    ('range="0 120"', 'range="0 2.1"'),
    ('range="-40 40"', 'range="-0.7 0.7"'),
)


def test_ranges_in_radians_that_are_taken_for_degrees_are_doubted(tmp_path):
    text = mjcf()
    assert "radian" not in load(tmp_path, text)[2]
    for degrees, radians in DEGREES:
        assert degrees in text
        text = text.replace(degrees, radians)
    _, _, notes = load(tmp_path, text)
    assert 'end at most 2.1 deg from 0: is <compiler angle="radian"/> miss' in notes
    compiler = '<compiler angle="radian"/><worldbody>'
    assert "radian" not in load(tmp_path, text.replace("<worldbody>", compiler))[2]


def test_ranges_in_degrees_that_are_taken_for_radians_are_doubted(tmp_path):
    text = mjcf().replace("<worldbody>", '<compiler angle="radian"/><worldbody>')
    notes = load(tmp_path, text)[2]
    assert "beyond 12.6 rad: are they in degrees?" in notes
    for degrees, radians in DEGREES:
        text = text.replace(degrees, radians)
    assert "degree" not in load(tmp_path, text)[2]


def test_a_robot_that_touches_by_pairs_alone_is_said_to(tmp_path):
    text = mjcf(world=WORLD).replace("<geom ", '<geom contype="0" conaffinity="0" ')
    end = '<contact><pair geom1="floor" geom2="left_sole"/></contact></mujoco>'
    _, _, notes = load(tmp_path, text.replace("</mujoco>", end))
    assert "unless by contact pairs: its shapes say where it touches" in notes


def test_flags_that_take_weight_or_contact_away_are_reset(tmp_path):
    top = '<option gravity="0 0 0"><flag gravity="disable" contact="disable"/></option>'
    text = mjcf(top=top).replace('name="torso"', 'name="torso" gravcomp="1"')
    _, model, notes = load(tmp_path, text)
    assert "contact, gravity" in notes and "spared gravity" in notes
    assert model.opt.disableflags == 0
    assert model.opt.gravity[2] == -9.81
    assert not model.body_gravcomp.any()


def test_includes_are_followed_and_rings_refused(tmp_path):
    write(tmp_path, mjcf(), "toy.xml")
    scene = f'<mujoco><include file="toy.xml"/><worldbody>{WORLD}</worldbody></mujoco>'
    _, model, _ = load(tmp_path, scene, "scene.xml")
    assert model.njnt == 7
    ring = '<mujoco><include file="{}"/></mujoco>'
    write(tmp_path, ring.format("b.xml"), "a.xml")
    refused(tmp_path, ring.format("a.xml"), r"ring: b.xml -> a.xml -> b.xml", "b.xml")
    refused(tmp_path, ring.format("none.xml"), "includes 'none.xml', which is not in")
    attached = (
        '<mujoco><asset><model name="m" file="self.xml"/></asset><worldbody>'
        '<body><attach model="m" body="b" prefix="p"/></body></worldbody></mujoco>'
    )
    refused(tmp_path, attached, "ring: self.xml -> self.xml", "self.xml")


def link_to(target, *places):
    for place in places:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(target)


def test_a_store_of_links_has_its_includes_beside_the_links(tmp_path):
    """As the cache of a hub, which keeps one copy of what is the same."""
    text, part = mjcf(torso='<body pos="0 0 0.3">{}</body>'), tmp_path / "blobs" / "1"
    parts = '<include file="parts/a.xml"/><include file="parts/b.xml"/>'
    write(tmp_path / "blobs", text.format(parts), "0")
    write(tmp_path / "blobs", '<mujoco><include file="c.xml"/></mujoco>', "1")
    write(tmp_path / "blobs", '<mujoco><geom size="0.1"/></mujoco>', "2")
    main, folder = tmp_path / "main" / "robot.xml", tmp_path / "main" / "parts"
    link_to(tmp_path / "blobs" / "0", main)
    link_to(part, folder / "a.xml")
    link_to(tmp_path / "blobs" / "2", folder / "b.xml", folder / "c.xml")
    plain = mujoco.MjModel.from_xml_path(str(main))
    assert check(load_model(main)).ngeom == plain.ngeom == 9


def test_a_ring_of_links_is_refused(tmp_path):
    text = mjcf(torso='<include file="again.xml"/>')
    link_to(write(tmp_path, text), tmp_path / "again.xml")
    refused(tmp_path, text, r"ring: robot.xml -> again.xml$")


def test_the_folder_above_is_that_which_is_written_before(tmp_path):
    """As MuJoCo has it: a folder that is a link is not left by way of its target."""
    write(tmp_path, '<mujoco><geom size="0.1"/></mujoco>', "part.xml")
    write(tmp_path / "far", "<mujoco><option/></mujoco>", "part.xml")
    write(tmp_path / "far" / "deep", "<mujoco/>")
    link_to(tmp_path / "far" / "deep", tmp_path / "near")
    text = mjcf(torso='<body><include file="near/../part.xml"/></body>')
    path = write(tmp_path, text)
    plain = mujoco.MjModel.from_xml_path(str(path))
    assert check(load_model(path)).ngeom == plain.ngeom


@pytest.mark.parametrize("own", ["degree", "radian"])
@pytest.mark.parametrize("attached", ["degree", "radian"])
def test_what_is_attached_has_its_own_unit_of_angles(tmp_path, own, attached):
    turn, end = (90, 60) if attached == "degree" else (1.5708, 1.0472)
    head = (
        f'<mujoco><compiler angle="{attached}"/><worldbody><body name="head" '
        f'euler="0 {turn} 0"><joint name="nod" axis="0 1 0" ref="{0.1 * end}" '
        f'range="-{end} {end}"/><geom size="0.1"/><site axisangle="0 0 1 {turn}"/>'
        "</body></worldbody></mujoco>"
    )
    write(tmp_path, head, "head.xml")
    top = f'<compiler angle="{own}"/><asset><model name="h" file="head.xml"/></asset>'
    torso = '<frame pos="0 0 0.3"><attach model="h" body="head" prefix="h_"/></frame>'
    path = write(tmp_path, mjcf(top=top, torso=torso))
    plain = mujoco.MjModel.from_xml_path(str(path))
    model = check(load_model(path))
    assert plain.joint("h_nod").range[1] == pytest.approx(1.0472, abs=1e-4)
    for name in ("jnt_range", "qpos0", "body_quat", "site_quat"):
        ours, theirs = getattr(model, name), getattr(plain, name)
        np.testing.assert_allclose(ours, theirs, atol=1e-12, err_msg=name)


@pytest.mark.parametrize(
    ("torso", "match"),
    [
        ('<body name="b"><joint/><inertial pos="0 0 0" mass="{}"'
         ' diaginertia="1 1 1"/></body>'.format("nan"), "'b' has a mass of nan"),
        ('<body name="b"><joint/><inertial pos="0 0 0" mass="-1"'
         ' diaginertia="1 1 1"/></body>', "'b' has a mass of -1"),
        ('<body name="b"><joint/><inertial pos="0 0 0" mass="1"'
         ' diaginertia="1 -1 1"/></body>', "'b' has an inertia"),
        ('<body name="b"><joint/><geom size="1" density="-1"/></body>', "'b': a geom"),
        ('<body name="b" pos="inf 0 0"><joint/><geom size="1"/></body>', "finite"),
        ('<replicate count="9999"><body><geom size="1"/></body></replicate>',
         "at most 2000"),
        ('<body><joint/><geom size=".1"/></body>' * 501, "507 moving bodies; at most"),
        ("<body>" * 300 + "</body>" * 300, "nested more than 200"),
        ('<flexcomp name="f" type="grid" count="9 9 9"/>', "soft body"),
        ("<wheel/>", "unrecognized element"),
    ],
)  # fmt: skip
def test_what_no_robot_can_be_is_refused(tmp_path, torso, match):
    refused(tmp_path, mjcf(torso=torso), match)


def test_inertias_are_mended_and_said(tmp_path):
    body = '<body name="{}"><joint/><inertial pos="0 0 0" mass="{}" {}/></body>'
    torso = (
        body.format("flat", 1, 'diaginertia="1 1 5"')
        + body.format("mixed", 1, 'fullinertia="1 1 1 3 0 0"')
        + body.format("point", 0.1, 'diaginertia="0 0 0"')
        + '<body name="empty"><joint/></body>'
    )
    robot, model, _notes = load(tmp_path, mjcf(torso=torso))
    for name, what in (
        ("flat", "A + B >= C"),
        ("mixed", "without its products"),
        ("point", "ball of water"),
        ("empty", "given to"),
    ):
        assert next(n for n in robot.notes if what in n).count(name) == 1
    assert model.body("empty").mass[0] == pytest.approx(1e-3)
    assert (model.body_inertia[1:] > 0).all()


def test_missing_meshes_are_left_out_only_where_that_is_safe(tmp_path):
    asset = '<asset><mesh name="m" file="none.stl"/></asset>'
    seen = FOOT + '<geom type="mesh" mesh="m" contype="0" conaffinity="0" mass="0"/>'
    _, model, notes = load(tmp_path, mjcf(top=asset, foot=seen))
    assert "1 mesh file (none.stl) cannot be read; left out" in notes
    assert model.nmesh == 0
    weighing = mjcf(top=asset, foot=FOOT + '<geom type="mesh" mesh="m"/>')
    refused(tmp_path, weighing, "'left_foot' has its mass from one")
    only = (
        '<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>'
        '<geom type="mesh" mesh="m"/>'
    )
    refused(tmp_path, mjcf(top=asset, foot=only), "'left_foot' touches by nothing else")


def test_what_mujoco_finds_wrong_is_told_in_a_line(tmp_path):
    end = '<actuator><motor name="m" joint="nobody"/></actuator>'
    refused(tmp_path, mjcf(end=end), "MuJoCo refuses it: .*'nobody'")
    torso = (
        '<body name="heavy"><joint/><inertial pos="0 0 1" mass="1e300"'
        ' diaginertia="1 1 1"/></body>'
    )
    refused(tmp_path, mjcf(torso=torso), "far too small or too large|finite")


def test_broken_textures_do_not_matter(tmp_path):
    top = (
        '<asset><texture name="t" type="2d" file="no.png"/>'
        '<material name="m" texture="t"/></asset>'
    )
    _, _, notes = load(tmp_path, mjcf(top=top))
    assert "no.png" in notes


def test_nothing_is_left_behind_in_the_folder(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    before = mujoco.get_mju_user_warning()
    refused(tmp_path, mjcf(torso='<body pos="nan 0 0"><joint/></body>'), "finite")
    assert [p.name for p in tmp_path.iterdir()] == ["robot.xml"]
    assert mujoco.get_mju_user_warning() is before
    assert capfd.readouterr() == ("", "")


# -- URDF ----------------------------------------------------------------------------


def test_a_urdf_stands_free_with_its_limits(tmp_path):
    _, model, notes = load(tmp_path, urdf(), "toy.urdf")
    assert "A free joint added to the base 'base'" in notes
    assert "no actuators" in notes
    assert (model.nq, model.nbody) == (9, 4)
    np.testing.assert_allclose(model.joint("knee").range, [-1.0, 1.0])
    load(tmp_path, urdf(), "urdf_in.xml")


def test_speed_limits_of_a_urdf_go_with_it(tmp_path):
    knee = joint("knee", "thigh", "shin")
    for told, known in (("2.5", {"knee": 2.5}), ("0", {}), ("inf", {}), ("fast", {})):
        text = urdf(knee=knee.replace('velocity="5"', f'velocity="{told}"'))
        assert load(tmp_path, text, "toy.urdf")[0].speeds == {"hip": 5.0, **known}
    assert load(tmp_path, urdf(knee=knee.replace('velocity="5"', "")))[0].speeds == {
        "hip": 5.0
    }
    assert load(tmp_path, mjcf())[0].speeds == {}


def test_meshes_are_found_by_package_or_path_and_others_left_out(tmp_path, monkeypatch):
    shape = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'
    names = ["package://toy/meshes/a.stl", "../meshes/a.stl", "package://far/b.stl"]
    lost = ["package://toy/meshes/a.dae", "package://none/c.stl"]
    shapes = "".join(shape.format("visual", n) for n in names + lost)
    shapes += shape.format("collision", names[0])
    for place in ("toy/meshes/a.stl", "ros/far/b.stl"):
        path = tmp_path / place
        path.parent.mkdir(parents=True)
        path.write_bytes(stl())
    (tmp_path / "toy/meshes/a.dae").write_text("<COLLADA/>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    text = urdf(base=link("base", shape=shapes))
    robot, model, notes = load(tmp_path, text, "toy/urdf/toy.urdf")
    assert model.ngeom == 4
    assert "2 visual mesh files (c.stl, a.dae) left out" in notes
    assert "1 package (none) of meshes not found near" in notes
    assert "set ROS_PACKAGE_PATH to the folder that holds it" in notes
    assert all(Path(mesh.file).is_file() for mesh in robot.spec.meshes)


@pytest.mark.parametrize("place", ["real/toy.stl", "links/toy.stl"])
def test_meshes_are_found_beside_a_link_and_beside_its_file(tmp_path, place):
    shape = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    text = urdf(base=link("base", shape=shape.format("toy.stl")))
    file, near = write(tmp_path / "real", text, "toy.urdf"), tmp_path / "links"
    link_to(file, near / "toy.urdf")
    (tmp_path / place).write_bytes(stl())
    robot = load_model(near / "toy.urdf")
    assert robot.model.ngeom == 1 and not "".join(robot.notes).count("left out")


@pytest.mark.parametrize("name", ["a.stl", "package://far/off/a.stl"])
def test_meshes_are_found_where_the_file_says_it_to_mujoco(tmp_path, name):
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "a.stl").write_bytes(stl())
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    told = '<mujoco><compiler meshdir="assets"/></mujoco>'
    text = urdf(told, base=link("base", shape=shape))
    _, model, notes = load(tmp_path, text, "toy.urdf")
    assert model.nmesh == 1 and "left out" not in notes


def test_meshes_are_found_by_the_paths_of_windows(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.stl").write_bytes(stl())
    name = "..\\meshes\\a.stl"
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    text = urdf(base=link("base", shape=shape))
    _, model, notes = load(tmp_path, text, "urdf/toy.urdf")
    assert model.nmesh == 1 and "left out" not in notes


def test_text_and_flat_meshes_are_read(tmp_path):
    corners = np.eye(4, 3)[[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]]
    text = "solid a\n" + "".join("vertex {} {} {}\n".format(*c) for c in corners)
    write(tmp_path, text + "endsolid", "text.stl")
    (tmp_path / "tiny.stl").write_bytes(stl(np.eye(4, 3) * 1e-4))
    shape = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
    shapes = shape.format("text.stl") + shape.format("tiny.stl")
    _, model, notes = load(tmp_path, urdf(base=link("base", shape=shapes)), "a.urdf")
    assert model.nmesh == 2
    assert "taken as a shell" in notes


@pytest.mark.parametrize("kind", ["visual", "collision"])
@pytest.mark.parametrize(
    "solid",
    [
        '<sphere radius="0.00"/>',
        '<box size="0 0 0"/>',
        '<box size="1 1 0"/>',
        '<cylinder radius="0.1" length="0"/>',
        "",
        None,
    ],
)
def test_shapes_without_a_size_are_left_out(tmp_path, kind, solid):
    inside = "" if solid is None else f"<geometry>{solid}</geometry>"
    good = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
    shapes = "".join(f"<{kind}>{each}</{kind}>" for each in (inside, good))
    thigh = link("upper", shape=shapes)
    text = urdf(thigh, joint("arm", "base", "upper"))
    _, model, notes = load(tmp_path, text, "toy.urdf")
    assert model.ngeom == 1
    assert "Shapes without a size left out of 1 link (upper)." in notes


def test_no_line_of_another_text_is_named(tmp_path):
    bad = "<collision><geometry><box/></geometry></collision>"
    message = refused(tmp_path, urdf(base=link("base", shape=bad)), "box", "toy.urdf")
    assert message.endswith("Element 'box'")


def test_mimic_joints_follow(tmp_path):
    arms = [link("arm"), link("hand"), link("lost"), joint("shoulder", "base", "arm")]
    arms.append(
        joint("wrist", "arm", "hand", more='<mimic joint="shoulder" multiplier="2"/>')
    )
    arms.append(joint("free", "arm", "lost", more='<mimic joint="nobody"/>'))
    _, model, notes = load(tmp_path, urdf(*arms), "toy.urdf")
    assert model.neq == 1
    assert model.eq_data[0, 1] == 2.0
    assert "1 mimic joint (wrist) held to another" in notes
    assert "1 mimic joint (free) free, since" in notes


def test_a_floating_joint_is_the_free_base(tmp_path):
    text = urdf(link("odom"), joint("floats", "odom", "base", "floating"))
    _, model, notes = load(tmp_path, text, "toy.urdf")
    assert "'floats' taken as the free base 'base'" in notes
    assert model.nq == 9


@pytest.mark.parametrize(("upper", "said"), [(120, True), (6.3, False), (1e4, False)])
def test_limits_of_a_urdf_in_degrees_are_doubted(tmp_path, upper, said):
    knee = joint("knee", "thigh", "shin").replace('upper="1"', f'upper="{upper}"')
    _, _, notes = load(tmp_path, urdf(knee=knee), "toy.urdf")
    doubt = "Limits of 1 joint (knee) beyond 12.6 rad: are they in degrees?"
    assert (doubt in notes) == said


def test_massless_links_weigh_nothing_or_next_to_nothing(tmp_path):
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    more = [f'<link name="sole">{box}</link>', joint("weld", "shin", "sole", "fixed")]
    more += ['<link name="frame"/>', joint("turn", "shin", "frame", "continuous")]
    _, model, notes = load(tmp_path, urdf(*more), "toy.urdf")
    assert model.body("sole").mass[0] == 0.0
    assert "1 link (sole) with <collision> and without <inertial>: without" in notes
    assert "1 moving body (frame) without mass" in notes
    assert model.body_mass.sum() == pytest.approx(3.001)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (urdf(link("base")), "two links are called 'base'"),
        (urdf(link("")), "a link has no name"),
        (urdf(joint("ring", "shin", "base")), "ring: "),
        (urdf(joint("other", "base", "shin")), "child of two joints, 'knee' and"),
        (urdf(joint("j", "shin", "gone")), "its child link 'gone'"),
        (urdf(link("x"), joint("j", "shin", "x", "elastic")), "type 'elastic'"),
        (urdf(link("x"), joint("j", "shin", "x", "floating")), "only the base"),
        (urdf(base=link("base", m="nan")), "'base' has a mass of nan"),
        (urdf(base=link("base", i="nan")), "'base' has an inertia"),
        (urdf(base=link("base", m="${m}")), "xacro"),
        (
            urdf(base=link("base", m="1kg")),
            "link 'base': <mass value='1kg'>: give a number",
        ),
        ("<robot name='r'/>", "it has no <link>"),
        (urdf(base=link("base", i=0)), "only a body below 0.2"),
    ],
)
def test_what_is_no_tree_of_links_is_refused(tmp_path, text, match):
    refused(tmp_path, text, match, "toy.urdf")


# -- files ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "is empty"),
        (b"  \n", "is empty"),
        (b"\x7fELF\x00\x01", "is not XML"),
        (b"hello", "is not XML"),
        (b"<mujoco>", "is not well-formed XML"),
        (b"<sdf/>", "root is <sdf>.*convert SDF"),
        (b"<html/>", "expected <mujoco>"),
        (b'<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>', "DOCTYPE"),
        ('<?xml version="1.0" encoding="utf-16"?><mujoco>'.encode("utf-16"), "XML"),
        (b'<?xml version="1.0" encoding="nonsense"?><mujoco/>', "XML"),
        (b"<mujoco>" + b"<a/>" * 200_001 + b"</mujoco>", "more than 200000 elements"),
        (b'<mujoco><asset><hfield nrow="99999"/></asset></mujoco>', "at most 2000"),
        (b'<mujoco><size nkey="2000000000"/></mujoco>', "at most 10000"),
        (b"<mujoco/>", "it has no joints"),
    ],
)
def test_files_that_are_no_robots_are_refused_in_a_line(tmp_path, data, match):
    refused(tmp_path, data, match)


def test_a_blank_line_before_the_declaration_does_not_matter(tmp_path):
    declared = '\n <?xml version="1.0"?>\n'
    for text, name in ((mjcf(), "a.xml"), (urdf(), "a.urdf")):
        load(tmp_path, declared + text, name)


@pytest.mark.parametrize(
    ("note", "reads"),
    [
        ("<!-- ----- legs ----- -->", True),
        ("<!-- a --->", True),
        ("<!-- \n <body> ' \n -- -->", True),
        ("<![CDATA[ <!-- ]]>", True),
        ("<!-- <![CDATA[ -- -->", True),
        ("<!-- -- unclosed", False),
        ("<!-->", False),
        ("<![CDATA[ <!-- -->", False),
    ],
)
def test_comments_are_read_as_mujoco_reads_them(tmp_path, note, reads):
    text = mjcf(world=note)
    if reads:
        expected = mujoco.MjModel.from_xml_string(text).nbody
        assert load(tmp_path, text)[1].nbody == expected
        load(tmp_path, urdf(note), "robot.urdf")
    else:
        with pytest.raises(ValueError, match="XML"):
            mujoco.MjModel.from_xml_string(text)
        refused(tmp_path, text, "is not well-formed XML")


def test_what_is_quoted_is_no_comment(tmp_path):
    """Else what is checked would not be what MuJoCo reads."""
    write(tmp_path, '<mujoco><geom size="0.1"/></mujoco>', "part.xml")
    for file in ("<!-- -->part.xml", "part.xml<!-- ' -->"):
        text = mjcf(torso=f'<body><include file="{file}"/></body>')
        refused(tmp_path, text, "is not well-formed XML")
    text = mjcf(torso="<body name='a > \"<' pos='0 0 0.3'/><!-- -- -->")
    refused(tmp_path, text, "is not well-formed XML")
    torso = "<body name='a > \"' pos='0 0 0.3'><geom size='0.1'/></body><!-- -- -->"
    assert load(tmp_path, mjcf(torso=torso))[1].nbody == 9


def test_lines_count_where_comments_are_left_out(tmp_path):
    text = mjcf(world="<!-- -- \n\n -- -->\n\n<body>&lost;</body>")
    refused(tmp_path, text, r"line 5, column")


@pytest.mark.parametrize("part", [b"<!--", b"<a '", b"<", b"<!-- -->", b"'<", b"<?"])
def test_hostile_files_are_refused_in_linear_time(tmp_path, part):
    refused(tmp_path, b"<mujoco>" + part * (8_000_000 // len(part)), "is not|elements")


def test_includes_may_have_the_paths_of_windows(tmp_path):
    write(tmp_path, '<mujoco><geom size="0.1"/></mujoco>', "sub/part.xml")
    write(tmp_path, "<mujoco", r"sub\part.xml")
    path = write(tmp_path, mjcf(torso=r'<body><include file="sub\part.xml"/></body>'))
    plain = mujoco.MjModel.from_xml_path(str(path))
    assert check(load_model(path)).ngeom == plain.ngeom


def test_large_files_are_refused_unread(tmp_path):
    with (tmp_path / "robot.xml").open("wb") as file:
        file.truncate(60_000_000)
    refused(tmp_path, None, "60 MB of XML; at most 50 MB")


def test_folders_and_pipes_are_no_files(tmp_path):
    write(tmp_path, mjcf(), "toy.xml")
    with pytest.raises(RobotFileError, match=r"a folder; give one of its files: toy"):
        load_model(tmp_path)
    os.mkfifo(tmp_path / "pipe.xml")
    refused(tmp_path, None, "not a regular file", "pipe.xml")


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 5000, "no/such.xml", "gone.urdf"])
def test_paths_that_are_none_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotFileError):
        load_model(name)


SEEDS = (mjcf(world=WORLD), urdf())


@settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    seed=st.sampled_from(SEEDS),
    cut=st.floats(0, 1),
    junk=st.one_of(st.binary(max_size=40), st.text(max_size=20).map(str.encode)),
    keep=st.booleans(),
)
def test_damaged_files_raise_robot_file_errors_only(tmp_path, seed, cut, junk, keep):
    data = seed.encode()
    at = int(cut * len(data))
    path = tmp_path / "damaged.xml"
    path.write_bytes(data[:at] + junk + (data[at:] if keep else b""))
    try:
        robot = load_model(path)
    except RobotFileError:
        return
    robot.spec.compile()


CODED = mjcf().replace("left_hip", "linke_H\u00fcfte")


@pytest.mark.parametrize(
    ("coding", "declared"),
    [("latin-1", "ISO-8859-1"), ("latin-1", ""), ("utf-16", "UTF-16")],
)
def test_other_codings_are_told_to_be_saved_as_utf_8(tmp_path, coding, declared):
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    message = refused(tmp_path, (head + CODED).encode(coding), "save it as UTF-8")
    assert message.endswith("; save it as UTF-8")
    assert "save it" not in refused(tmp_path, CODED.replace("hinge", "")[:-9], "XML")


def test_other_codings_of_comments_do_not_matter(tmp_path):
    head = '<?xml version="1.0" encoding="ISO-8859-1"?><!-- H\u00fcfte -->'
    path = tmp_path / "robot.xml"
    path.write_bytes((head + mjcf()).encode("latin-1"))
    assert load_model(path).model.njnt == 7


@pytest.mark.parametrize(("low", "high"), [(120, 0), (30, 30)])
def test_a_range_that_mujoco_leaves_out_is_doubted(tmp_path, low, high):
    text = mjcf().replace('range="0 120"', f'range="{low} {high}"')
    robot, model, notes = load(tmp_path, text)
    assert not model.jnt_limited[model.joint("left_knee").id]
    said = "2 joints (left_knee, right_knee) without limits: the lower end of its range"
    assert said in notes
    assert any(isinstance(note, Doubt) and said in note for note in robot.notes)
    _, _, plain = load(tmp_path, mjcf().replace('range="0 120"', 'range="0 0"'))
    assert "without limits" not in plain


# -- names ---------------------------------------------------------------------------


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout of the menagerie with toys in it, and no package."""
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: None)
    scene = '<mujoco><include file="op3.xml"/></mujoco>'
    for name in ("op3.xml", "op3_mjx.xml"):
        write(tmp_path, mjcf(), f"robotis_op3/{name}")
    write(tmp_path, scene, "robotis_op3/scene.xml")
    write(tmp_path, "Apache License\nVersion 2.0", "robotis_op3/LICENSE")
    for name in ("talos", "talos_motor", "talos_position", "scene_motor"):
        write(tmp_path, mjcf(), f"pal_talos/{name}.xml")
    for name in ("a", "b"):
        write(tmp_path, mjcf(), f"unitree_g1/{name}.xml")
    return tmp_path


def test_names_are_found_in_a_checkout(checkout):
    robot = load_model("robotis_op3")
    assert robot.origin == "robotis_op3"
    known = {robot.name: robot for robot in list_robots()}
    assert known["robotis_op3"].licence == "Apache-2.0"
    assert known["robotis_op3"].available
    assert known["pal_talos"].licence == "unsaid"
    assert not known["booster_t1"].available
    assert known["res"].source == "built-in"
    load_model("pal_talos")
    with pytest.raises(RobotFileError, match=r"give the path.*a\.xml, b\.xml"):
        load_model("unitree_g1")
    with pytest.raises(RobotFileError, match="booster_t1: not in MENAGERIE_ROOT"):
        load_model("booster_t1")


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("robotis_op4", "did you mean robotis_op3"),
        ("RES", r"did you mean res\?"),
        ("unitree_g1", "not on this computer; pip install 'gaitchain\\[robots\\]'"),
        ("res", "built-in reduced biped"),
        ("gibberish", "no robot of that name; give"),
    ],
)
def test_names_that_are_none_are_refused(name, match, monkeypatch):
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: None)
    with pytest.raises(RobotFileError, match=match):
        load_model(name)


def test_a_link_to_nothing_is_told_where_it_leads(tmp_path):
    link = tmp_path / "robot.xml"
    link.symlink_to("gone.xml")
    with pytest.raises(RobotFileError, match=r"robot\.xml: a link to gone\.xml, which"):
        load_model(link)


def test_a_file_that_is_missing_is_told_with_the_nearest_one(tmp_path):
    for name in ("Arm.xml", "trunk.urdf", "arm.txt"):
        write(tmp_path, "", name)
    near = re.escape(f"amr.xml: no such file (did you mean {tmp_path / 'Arm.xml'}?)")
    with pytest.raises(RobotFileError, match=near):
        load_model(tmp_path / "amr.xml")
    with pytest.raises(RobotFileError, match=r"walker\.xml: no such file; give"):
        load_model(tmp_path / "walker.xml")
    with pytest.raises(RobotFileError, match=r"amr\.xml: no such file; give"):
        load_model(tmp_path / "gone" / "amr.xml")


# -- robots of the field --------------------------------------------------------------

FILES = sorted(REAL.glob("*/*.xml")) if REAL.is_dir() else []
needs_robots = pytest.mark.skipif(not FILES, reason="no checkout of the menagerie")


@pytest.mark.slow
@needs_robots
@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}"
)
def test_every_robot_of_the_field_loads(path):
    try:
        plain = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:  # a checkout without all meshes: they are left out
        (missing,) = re.findall(r"Error opening file '(?:.*/)?(.+)'", str(error))
        robot = load_model(path)
        assert any(missing in note for note in robot.notes)
        assert check(robot).body_mass.sum() > 0.0
        return
    robot = load_model(path)
    model = check(robot)
    assert (model.nq, model.nu) == (plain.nq, plain.nu)
    assert model.body_mass.sum() == pytest.approx(plain.body_mass.sum())
    as_told = np.isclose(model.jnt_range, plain.jnt_range)
    assert np.all(as_told | np.isclose(model.jnt_range, reached(plain)))
    np.testing.assert_allclose(model.body_inertia, plain.body_inertia)


def reached(model):
    """How far joints go that follow another, as Talos' fingers do their motor."""
    ranges = model.jnt_range.copy()
    ties = np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT)
    for tie in ties[model.eq_obj2id[ties] >= 0]:
        joint, other = model.eq_obj1id[tie], model.eq_obj2id[tie]
        shift, ratio = model.eq_data[tie, :2]
        low, high = np.sort(shift + ratio * model.jnt_range[other])
        ranges[joint] = max(ranges[joint, 0], low), min(ranges[joint, 1], high)
    return ranges


@needs_robots
@pytest.mark.parametrize(
    "name", ["robotis_op3", "unitree_g1", "booster_t1", "pal_talos"]
)
def test_robots_of_the_field_load_by_name(name, monkeypatch):
    monkeypatch.setenv("MENAGERIE_ROOT", str(REAL))
    assert load_model(name).spec.actuators


def test_terrain_without_its_picture_is_scenery(tmp_path):
    """A height field's geom was freed twice once, which no `except` catches."""
    top = '<asset><hfield name="h" file="none.png" size="9 9 0.1 1"/></asset>'
    world = '<geom type="hfield" hfield="h"/><geom type="plane" size="1 1 1"/>'
    for _ in range(3):
        robot = load_model(write(tmp_path, mjcf(top=top, world=world)))
        check(robot)
        assert "Scenery left out: 2 geoms." in robot.notes


def test_terrain_that_a_body_carries_is_scenery_too(tmp_path):
    top = '<asset><hfield name="h" file="none.png" size="9 9 0.1 1"/></asset>'
    torso = '<geom type="hfield" hfield="h" mass="0"/>'
    robot = load_model(write(tmp_path, mjcf(top=top, torso=torso)))
    check(robot)
    assert "Scenery left out: 1 geom." in robot.notes
