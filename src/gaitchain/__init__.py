"""Online humanoid walking from a Markov chain of key poses, checked by physics."""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gaitchain.backends.mock import MockBackend
    from gaitchain.backends.mujoco import MujocoBackend
    from gaitchain.biped import Biped, load_biped
    from gaitchain.build import build_library
    from gaitchain.build_config import BuildConfig
    from gaitchain.errors import GaitchainError
    from gaitchain.library import GaitLibrary
    from gaitchain.library_file import load_library, save_library
    from gaitchain.messages import Command, Sensors
    from gaitchain.walker import Walker

__all__ = [
    "Biped",
    "BuildConfig",
    "Command",
    "GaitLibrary",
    "GaitchainError",
    "MockBackend",
    "MujocoBackend",
    "Sensors",
    "Walker",
    "build_library",
    "load_biped",
    "load_library",
    "save_library",
]

_ROOMS = {
    "Biped": "biped",
    "BuildConfig": "build_config",
    "Command": "messages",
    "GaitLibrary": "library",
    "GaitchainError": "errors",
    "MockBackend": "backends.mock",
    "MujocoBackend": "backends.mujoco",
    "Sensors": "messages",
    "Walker": "walker",
    "build_library": "build",
    "load_biped": "biped",
    "load_library": "library_file",
    "save_library": "library_file",
}


def __getattr__(name: str) -> Any:
    """Bring a public name from its room on first use: MuJoCo takes its time."""
    if name == "__version__":
        return version("gaitchain")
    if name not in _ROOMS:
        raise AttributeError(f"module 'gaitchain' has no attribute {name!r}")
    return getattr(import_module(f"gaitchain.{_ROOMS[name]}"), name)
