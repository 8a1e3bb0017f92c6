"""What a robot's file has wrong, said where the robot is refused."""

import pytest
from robot_text import write
from toy_file import toy
from toy_urdf import toy_urdf

from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.errors import RobotFileError


def write_urdf(folder, text, name="robot.urdf"):
    return write(folder, text, name)


def refusal(path):
    with pytest.raises(RobotFileError) as caught:
        load_with_findings(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return message


def test_the_toy_can_be_read(tmp_path):
    loaded = load_with_findings(write_urdf(tmp_path, toy_urdf()))
    assert loaded.robot.reduced.mass == pytest.approx(8.4)


def test_a_foot_without_its_mesh_says_what_was_looked_for(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    mesh = '<mesh filename="package://toy_body/meshes/sole.stl"/>'
    message = refusal(write_urdf(tmp_path, toy_urdf(mesh)))
    assert "no shape that could be read; put its meshes where the file says" in message
    assert "the file: 1 collision mesh file (sole.stl) left out: not found" in message
    assert f"1 package (toy_body) of meshes not found near {tmp_path}" in message
    assert "set ROS_PACKAGE_PATH" in message


def test_a_package_whose_name_no_folder_can_have_is_missing(tmp_path):
    mesh = f'<mesh filename="package://{300 * "a"}/sole.stl"/>'
    message = refusal(write_urdf(tmp_path, toy_urdf(mesh)))
    assert "1 package (aaa" in message and ") of meshes not found" in message


def test_a_mesh_of_another_case_is_named(tmp_path):
    write_urdf(tmp_path, "", "toy_body/meshes/Sole.STL")
    mesh = '<mesh filename="package://toy_body/meshes/sole.stl"/>'
    message = refusal(write_urdf(tmp_path, toy_urdf(mesh), "toy_body/urdf/robot.urdf"))
    assert "sole.stl is not there, Sole.STL is" in message
    assert "ROS_PACKAGE_PATH" not in message  # the package was found


def test_a_robot_without_masses_is_refused(tmp_path):
    text = toy_urdf(weighs=lambda name, mass: None)
    message = refusal(write_urdf(tmp_path, text))
    assert message.endswith(
        ": 13 of 13 moving links have no mass; give them <inertial>"
    )


@pytest.mark.parametrize("part", ["pitch", "knee", "tilt"])
def test_legs_without_the_mass_of_a_limb_are_refused(tmp_path, part):
    text = toy_urdf(weighs=lambda name, mass: None if part in name else mass)
    message = refusal(write_urdf(tmp_path, text))
    assert f"without mass: 2 links (left_{part}_link, right_{part}_link)" in message


def test_links_between_crossing_joints_may_have_no_mass(tmp_path):
    def weighs(name, mass):
        return None if name.split("_")[1:2] in (["yaw"], ["roll"], ["ankle"]) else mass

    text = toy_urdf(weighs=weighs)
    loaded = load_with_findings(write_urdf(tmp_path, text))
    assert any("without mass" in note for note in loaded.notes)


def test_trees_that_were_left_out_are_named(tmp_path):
    ball = '<worldbody><body name="ball"><freejoint/><geom size="0.1"/></body>'
    text = toy().replace("<worldbody>", ball).replace('axis="0 1 0"', 'axis="1 0 0"')
    message = refusal(write_urdf(tmp_path, text, "robot.xml"))
    assert message.endswith("the file: 1 tree (ball) left out: 'torso' is the robot.")


def test_a_forgotten_unit_of_angles_is_named(tmp_path):
    text = toy().replace('<compiler angle="radian"/>', "")
    message = refusal(write_urdf(tmp_path, text, "robot.xml"))
    assert "no standing pose" in message
    assert 'at most 2.2 deg from 0: is <compiler angle="radian"/> missing?' in message


def test_what_cannot_be_reduced_is_refused_by_its_file(tmp_path):
    message = refusal(
        write_urdf(tmp_path, toy_urdf(weighs=lambda name, mass: 1e3 * mass))
    )
    assert "if the file's are in g" in message


@pytest.mark.parametrize(
    ("good", "bad", "said"),
    [
        (
            'xyz="0 -0.07 -0.05"',
            'xyz="0 -0.07"',
            "joint 'right_yaw': <origin xyz='0 -0.07'>: give 3 numbers",
        ),
        (
            '<mass value="4.0"/>',
            '<mass value="4,0"/>',
            "link 'torso': <mass value='4,0'>: give a number",
        ),
        (
            '<box size="0.12 0.2 0.24"/>',
            '<box size="0.12 0.2 wide"/>',
            "link 'torso': <box size='0.12 0.2 wide'>: give 3 numbers",
        ),
    ],
)
def test_what_is_no_number_in_a_urdf_is_told_with_its_owner(tmp_path, good, bad, said):
    """MuJoCo says the tag alone, and the line of a text that nobody has."""
    text = toy_urdf()
    assert good in text
    assert said in refusal(write_urdf(tmp_path, text.replace(good, bad, 1)))


def test_an_empty_attribute_of_a_urdf_counts_as_left_out(tmp_path):
    text = toy_urdf().replace('<origin xyz="0 0 0.1"/>', '<origin xyz=""/>', 1)
    assert 'xyz=""' in text
    assert load_with_findings(write_urdf(tmp_path, text)).findings is not None
