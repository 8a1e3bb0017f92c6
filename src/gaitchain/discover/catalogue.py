"""The robots that are known by name, and the files that names and paths stand for."""

import difflib
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from gaitchain.errors import RobotFileError
from gaitchain.robot.reduced_biped import builtin_robots

_SUFFIXES = (".xml", ".mjcf", ".urdf")
_CHECKOUT = "set MENAGERIE_ROOT to a checkout that has it"
HOW_TO_GET = (
    "pip install 'gaitchain[robots]', which downloads a robot when it is first used, "
    f"or {_CHECKOUT}"
)
# Humanoids of the MuJoCo Menagerie, for computers that do not have its package.
_HUMANOIDS = {
    "apptronik_apollo": "Apache-2.0",
    "berkeley_humanoid": "BSD-3-Clause",
    "booster_t1": "Apache-2.0",
    "fourier_n1": "Apache-2.0",
    "pal_talos": "Apache-2.0",
    "pndbotics_adam_lite": "MIT",
    "robotis_op3": "Apache-2.0",
    "toddlerbot_2xc": "MIT",
    "toddlerbot_2xm": "MIT",
    "unitree_g1": "BSD-3-Clause",
    "unitree_h1": "BSD-3-Clause",
}
_LICENCES = {
    "Apache License": "Apache-2.0",
    "Permission is hereby granted, free of charge": "MIT",
    "Neither the name": "BSD-3-Clause",
    "Redistribution and use in source": "BSD-2-Clause",
}


@dataclass(frozen=True)
class KnownRobot:
    """A robot that can be asked for by its name."""

    name: str
    source: str
    """"built-in" or "menagerie"."""
    licence: str
    available: bool
    note: str
    """Where it is, or how to get it."""


def list_robots() -> tuple[KnownRobot, ...]:
    """Return the built-in robots and the humanoids of the MuJoCo Menagerie."""
    known = [
        KnownRobot(name, "built-in", "Apache-2.0", True, "reduced biped")
        for name in builtin_robots()
    ]
    package = _package()
    if package is None:
        licences = dict(_HUMANOIDS)
        if root := _root():
            # A whole checkout has arms and quadrupeds too, and does not say which.
            here = [name for name in _HUMANOIDS if (root / name).is_dir()]
            licences |= {name: _licence(root / name) for name in here}
    else:
        licences = {r.name: r.license for r in package.robots("humanoid")}
    for name, licence in sorted(licences.items()):
        available, note = _whereabouts(name, package)
        known.append(KnownRobot(name, "menagerie", licence, available, note))
    return tuple(known)


def find_robot_file(robot: str | Path) -> tuple[Path, str]:
    """Find the file of a robot.

    Args:
        robot: path of an MJCF or URDF file, or a name of the MuJoCo Menagerie.

    Returns:
        The file, and what messages call the robot.

    Raises:
        RobotFileError: there is no such file and no such name.
    """
    name = str(robot)
    path = Path(robot)
    try:
        if path.is_dir() and not _is_known(name):
            raise RobotFileError(f"{name}: a folder; give one of its files{_in(path)}")
        if path.exists() and not path.is_dir():
            return path, name
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        raise RobotFileError(f"{name[:80]!r}: {reason}") from None
    if path.suffix.lower() in _SUFFIXES or len(path.parts) != 1:
        if path.is_symlink():
            raise RobotFileError(
                f"{name}: a link to {path.readlink()}, which is not there; give a "
                "robot's MJCF or URDF file"
            )
        hint = did_you_mean(name, files_beside(path, _SUFFIXES))
        raise RobotFileError(
            f"{name}: no such file{hint}; give a robot's MJCF or URDF file, or a name "
            "that `gaitchain robots` lists"
        )
    return _named(name), name


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint with the known name nearest to a word in any capitals, or "".

    Of paths the stems are compared: files of one folder have the rest in common.
    """
    names = {Path(name).stem.lower(): name for name in known}
    near = difflib.get_close_matches(Path(word).stem.lower(), names, n=1)
    return f" (did you mean {names[near[0]]}?)" if near else ""


def files_beside(path: Path, suffixes: Sequence[str]) -> list[str]:
    """Return the files of some kinds in a path's folder, as they would be typed."""
    try:
        found = sorted(path.parent.iterdir())
    except (OSError, ValueError):  # no such folder, or not a path
        return []
    return [str(f) for f in found if f.suffix.lower() in suffixes]


def _is_known(name: str) -> bool:
    package = _package()
    if package is not None:
        return name in package.names()
    root = _root()
    return root is not None and "/" not in name and (root / name).is_dir()


def _named(name: str) -> Path:
    package, root = _package(), _root()
    if package is not None and name in package.names():
        robot = package.get(name)
        try:
            return Path(robot.path()) / str(robot.entry(robot.default_model).file)
        except (package.MenagerieError, OSError, RuntimeError) as error:
            raise RobotFileError(f"{name}: {error}; or {_CHECKOUT}") from None
    if root is not None and (root / name).is_dir():
        return _choose(root / name)
    if name in _HUMANOIDS:
        where = f"not in MENAGERIE_ROOT={root}" if root else "not on this computer"
        raise RobotFileError(f"{name}: {where}; {HOW_TO_GET}")
    known = [robot.name for robot in list_robots() if robot.source != "built-in"]
    if name in builtin_robots():
        raise RobotFileError(
            f"{name}: a built-in reduced biped, which has no MJCF or URDF file; those "
            f"that have one are {', '.join(known)}"
        )
    hint = did_you_mean(name, [*builtin_robots(), *known])
    raise RobotFileError(
        f"{name}: no such file and no robot of that name{hint}; give an MJCF or URDF "
        f"file, or one of {', '.join(known)}"
    )


def _choose(folder: Path) -> Path:
    """Choose the file of a menagerie folder that its package would choose."""
    files = sorted(folder.glob("*.xml"))
    scene = folder / "scene.xml"
    robots = [f for f in files if not f.stem.startswith("scene")]
    if scene in files:
        text = scene.read_bytes().decode("utf-8", "replace")
        included = [f for f in robots if f'"{f.name}"' in text]
        robots = included or robots
    # Position servos walk better than motors, and are the package's choice too.
    servos = [f for f in robots if f.stem.endswith("_position")]
    for choice in (robots, servos):
        if len(choice) == 1:
            return choice[0]
    raise RobotFileError(f"{folder.name}: give the path of its robot{_in(folder)}")


def _in(folder: Path) -> str:
    try:
        names = [f.name for f in sorted(folder.iterdir()) if f.suffix in _SUFFIXES]
    except OSError as error:
        return f" ({error.strerror})"
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return f": {', '.join(names[:8])}{more}" if names else ", but none is MJCF or URDF"


def _package() -> Any:
    """Return the package `mujoco_menagerie`, or None if it is not installed."""
    try:
        return import_module("mujoco_menagerie")
    except ImportError:
        return None


def _root() -> Path | None:
    root = os.environ.get("MENAGERIE_ROOT")
    return Path(root) if root else None


def _licence(folder: Path) -> str:
    try:
        text = (folder / "LICENSE").read_bytes()[:20_000].decode("utf-8", "replace")
    except OSError:
        return "unsaid"
    for words, licence in _LICENCES.items():
        if words in " ".join(text.split()):
            return licence
    return " ".join(text.split()[:6]) or "unsaid"


def _whereabouts(name: str, package: Any) -> tuple[bool, str]:
    root = _root()
    if root is not None:
        here = (root / name).is_dir()
        return here, "in MENAGERIE_ROOT" if here else "not in MENAGERIE_ROOT"
    if package is None:
        return False, "needs 'gaitchain[robots]'"
    try:
        cached = package.Cache().is_cached(package.get(name))
    except (OSError, RuntimeError):  # of a user without a home that he may see
        cached = False
    return True, "downloaded" if cached else "downloaded when first used"
