"""`gaitchain robots` as a user has it."""

import json
from types import SimpleNamespace

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


def test_a_user_without_a_home_sees_the_robots_all_the_same(monkeypatch, capsys):
    """Also one whose robots are downloaded into his home."""

    class Homeless:
        class MenagerieError(Exception):
            pass

        def __init__(self):
            raise RuntimeError("Could not determine home directory.")

        Cache = property(lambda self: Homeless)
        robots = staticmethod(lambda kind: [SimpleNamespace(name="g1", license="MIT")])
        names = staticmethod(lambda: ["g1"])
        get = staticmethod(lambda name: SimpleNamespace(path=Homeless))

    package = object.__new__(Homeless)
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: package)
    code, out, _ = call(capsys, "robots")
    assert code == 0
    assert "downloaded when first used" in out
    code, _, err = call(capsys, "inspect", "g1")
    assert code == 2
    assert "g1: Could not determine home directory." in err
    assert "MENAGERIE_ROOT" in err
