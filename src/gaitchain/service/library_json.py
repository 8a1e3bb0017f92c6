"""Describe a gait library for the HTTP API; constant while the service runs."""

from dataclasses import asdict

import numpy as np

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.zmp import sole_corners
from gaitchain.service.schemas import (
    DisturbanceLimits,
    EdgeInfo,
    JointInfo,
    LayerInfo,
    LibraryInfo,
    PoseInfo,
    RangeInfo,
    TimingInfo,
)


def library_info(
    library: GaitLibrary, limits: DisturbanceLimits | None = None
) -> LibraryInfo:
    """Return what the HTTP API says of a library.

    Args:
        library: the library.
        limits: of what disturbs its robot; None where it is not simulated.
    """
    robot, full = library.robot, library.robot.legs
    columns = zip(
        full.joint_names,
        full.lower.tolist(),
        full.upper.tolist(),
        full.speed_limit.tolist(),
        full.torque_limit.tolist(),
        strict=True,
    )
    return LibraryInfo(
        name=robot.name,
        fingerprint=robot.fingerprint,
        qualified=library.qualified,
        mass_kg=full.mass,
        joints=tuple(JointInfo(*column) for column in columns),
        command_range=RangeInfo(**asdict(library.command_range)),
        layers=_layers(library),
        edges=_edges(library),
        timing=TimingInfo(library.timing.step),
        sole=tuple(map(tuple, sole_corners(robot, np.zeros(2), 0.0).tolist())),
        disturbances=limits,
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
