"""`gaitchain robots` as a user has it."""

import json
from types import SimpleNamespace

import pytest

from gaitchain.cli.robots import run
from gaitchain.errors import CommandError
from gaitchain.robot.reduced_biped import builtin_robots


@pytest.fixture(autouse=True)
def no_package(monkeypatch):
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: None)
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)


def test_robots_lists_names_licences_and_how_to_get_them(tmp_path, capsys):
    path = tmp_path / "robots.json"
    assert run(SimpleNamespace(json=path)) == 0
    out = capsys.readouterr().out
    listed = json.loads(path.read_text("utf-8"))
    names = [robot["name"] for robot in listed]
    assert set(builtin_robots()) | {"unitree_g1", "robotis_op3"} <= set(names)
    assert all(robot["licence"] and robot["note"] for robot in listed)
    assert all(name in out for name in names)
    assert "pip install 'gaitchain[robots]'" in out
    assert "URDF" in out


def test_robots_needs_no_file(capsys):
    assert run(SimpleNamespace(json=None)) == 0
    assert "res" in capsys.readouterr().out


def test_robots_refuses_a_file_that_cannot_be_written(tmp_path):
    with pytest.raises(CommandError):
        run(SimpleNamespace(json=tmp_path))
