"""What the core install alone must do; run by its own Python, without any extra."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib.metadata import requires
from importlib.resources import files
from importlib.util import find_spec

import numpy as np

import gaitchain
from gaitchain.cli import run
from gaitchain.errors import EXTRAS, MissingExtraError

MOST_DEPENDENCIES = 6
VERBS = {
    "serve": "serve,sim",
    "walk": "sim,view",
    "build res -o res.gait": "sim",
    "inspect res": "sim",
    "explain runs/walk": "sim,view,serve",
}


def check_dependencies() -> None:
    """Count what the package asks for, and see that no extra came with it."""
    core = [r for r in requires("gaitchain") or () if "extra ==" not in r]
    assert len(core) <= MOST_DEPENDENCIES, core
    there = [m for modules in EXTRAS.values() for m in modules if find_spec(m)]
    assert not there, f"not the core alone: {there}"


def check_messages() -> None:
    """See that what is missing is named with the command that installs it."""
    for words, extras in VERBS.items():
        said = _error_of(words.split())
        assert said.endswith(f"pip install 'gaitchain[{extras}]'\n"), said
        assert said.count("\n") == 1, said
    for name in ("MujocoBackend", "build_library"):
        try:
            getattr(gaitchain, name)
        except MissingExtraError as error:
            assert str(error).startswith(f"gaitchain.{name} needs the extra 'sim'")
        else:
            raise AssertionError(name)


def check_inspect() -> None:
    """See that a library can be looked at."""
    shown = io.StringIO()
    with redirect_stdout(shown):
        assert run(["inspect", "res.gait"]) == 0
    assert "Reach of commands" in shown.getvalue(), shown.getvalue()


def check_walk() -> None:
    """Walk the library that comes with the package, on the mock, which has no IMU."""
    path = files("gaitchain") / "data" / "res.gait"
    walker = gaitchain.Walker.load(path, feedback=False)
    robot = gaitchain.MockBackend(0.01)
    robot.connect(walker.stand)
    walker.command(gaitchain.Command(vx=0.3))
    moved = np.zeros(len(walker.stand))
    for _ in range(500):
        targets = walker.step(robot.read())
        assert not targets.status, targets.status
        robot.write(targets.position)
        moved = np.maximum(moved, np.abs(targets.position - walker.stand))
    assert walker.gait.steps > 5, walker.gait.steps
    assert moved.max() > 0.2, moved


def _error_of(words: list[str]) -> str:
    said = io.StringIO()
    with redirect_stderr(said):
        code = run(words)
    assert code == 2, (words, code)
    return said.getvalue()


if __name__ == "__main__":
    check_dependencies()
    check_messages()
    check_inspect()
    check_walk()
    print(f"gaitchain {gaitchain.__version__} on Python {sys.version.split()[0]}")
