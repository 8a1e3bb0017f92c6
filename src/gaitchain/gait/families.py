"""The families of gaits, by their candidates and by their presets."""

from gaitchain.errors import CommandError
from gaitchain.gait.family import GaitFamily, GaitPoses
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.stride.family import STRIDES
from gaitchain.gait.stride.strides import StridePoses

_BY_POSES: dict[type, GaitFamily] = {KeyPoses: KEY_POSES, StridePoses: STRIDES}
_BY_PRESET = {
    preset: family for family in _BY_POSES.values() for preset in family.presets
}
PRESETS = tuple(_BY_PRESET)
"""Names of all presets."""


def family_of(poses: GaitPoses) -> GaitFamily:
    """Return the family that candidates belong to."""
    return family_of_kind(type(poses))


def family_of_kind(kind: type[GaitPoses]) -> GaitFamily:
    """Return the family that candidates of a class belong to."""
    return _BY_POSES[kind]


def family_named(name: str) -> GaitFamily:
    """Return the family with the name that is stored in files.

    Raises:
        ValueError: there is no such family.
    """
    named = {family.name: family for family in _BY_POSES.values()}
    if name not in named:
        raise ValueError(f"gait {name!r}: known are {', '.join(named)}")
    return named[name]


def family_of_preset(preset: str) -> GaitFamily:
    """Return the family whose candidates a preset draws.

    Raises:
        CommandError: there is no such preset.
    """
    if preset not in _BY_PRESET:
        raise CommandError(f"preset {preset!r}: known presets are {', '.join(PRESETS)}")
    return _BY_PRESET[preset]
