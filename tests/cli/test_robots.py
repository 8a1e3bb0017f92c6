"""`gaitchain robots` as a user has it."""

import json

import pytest
from commands import call

from gaitchain.robot.reduced_biped import builtin_robots


@pytest.fixture(autouse=True)
def no_package(monkeypatch):
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: None)
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)


def test_robots_lists_names_licences_and_how_to_get_them(tmp_path, capsys):
    path = tmp_path / "robots.json"
    code, out, _ = call(capsys, "robots", "--json", path)
    assert code == 0
    listed = json.loads(path.read_text("utf-8"))
    names = [robot["name"] for robot in listed]
    assert set(builtin_robots()) | {"unitree_g1", "robotis_op3"} <= set(names)
    assert all(robot["licence"] and robot["note"] for robot in listed)
    assert all(name in out for name in names)
    assert "pip install 'gaitchain[robots]'" in out
    assert "URDF" in out


def test_robots_needs_no_file(capsys):
    code, out, _ = call(capsys, "robots")
    assert code == 0
    assert "res" in out


def test_robots_refuses_a_file_that_cannot_be_written(tmp_path, capsys):
    code, _, err = call(capsys, "robots", "--json", tmp_path)
    assert code == 2
    assert "cannot be written" in err
