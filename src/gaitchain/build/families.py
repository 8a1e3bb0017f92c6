"""The build part of each family of gaits."""

from gaitchain.build.gait_build import GaitBuild
from gaitchain.build.keypose import KEY_POSE_BUILD
from gaitchain.build.stride import STRIDE_BUILD
from gaitchain.gait.families import family_of
from gaitchain.gait.family import GaitFamily, GaitPoses
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.stride.family import STRIDES

_BUILDS: dict[GaitFamily, GaitBuild] = {
    KEY_POSES: KEY_POSE_BUILD,
    STRIDES: STRIDE_BUILD,
}


def build_of(poses: GaitPoses) -> GaitBuild:
    """Return the build part of the family of these candidates."""
    return build_of_family(family_of(poses))


def build_of_family(family: GaitFamily) -> GaitBuild:
    """Return the build part of a family."""
    return _BUILDS[family]
