"""The floor under a robot's own model: contacts are as the robot's file has them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from toy_file import toy
from verdicts import PASSED

from gaitchain.backends.model import ModelBackend
from gaitchain.build.own_model import own_model
from gaitchain.build.own_trials import describe_own_model
from gaitchain.errors import CommandError
from gaitchain.gait.qualification import OwnReport, Qualification
from gaitchain.sim.world import World

SOLE = 'type="box" size="0.09 0.05 0.01"'
FLOOR = '<geom name="floor" type="plane" size="0 0 1" contype="0" conaffinity="0"/>'
PAIR = '<pair geom1="{}" geom2="{}" solref="0.008 1" friction="0.7 0.7 0.005 0 0"/>'


@pytest.fixture
def described(toy_library, tmp_path):
    """Return what is walked of the toy with a changed text."""

    def describe(text):
        file = tmp_path / "changed.xml"
        file.write_text(text, "utf-8")
        return describe_own_model(file, toy_library)

    return describe


def with_default(geom):
    return toy().replace("<default>", f"<default><geom {geom}/>")


def with_soles(numbers):
    assert toy().count(SOLE) == 2
    return toy().replace(SOLE, f"{SOLE} {numbers}")


@pytest.mark.parametrize("bits", [1, 2])
def test_a_default_class_that_touches_nothing_is_not_the_floors(described, bits):
    soles = f'{SOLE} contype="{bits}" conaffinity="{bits}"'
    text = with_default('contype="0" conaffinity="0"').replace(SOLE, soles)
    assert described(text).friction == 1.0


def test_a_floor_of_bits_of_its_own_is_touched_by_the_soles_alone(
    tmp_path, toy_library
):
    """Shins of MuJoCo's own bits would stand on a floor that the soles fall through."""
    file = tmp_path / "bits.xml"
    soles = f'{SOLE} contype="2" conaffinity="2"'
    floor = FLOOR.replace('contype="0" conaffinity="0"', 'contype="2" conaffinity="2"')
    text = toy().replace(SOLE, soles).replace("<worldbody>", f"<worldbody>{floor}")
    file.write_text(text, "utf-8")
    robot = ModelBackend(own_model(file, toy_library.robot, World()), toy_library)
    bodies = {robot.model.body(robot.model.geom_bodyid[g]).name for g in robot.touching}
    assert bodies == {"left6", "right6"}


def test_numbers_of_a_default_class_are_not_the_floors(tmp_path, toy_library):
    file = tmp_path / "soft.xml"
    file.write_text(with_default('margin="0.02" condim="6" friction="2 1 1"'), "utf-8")
    model = own_model(file, toy_library.robot, World())
    (floor,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert (model.geom_margin[floor], model.geom_condim[floor]) == (0.0, 3)
    assert not model.geom_friction[floor].any()


@pytest.mark.parametrize(
    ("solref", "option", "seconds"),
    [
        ("0.005 1", "", 0.005),
        ("0.001 1", "", 0.004),  # MuJoCo takes two time steps at least
        ("0.001 1", '<option><flag refsafe="disable"/></option>', 0.001),
        ("-9000 -250", "", 0.008),  # stiffness and damping: 2 / damping
    ],
)
def test_contacts_are_walked_as_the_soles_have_them_and_so_said(
    described, solref, option, seconds
):
    text = with_soles(f'solref="{solref}"').replace("<default>", f"{option}<default>")
    assert described(text).contact_s == pytest.approx(seconds)


def test_the_floor_changes_nothing_of_a_soles_contact(tmp_path, toy_library):
    file = tmp_path / "hard.xml"
    numbers = 'solref="0.005 1.2" solimp="0.8 0.9 0.002 0.4 1" friction="0.7 0.01 0"'
    file.write_text(with_soles(numbers), "utf-8")
    robot = ModelBackend(own_model(file, toy_library.robot, World()), toy_library)
    robot.data.qpos[robot.in_model.free + 2] -= 0.001
    mujoco.mj_forward(robot.model, robot.data)
    kinds = robot.model.geom_type[robot.data.contact.geom]
    floored = (kinds == mujoco.mjtGeom.mjGEOM_PLANE).any(axis=1)
    assert floored.sum() == 8
    for contact in np.array(robot.data.contact)[floored]:
        np.testing.assert_array_equal(contact.solref, [0.005, 1.2])
        np.testing.assert_array_equal(contact.solimp, [0.8, 0.9, 0.002, 0.4, 1.0])
        np.testing.assert_array_equal(contact.friction[:3], [0.7, 0.7, 0.01])


def test_pairs_with_the_files_own_floor_are_pairs_with_the_new_one(described):
    names = ("left_sole", "right_sole")
    text = with_default('contype="0" conaffinity="0"')
    for name in names:
        text = text.replace(f"<geom {SOLE}", f'<geom name="{name}" {SOLE}', 1)
    pairs = PAIR.format("floor", names[0]) + PAIR.format(names[1], "floor")
    text = text.replace("<worldbody>", f"<worldbody>{FLOOR}")
    text = text.replace("</mujoco>", f"<contact>{pairs}</contact></mujoco>")
    said = described(text)
    assert (said.friction, said.contact_s) == (0.7, 0.008)
    with pytest.raises(
        CommandError, match=r"changed\.xml cannot be simulated as it is"
    ):
        described(text.replace(pairs, ""))


@pytest.mark.parametrize("head", ["\n<?xml version='1.0'?>\n", "<!-- -- legs -- -->"])
def test_a_file_that_mujoco_reads_is_walked(described, head):
    assert described(head + toy()).friction == 1.0


def test_a_time_step_that_does_not_fit_is_made_to(described):
    said = described(toy().replace("<default>", '<option timestep="0.004"/><default>'))
    assert said.timestep_s == pytest.approx(0.01 / 3.0)
    assert said.step == (
        "3.33 ms: the file's 4 ms do not divide the control period of 10 ms"
    )
    assert f"; time step {said.step}" in said.describe()
    usual = described(toy())
    assert usual.step == ""
    for model in (said, usual, replace(usual, left_out=2)):
        verdicts = replace(PASSED, own=OwnReport(passed=True, model=model))
        plain = verdicts.to_json()
        assert ("step" in plain["own"]["model"]) == bool(model.step)
        assert ("left_out" in plain["own"]["model"]) == bool(model.left_out)
        again = Qualification.from_json(plain)
        assert again == verdicts
        assert again.to_json() == plain
