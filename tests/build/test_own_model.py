"""A robot's own model: the toy's file, and others' files."""

import os
import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from toy_file import toy
from toy_robot import Builder, Toy, tie_hip_pitches
from verdicts import PASSED

from gaitchain.build.own_model import own_digest, own_model
from gaitchain.build.own_trials import (
    describe_own_model,
)
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.qualification import OwnReport, Qualification
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import World


def test_the_model_is_the_files_with_a_floor(toy_path, toy_library):
    model = own_model(toy_path, toy_library.robot, World())
    file = mujoco.MjModel.from_xml_path(str(toy_path))
    assert (model.njnt, model.nu) == (file.njnt, file.nu)
    assert model.ngeom == file.ngeom + 1
    assert model.opt.timestep == file.opt.timestep
    np.testing.assert_allclose(model.body_mass, file.body_mass)
    floor = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    np.testing.assert_array_equal(model.geom_friction[floor], 0.0)
    np.testing.assert_allclose(model.opt.gravity, [0.0, 0.0, -9.81])


def test_links_differ_and_floors_slope_as_the_world_says(toy_path, toy_library):
    world = World(model_error=0.1, slope_deg=3.0, seed=4)
    model = own_model(toy_path, toy_library.robot, world)
    file = mujoco.MjModel.from_xml_path(str(toy_path))
    part = model.body_mass[1:] / file.body_mass[1:]
    assert np.abs(part - 1.0).max() <= 0.1 + 1e-9
    assert (part != 1.0).all(), "of links whose shapes weigh, too"
    assert model.opt.gravity[0] == pytest.approx(-9.81 * np.sin(np.radians(3.0)))


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
@pytest.mark.parametrize(
    "weighed", ['inertiafromgeom="true"', 'settotalmass="9"', 'inertiagrouprange="0 0"']
)
def test_links_weigh_what_mujoco_makes_of_the_file(toy_library, tmp_path, weighed):
    file = tmp_path / "weighed.xml"
    file.write_text(toy().replace('angle="radian"', f'angle="radian" {weighed}'))
    expected = mujoco.MjModel.from_xml_path(str(file))
    model = own_model(file, toy_library.robot, World())
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        found, wanted = getattr(model, name), getattr(expected, name)
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-15)
    off = own_model(file, toy_library.robot, World(model_error=0.1, seed=4))
    moving = expected.body_mass > 1e-3
    assert (off.body_mass != expected.body_mass)[moving].all()


def test_a_file_without_actuators_gets_them(toy_path, toy_library, tmp_path):
    """As a URDF, or a model whose actuators are in another file."""
    text = toy_path.read_text("utf-8")
    bare = tmp_path / "bare.xml"
    begin, end = text.index("<actuator>"), text.index("</actuator>")
    bare.write_text(text[:begin] + text[end + len("</actuator>") :], "utf-8")
    model = own_model(bare, toy_library.robot, World())
    driven = {model.joint(j).name for j in model.actuator_trnid[:, 0]}
    assert driven == {*toy_library.robot.legs.joint_names, *toy_library.robot.legs.held}


def test_actuators_of_tendons_do_not_pull_at_the_legs(toy_library, tmp_path):
    """As nobody gives them a target, a servo among them would hold knees straight."""
    cord = (
        '<tendon><fixed name="left_knee"><joint joint="left_knee" coef="1"/>'
        '<joint joint="left_ankle" coef="1"/></fixed></tendon><actuator>'
    )
    pull = '<position name="pull" tendon="left_knee" kp="300"/></actuator>'
    sensor = '<sensor><actuatorfrc actuator="pull"/></sensor></mujoco>'
    text = toy().replace("<actuator>", cord).replace("</actuator>", pull)
    file = tmp_path / "corded.xml"
    file.write_text(text.replace("</mujoco>", sensor), "utf-8")
    model = own_model(file, toy_library.robot, World())
    assert (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()
    assert (model.nu, model.nsensor, model.ntendon) == (14, 0, 1)
    told = describe_own_model(file, toy_library)
    assert (told.actuators, told.left_out) == (14, 1)
    assert "1 actuators that pull at legs" in told.describe()


def test_gains_that_replace_the_files_are_told(toy_path, toy_library, tmp_path):
    """And kept with the library; where they are the file's, nothing is."""
    file = tmp_path / "soft.xml"
    file.write_text(toy(kp=5.0), "utf-8")
    robot = load_robot(file)
    soft = replace(toy_library, poses=replace(toy_library.poses, robot=robot))
    told = describe_own_model(file, soft)
    least, most = min(robot.legs.stiffness), max(robot.legs.stiffness)
    said = f"{least:.3g} to {most:.3g} N m/rad in place of the file's 5"
    assert least > 50.0 and told.gains == said
    assert f"; leg servos of {said}" in told.describe()
    tests = replace(PASSED, own=OwnReport(passed=True, model=told))
    assert Qualification.from_json(tests.to_json()).own.model.gains == said
    own = describe_own_model(toy_path, toy_library)
    assert own.gains == ""
    tests = replace(PASSED, own=OwnReport(passed=True, model=own))
    assert "gains" not in tests.to_json()["own"]["model"]


def test_joints_without_a_rotor_get_the_librarys(toy_library, tmp_path):
    """As where it was derived, or is in a profile; the skeleton has it, too."""
    file = tmp_path / "light.xml"
    file.write_text(toy().replace('armature="0.02"', 'armature="0"'), "utf-8")
    legs = toy_library.robot.legs
    model = own_model(file, toy_library.robot, World())
    found = [model.dof_armature[model.joint(n).dofadr[0]] for n in legs.joint_names]
    np.testing.assert_allclose(found, legs.armature.ravel())
    assert model.dof_armature[model.joint("left_shoulder").dofadr[0]] == 0.0


@pytest.mark.parametrize("bare", [False, True])
def test_joints_that_a_coupling_holds_get_no_actuator(tmp_path, bare):
    """It would work against the coupling."""
    builder = Builder(Toy(hip=("yaw", "roll", "pitch", "pitch")))
    tie_hip_pitches(builder, 0.0)
    builder.model()
    followers = {builder.made[leg, "hip_pitch"][0] for leg in range(2)}
    for actuator in list(builder.spec.actuators):
        if bare or actuator.target in followers:
            builder.spec.delete(actuator)
    builder.spec.compile()
    file = tmp_path / "coupled.xml"
    file.write_text(builder.spec.to_xml(), "utf-8")
    robot = load_robot(file)
    model = own_model(file, robot, World())
    driven = {model.joint(j).name for j in model.actuator_trnid[:, 0]}
    assert driven == {*robot.legs.joint_names, *robot.legs.held} - followers
    assert followers <= robot.legs.held.keys()


def test_what_is_simulated_has_a_hash(toy_path, toy_library, tmp_path):
    """By which a build that goes on knows that the file was edited."""
    robot, file = toy_library.robot, tmp_path / "toy.xml"
    shutil.copy(toy_path, file)
    first = own_digest(file, robot)
    assert first == own_digest(toy_path, robot) != ""
    changes = ('<geom friction="0.2"/>', '<geom solref="0.01 1"/>')
    texts = [toy().replace("<default>", f"<default>{change}") for change in changes]
    arms = toy().replace('_shoulder" kp="300.0"', '_shoulder" kp="200"')
    found = {first}
    for second, text in enumerate([*texts, arms], start=1):
        file.write_text(text, "utf-8")
        os.utime(file, (second, second))  # edited later
        assert load_robot(file).fingerprint == robot.fingerprint
        found.add(own_digest(file, robot))
    assert len(found) == 4
    assert own_digest("res", load_box_robot("res")) == ""


def test_links_that_overlap_as_it_stands_pass_through_each_other(
    hulled, toy_path, toy_library
):
    robot = toy_library.robot
    model = own_model(hulled, robot, World())
    apart = {frozenset(pair) for pair in _excluded(model)}
    assert frozenset(("left_arm", "right_arm")) in apart
    assert frozenset(("left_arm", "left3")) in apart
    assert frozenset(("left_arm", "left6")) not in apart, "these can meet"
    assert not _excluded(own_model(toy_path, robot, World()))


def test_pairs_that_the_file_excludes_stay_excluded(tmp_path, toy_library):
    """Also of a robot that a scene attaches by a prefix, with the scene's own."""
    robot, scene = tmp_path / "robot.xml", tmp_path / "scene.xml"
    own = '<contact><exclude body1="left_arm" body2="left3"/></contact></mujoco>'
    robot.write_text(toy().replace("</mujoco>", own), "utf-8")
    scene.write_text(
        '<mujoco><asset><model name="robot" file="robot.xml"/></asset><worldbody>'
        '<geom type="plane" size="1 1 1"/><frame><attach model="robot" body="torso" '
        'prefix="r_"/></frame></worldbody><contact><exclude body1="r_left_arm" '
        'body2="r_left6"/></contact></mujoco>',
        "utf-8",
    )
    assert _excluded(own_model(robot, toy_library.robot, World())) == [
        ("left_arm", "left3")
    ]
    attached = _excluded(own_model(scene, load_robot(scene), World()))
    assert attached == [("r_left_arm", "r_left3"), ("r_left_arm", "r_left6")]


def _model(file, library):
    return own_model(file, library.robot, World())


def _excluded(model):
    pairs = [divmod(int(s), 1 << 16) for s in model.exclude_signature]
    return [(model.body(a).name, model.body(b).name) for a, b in pairs]
