"""What docs/extend.md says is carried out: its changes applied, its code run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gaitchain.backends.base import Backend

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extend.md").read_text("utf-8")
RECIPES = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S))
RULE = "A feedback rule"
CHANGING = ("A stride preset", RULE, "A disturbance")
FEWER = {
    "usual_errors": {
        "_RUNS, _RUNS_OFF, _SECONDS = 10, 5, 6.0": (
            "_RUNS, _RUNS_OFF, _SECONDS = 1, 1, 3.0"
        )
    },
    "command_envelope": {
        "\n_SECONDS = 20.0\n_RUNS = 24 ": "\n_SECONDS = 4.0\n_RUNS = 1 ",
        "\n_SCHEDULES = 10 ": "\n_SCHEDULES = 1 ",
        "\n_HARD_RUNS = 4 ": "\n_HARD_RUNS = 1 ",
    },
    "recovery_walks": {
        "\n_SECONDS, _SEGMENTS = 20.0, 5": "\n_SECONDS, _SEGMENTS = 8.0, 2"
    },
    "trial": {"\n    seconds: float = 30.0\n": "\n    seconds: float = 6.0\n"},
}
# Python runs it at its start, if it is on the path.
FINDER = """
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import spec_from_loader
from pathlib import Path

class Finder:
    def find_spec(self, name, path=None, target=None):
        file = Path(__file__).parent / name
        if file.is_file():
            return spec_from_loader(name, SourceFileLoader(name, str(file)))

sys.meta_path.insert(0, Finder())
"""


def block(title, kind):
    (text,) = re.findall(rf"^```{kind}\n(.*?)^```", RECIPES[title], re.M | re.S)
    return text


def copied(folder):
    shutil.copytree(
        ROOT / "src", folder / "src", ignore=shutil.ignore_patterns("__pycache__")
    )
    return folder


def change(folder, title, *options):
    # A folder inside of a repository would be taken for a part of that.
    alone = {**os.environ, "GIT_CEILING_DIRECTORIES": str(folder.parent)}
    done = subprocess.run(
        ["git", "apply", *options, "-"],
        input=block(title, "diff"),
        cwd=folder,
        env=alone,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def follow(title, folder, *paths, **environment):
    """Run a recipe's code in a folder, on a package."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", block(title, "python")],
        cwd=folder,
        env={**os.environ, **environment, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def laid_over(folder, copy):
    """Make a folder whose modules replace the package's own, which keeps the rest.

    So machine code that was made for the package is used: compiling takes a minute.
    """
    for title in set(CHANGING) - {RULE}:
        for name in re.findall(r"^\+\+\+ b/src/(\S+)", block(title, "diff"), re.M):
            target = folder / name.replace("/", ".").removesuffix(".py")
            shutil.copy(copy / "src" / name, target)
    return with_few_walks(folder)


def with_few_walks(folder):
    """Let builds learn what is usual of a step, and hold their ends, by few walks."""
    for module, changes in FEWER.items():
        name = f"gaitchain.build.{module}"
        text = (ROOT / "src" / f"{name.replace('.', '/')}.py").read_text("utf-8")
        for usual, fewer in changes.items():
            assert text.count(usual) == 1
            text = text.replace(usual, fewer)
        (folder / name).write_text(text, "utf-8")
    (folder / "sitecustomize.py").write_text(FINDER, "utf-8")
    return folder


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """A copy of the package with all changes."""
    copy = copied(tmp_path_factory.mktemp("changed"))
    for title in CHANGING:
        change(copy, title)
    return copy


def test_the_recipes_are_those_that_contributing_names():
    assert list(RECIPES) == ["A robot", "A backend", *CHANGING]


@pytest.mark.parametrize("title", CHANGING)
def test_each_change_applies_alone(title, tmp_path):
    change(copied(tmp_path), title, "--check")


def test_the_help_of_a_changed_package_knows_the_changes(changed):
    for verb, word in ("build", "stepping"), ("walk", "--rubber"):
        done = subprocess.run(
            [sys.executable, "-m", "gaitchain", verb, "--help"],
            env={**os.environ, "PYTHONPATH": str(changed / "src")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert word in done.stdout, done.stderr


@pytest.mark.slow
def test_a_robot_of_boxes_walks(tmp_path):
    text = block("A robot", "toml")
    name = text.splitlines()[0].removeprefix("# ")
    (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "over").mkdir()
    over = with_few_walks(tmp_path / "over")
    follow("A robot", tmp_path, str(over), str(ROOT / "src"))


def test_a_backend_walks(tmp_path):
    code = block("A backend", "python")
    methods = [name for name in vars(Backend) if not name.startswith("_")]
    assert len(methods) == 8
    assert all(f"def {name}(" in code for name in methods)
    follow("A backend", tmp_path)


def test_a_changed_rule_does_what_it_should(changed, tmp_path):
    follow(RULE, tmp_path, str(changed / "src"), GAITCHAIN_PLAIN="1")


@pytest.mark.slow
@pytest.mark.parametrize("title", ["A stride preset", "A disturbance"])
def test_a_changed_package_does_what_it_should(title, changed, tmp_path):
    (tmp_path / "over").mkdir()
    over = laid_over(tmp_path / "over", changed)
    follow(title, tmp_path, str(over), str(ROOT / "src"))
