"""What a refusal adds from the robot's file, where that may be the cause."""

import pytest
from toy_urdf import toy_urdf

from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.errors import RobotFileError


def write(folder, text, name="robot.urdf"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, "utf-8")
    return path


def refusal(path):
    with pytest.raises(RobotFileError) as caught:
        load_with_findings(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    return message


def test_the_toy_can_be_read(tmp_path):
    loaded = load_with_findings(write(tmp_path, toy_urdf()))
    assert loaded.robot.reduced.mass == pytest.approx(8.4)


def test_a_foot_without_its_mesh_says_what_was_looked_for(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    mesh = '<mesh filename="package://toy_body/meshes/sole.stl"/>'
    message = refusal(write(tmp_path, toy_urdf(mesh)))
    assert "no shape that could be read; put its meshes where the file says" in message
    assert "the file: 1 collision mesh file (sole.stl) left out: not found" in message
    assert f"1 package (toy_body) of meshes not found near {tmp_path}" in message
    assert "set ROS_PACKAGE_PATH" in message


def test_a_mesh_of_another_case_is_named(tmp_path):
    write(tmp_path, "", "toy_body/meshes/Sole.STL")
    mesh = '<mesh filename="package://toy_body/meshes/sole.stl"/>'
    message = refusal(write(tmp_path, toy_urdf(mesh), "toy_body/urdf/robot.urdf"))
    assert "sole.stl is not there, Sole.STL is" in message
    assert "ROS_PACKAGE_PATH" not in message  # the package was found
