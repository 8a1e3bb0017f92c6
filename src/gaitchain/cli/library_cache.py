"""Libraries that a verb has built for itself, to be used by the next run of it."""

import hashlib
from pathlib import Path

from gaitchain.build.journal import code_digest
from gaitchain.cli.build import build_and_save
from gaitchain.cli.console import say
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import CommandError, LibraryError, file_errors
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import replace_file


def cached_library(
    config: BuildConfig, path: Path, workers: int | None = None
) -> tuple[GaitLibrary, float]:
    """Load the library of an earlier run with this config and code, or build it.

    A file beside the library identifies the code, as two checkouts of one version may
    build different libraries, and what it built.

    Returns:
        The library and the duration of the build [s], 0 for a loaded library.

    Raises:
        LibraryError: there is a library that does not fit, and another command made it
            or has changed it.
    """
    robot = load_robot(config.robot, config.profile)
    if path.is_file():
        library = _earlier(config, path, robot)
        if library is not None:
            say(f"{path}: built earlier from this config")
            return library, 0.0
    library, _, elapsed_s = build_and_save(config, path, workers, robot)
    note = _made_by(path)
    with file_errors(note, "written", CommandError):
        replace_file(note, f"{code_digest()} {_digest(path)}\n".encode())
    return library, elapsed_s


def _earlier(config: BuildConfig, path: Path, robot: Robot) -> GaitLibrary | None:
    """Return the library of a file if it fits; None if it is to be built again."""
    code, built = [*_noted(path), "", ""][:2]
    try:
        library = load_library(path, robot)
    except LibraryError as error:
        why = str(error)
    else:
        same = library.robot.in_file.fingerprint == robot.in_file.fingerprint
        fits = same and library.config == config
        if fits and code == code_digest():
            return library
        other = "was built by other code" if fits else "is of another config or robot"
        why = f"{path} {other}"
    if built != _digest(path):
        raise LibraryError(
            f"{why}; it is not as it was built here, so it stays: name it as the "
            "library, choose another folder with --out, or remove it"
        )
    say(f"building again: {why}")
    return None


def _noted(path: Path) -> list[str]:
    """Return the hashes beside a library; none where nothing says who built it."""
    try:
        return _made_by(path).read_text("utf-8", errors="replace").split()
    except OSError:
        return []


def _made_by(path: Path) -> Path:
    """Name the file with the hashes of the code and of the library that it built."""
    return path.with_name(f"{path.name}.made-by")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
