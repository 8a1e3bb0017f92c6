"""Find the library, and the robot, that arguments of the command line name."""

from importlib.resources import files
from pathlib import Path

from gaitchain.cli.console import say
from gaitchain.discover.catalogue import did_you_mean, files_beside
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.robot.robot import Robot

_SUFFIX = ".gait"
_DATA = Path(str(files("gaitchain"))) / "data"


def shipped_library(name: str = "res") -> Path:
    """Return the path of a library in the package."""
    return _DATA / f"{name}{_SUFFIX}"


def is_shipped(word: str) -> bool:
    """Return whether a word is the name of a library in the package."""
    return word.removesuffix(_SUFFIX) in {path.stem for path in _DATA.glob("*.gait")}


def find_library(word: str) -> Path:
    """Return the path of a library, given as a path or a name in the package.

    Raises:
        LibraryError: there is neither.
    """
    path = Path(word)
    if path.is_file() or not is_shipped(word):
        if path.exists() and not path.is_dir():
            return path
        shipped = sorted(path.stem for path in _DATA.glob("*.gait"))
        hint = did_you_mean(word, [*shipped, *files_beside(path, (_SUFFIX,))])
        found = "a folder" if path.is_dir() else f"no such file{hint}"
        raise LibraryError(
            f"{word}: {found}; give a library that `gaitchain build` wrote, "
            f"or one that comes with gaitchain: {', '.join(shipped)}"
        )
    if path.suffix == _SUFFIX:
        say(f"{word}: no such file here; taking the one that comes with gaitchain")
    return shipped_library(word.removesuffix(_SUFFIX))


def read_library(word: str, robot: Robot | None = None) -> GaitLibrary:
    """Load a library.

    Args:
        word: a path, or the name of a library in the package.
        robot: the robot that it must be for; any robot by default.

    Raises:
        LibraryError: there is no such library, or it cannot be used.
    """
    return load_library(find_library(word), robot)


def given_robot(robot: str | None, profile: Path | None) -> Robot | None:
    """Load the robot that a library or a log must be of, if one is given.

    Args:
        robot: a name or a file.
        profile: file of what the robot's file does not say.

    Raises:
        CommandError: there is a profile alone.
        RobotFileError: file or profile cannot be used.
    """
    # Late: the verbs of a robot's computer read libraries, and it has no MuJoCo.
    from gaitchain.discover.loaded_robot import load_robot  # noqa: PLC0415

    if robot is not None:
        return load_robot(robot, profile)
    if profile is not None:
        raise CommandError("--profile describes a robot: give --robot as well")
    return None
