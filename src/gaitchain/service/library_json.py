"""A gait library as the HTTP API tells it: what does not change while it serves."""

import msgspec
import numpy as np

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import sole_corners
from gaitchain.robot.box_robot import anatomy_of


class JointInfo(msgspec.Struct, frozen=True):
    """A leg joint and its limits."""

    name: str
    lower: float
    """[rad]"""
    upper: float
    """[rad]"""
    speed: float | None
    """[rad/s], null for none."""
    torque: float | None
    """[N m]"""


class PoseInfo(msgspec.Struct, frozen=True):
    """A key pose."""

    index: int
    primitives: dict[str, float]
    """Components of Swing, Lift and Move [m, rad]."""


class LayerInfo(msgspec.Struct, frozen=True):
    """The key poses of a key moment."""

    key_moment: str
    poses: tuple[PoseInfo, ...]


class EdgeInfo(msgspec.Struct, frozen=True, rename={"from_": "from"}):
    """A way from a key pose to one of the next key moment that may be taken."""

    layer: int
    """Of the pose that it leaves, 0 for kp_1."""
    from_: int
    to: int
    cost: float
    """Expected cost of a gait through it."""


class TimingInfo(msgspec.Struct, frozen=True):
    """Planned times."""

    step: float
    """[s]"""


class RangeInfo(msgspec.Struct, frozen=True):
    """Least and most of each number alone; together they share the range."""

    vx: tuple[float, float]
    """[m/s]"""
    vy: tuple[float, float]
    """[m/s]"""
    yaw_rate: tuple[float, float]
    """[rad/s]"""


class LibraryInfo(msgspec.Struct, frozen=True):
    """Robot, limits and Markov chain of a gait library."""

    name: str
    """Of the robot."""
    fingerprint: str
    """Of the robot."""
    qualified: bool
    mass_kg: float
    joints: tuple[JointInfo, ...]
    command_range: RangeInfo
    layers: tuple[LayerInfo, ...]
    edges: tuple[EdgeInfo, ...]
    timing: TimingInfo
    sole: tuple[tuple[float, float], ...]
    """Corners, from under the ankle: ahead, to the left [m]."""


def library_info(library: GaitLibrary) -> LibraryInfo:
    """Return what the HTTP API tells of a library."""
    biped, full = library.biped, anatomy_of(library.biped)
    columns = zip(
        full.joint_names,
        full.lower.tolist(),
        full.upper.tolist(),
        full.speed_limit.tolist(),
        full.torque_limit.tolist(),
        strict=True,
    )
    return LibraryInfo(
        name=biped.name,
        fingerprint=biped.fingerprint,
        qualified=library.qualified,
        mass_kg=full.mass,
        joints=tuple(JointInfo(*column) for column in columns),
        command_range=RangeInfo(*library.command_range.ends),
        layers=_layers(library),
        edges=_edges(library),
        timing=TimingInfo(library.timing.step),
        sole=tuple(map(tuple, sole_corners(biped, np.zeros(2), 0.0).tolist())),
    )


def _layers(library: GaitLibrary) -> tuple[LayerInfo, ...]:
    poses, names = library.poses, library.family.columns()
    return tuple(
        LayerInfo(
            f"kp_{layer + 1}",
            tuple(
                PoseInfo(i, dict(zip(names[layer], row, strict=True)))
                for i, row in enumerate(parameters.tolist())
            ),
        )
        for layer, parameters in enumerate(poses.parameters)
    )


def _edges(library: GaitLibrary) -> tuple[EdgeInfo, ...]:
    return tuple(
        EdgeInfo(layer, int(one), int(other), float(costs[one, other]))
        for layer, costs in enumerate(library.edge_costs)
        for one, other in np.argwhere(np.isfinite(costs))
    )
