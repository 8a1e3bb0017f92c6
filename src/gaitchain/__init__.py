"""Online humanoid walking from a Markov chain of key poses, checked by physics."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gaitchain.errors import needed_by

if TYPE_CHECKING:
    from gaitchain.backends.mock import MockBackend
    from gaitchain.backends.model import ModelBackend
    from gaitchain.backends.mujoco import MujocoBackend
    from gaitchain.build.pipeline import build_library
    from gaitchain.discover.loaded_robot import load_robot
    from gaitchain.errors import GaitchainError
    from gaitchain.gait.build_config import BuildConfig
    from gaitchain.gait.library import GaitLibrary
    from gaitchain.gait.library_file import load_library, save_library
    from gaitchain.messages import Command, Sensors
    from gaitchain.robot.robot import Robot
    from gaitchain.walker.walker import Walker

__all__ = [
    "BuildConfig",
    "Command",
    "GaitLibrary",
    "GaitchainError",
    "MockBackend",
    "ModelBackend",
    "MujocoBackend",
    "Robot",
    "Sensors",
    "Walker",
    "build_library",
    "load_library",
    "load_robot",
    "save_library",
]

_MODULES = {
    "BuildConfig": "gait.build_config",
    "Command": "messages",
    "GaitLibrary": "gait.library",
    "GaitchainError": "errors",
    "MockBackend": "backends.mock",
    "ModelBackend": "backends.model",
    "MujocoBackend": "backends.mujoco",
    "Robot": "robot.robot",
    "Sensors": "messages",
    "Walker": "walker.walker",
    "build_library": "build.pipeline",
    "load_library": "gait.library_file",
    "load_robot": "discover.loaded_robot",
    "save_library": "gait.library_file",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first use: MuJoCo takes long to load."""
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 - slow

        return version("gaitchain")
    if name not in _MODULES:
        raise AttributeError(f"module 'gaitchain' has no attribute {name!r}")
    with needed_by(f"gaitchain.{name}"):
        return getattr(import_module(f"gaitchain.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """List the public names, also those that are not loaded yet."""
    return [*__all__, "__version__"]
