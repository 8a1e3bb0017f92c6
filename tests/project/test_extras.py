"""What the core brings, and what is said where it does not suffice."""

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

import gaitchain
from gaitchain.cli import run
from gaitchain.cli.parser import parse
from gaitchain.errors import EXTRAS, needed_by, require
from gaitchain.gait.library_file import save_library

ROOT = Path(__file__).parents[2]
CORE = ROOT / ".ci/core_install.py"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def test_the_extras_are_those_of_the_project():
    extras = PROJECT["optional-dependencies"]
    assert set(extras) == {*EXTRAS, "all"}
    (everything,) = extras["all"]
    assert set(re.findall(r"\w+", everything)[1:]) == set(EXTRAS)
    assert len(PROJECT["dependencies"]) <= 6


def test_the_readme_says_what_each_extra_is_for():
    readme = (ROOT / "README.md").read_text("utf-8")
    rows = re.findall(r"^\| (`gaitchain[^|]*) \|", readme, re.M)
    told = re.findall(r"gaitchain\[(\w+)\]", " ".join(rows))
    assert sorted(told) == sorted(PROJECT["optional-dependencies"])


def test_every_module_of_an_extra_exists():
    """Of those that are installed: a wrong name would never be found."""
    brought = {"sim": 7, "view": 4, "serve": 8, "servos": 3, "ros": 3, "rl": 1}
    for extra, count in brought.items():
        assert len(EXTRAS[extra]) == count
        assert all(find_spec(module) for module in EXTRAS[extra]), extra


@pytest.mark.parametrize(
    ("words", "package", "extra"),
    [
        ("serve", "fastapi", "serve"),
        ("serve", "mujoco", "sim"),
        ("walk", "viser", "view"),
        ("build res -o res.gait", "joblib", "sim"),
        ("push res.gait -o push.png", "matplotlib", "view"),
        ("qualify res.gait --backend ray", "ray", "ray"),
        ("replay walk.mcap", "mcap", "serve"),
    ],
)
def test_a_verb_names_the_extra(words, package, extra, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, package, None)
    assert run(words.split()) == 2
    verb = words.split()[0]
    expected = f"`{verb}` needs the extra '{extra}': pip install 'gaitchain[{extra}]'"
    assert capsys.readouterr().err == f"gaitchain: {expected}\n"


def test_all_that_a_verb_misses_is_named_at_once(monkeypatch, capsys):
    for package in ("mujoco", "matplotlib"):
        monkeypatch.setitem(sys.modules, package, None)
    assert run(["walk"]) == 2
    assert "extras 'sim', 'view': pip install 'gaitchain[sim,view]'" in (
        capsys.readouterr().err
    )


def without_extras(code):
    """Run code in a process with every package of an extra hidden."""
    hide = (
        "import runpy, sys\n"
        "from gaitchain.errors import EXTRAS\n"
        "hidden = [name for names in EXTRAS.values() for name in names]\n"
        "sys.modules.update(dict.fromkeys(hidden))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", hide + code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_without_any_extra_the_core_walks_and_says_what_to_install():
    without_extras(
        f"core = runpy.run_path({str(CORE)!r})\n"
        "core['check_messages']()\n"
        "core['check_inspect']()\n"
        "core['check_walk']()\n"
    )


def test_a_library_of_a_file_is_looked_at_without_any_extra(toy_library, tmp_path):
    """Its joints, as whoever connects the robot on its own computer needs them."""
    path = tmp_path / "toy.gait"
    save_library(toy_library, path)
    said = without_extras(
        f"from gaitchain.cli import run\nsys.exit(run(['inspect', {str(path)!r}]))\n"
    )
    for name in toy_library.robot.legs.joint_names:
        assert name in said


def test_a_package_of_no_extra_is_not_explained_away():
    with pytest.raises(ModuleNotFoundError, match="no_such_package"), needed_by("it"):
        import no_such_package  # noqa: F401
    with pytest.raises(ModuleNotFoundError, match="no_such_part"), needed_by("it"):
        import numpy.no_such_part  # noqa: F401
    with pytest.raises(ModuleNotFoundError, match="no_such_part"), needed_by("it"):
        import mujoco.no_such_part  # noqa: F401
    require("it", ["sim", "view"])


def test_verbs_do_not_ask_for_pictures_that_nobody_wants():
    from gaitchain.cli import extras_of

    assert extras_of(parse(["push", "res.gait"])) == ["sim"]
    assert extras_of(parse(["push", "res.gait", "-o", "a.png"])) == ["sim", "view"]
    assert extras_of(parse(["serve", "--backend", "mock"])) == ["serve"]
    assert extras_of(parse(["robots"])) == []
    doctor = ["doctor", "res", "--port", "emulated"]
    assert extras_of(parse(doctor)) == []
    assert extras_of(parse([*doctor, "--view", "0"])) == ["sim", "view"]
    assert extras_of(parse(["calibrate", "res", "--preview", "a.html"])) == (
        ["sim", "view"]
    )


def test_the_api_is_listed():
    assert {"Walker", "MujocoBackend", "__version__"} <= set(dir(gaitchain))
    assert set(gaitchain.__all__) <= set(dir(gaitchain))
