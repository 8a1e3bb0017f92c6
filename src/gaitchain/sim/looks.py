"""Clothe a robot that is drawn: the shapes of its file, or of a robot of boxes. Ours.

A simulated robot is drawn as what it is, a skeleton on box soles. The shapes of this
module are for the eye: they have no mass and touch nothing, and what they replace stays
in the model, unseen.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.reduced_biped import ReducedBiped
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import FOOT, SIDES

_UNSEEN = 3  # the first group of geoms that MuJoCo's own viewer does not show
_SHELL, _JOINT = (0.93, 0.94, 0.95, 1.0), (0.2, 0.23, 0.28, 1.0)
_ACCENT, _SOLE = (0.16, 0.42, 0.75, 1.0), (0.13, 0.14, 0.16, 1.0)
_CAPSULE, _BALL = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ELLIPSOID
_BOX, _MESH = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)
_ACROSS = (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # quaternion: a capsule along y


class Triangles(NamedTuple):
    """A surface."""

    vertices: Array
    """(V, 3) [m]."""
    faces: Array
    """(F, 3) indices of vertices."""


class Look(NamedTuple):
    """A visible shape of a body."""

    body: str
    """Of the simulated robot, see `sim.bodies`."""
    kind: int
    """Of `mujoco.mjtGeom`."""
    size: Sequence[float]
    """(3,) as MuJoCo has it for that kind [m]; of a mesh, not used."""
    position: Sequence[float]
    """(3,) in the body's frame [m]."""
    turn: Sequence[float]
    """(4,) quaternion."""
    colour: Sequence[float]
    """(4,) red, green, blue and opacity, 0 to 1."""
    surface: Triangles | None = None
    """Of a mesh."""


def add_shapes(spec: Any, robot: Robot, looks: Sequence[Look]) -> None:
    """Show shapes in place of all geoms of a robot.

    Args:
        spec: the scene with the robot.
        robot: the robot.
        looks: what to show; nothing shows a robot of boxes in shapes of ours, and any
            other one as it is.
    """
    if robot.boxes:
        looks = looks or box_looks(robot.reduced)
    if not looks:
        return
    for geom in spec.geoms:
        if geom.parent.name != "world":
            geom.group = _UNSEEN
    for i, look in enumerate(looks):
        _show(spec, f"{look.body}_look_{i}", look)


def _show(spec: Any, name: str, look: Look) -> None:
    mesh = {}
    if look.surface is not None:
        spec.add_mesh(
            name=name,
            uservert=np.ravel(look.surface.vertices),
            userface=np.ravel(look.surface.faces),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,  # it may have holes
        )
        mesh = {"meshname": name}
    spec.body(look.body).add_geom(
        name=name,
        type=look.kind,
        size=look.size,
        pos=look.position,
        quat=look.turn,
        rgba=look.colour,
        mass=0.0,
        contype=0,
        conaffinity=0,
        **mesh,
    )


def box_looks(biped: ReducedBiped) -> list[Look]:
    """Return the shapes in which a robot of boxes is drawn.

    Args:
        biped: its lengths.
    """
    return [*_upper_body(biped), *(x for side in SIDES for x in _leg(biped, side))]


def _upper_body(biped: ReducedBiped) -> list[Look]:
    """Hips, chest, head with its visor, and arms that hang."""
    long, wide, deep = biped.trunk_length, biped.trunk_width, biped.trunk_depth
    shoulder, arm = 0.8 * long, 0.13 * deep
    looks = [
        _ball([0.42 * deep, 0.5 * wide, 0.15 * long], [0, 0, 0.1 * long], _JOINT),
        _ball([0.5 * deep, 0.5 * wide, 0.33 * long], [0, 0, 0.57 * long], _SHELL),
        _ball([0.2 * deep, 0.24 * wide, 0.1 * long], [0.35 * deep, 0, 0.66 * long]),
        _ball([0.4 * deep, 0.32 * wide, 0.16 * long], [0, 0, 1.04 * long], _SHELL),
        _ball([0.2 * deep, 0.25 * wide, 0.05 * long], [0.26 * deep, 0, 1.06 * long]),
    ]
    for y in (0.5 * wide + arm, -0.5 * wide - arm):
        elbow = [0.02 * deep, 1.12 * y, shoulder - 0.34 * long]
        hand = [0.35 * deep, 1.12 * y, shoulder - 0.62 * long]
        looks += [
            _ball([1.6 * arm] * 3, [0, y, shoulder], _ACCENT),
            _bar([0, y, shoulder], elbow, arm, _SHELL),
            _ball([1.2 * arm] * 3, elbow, _JOINT),
            _bar(elbow, hand, 0.85 * arm, _SHELL),
            _ball([1.25 * arm] * 3, hand, _JOINT),
        ]
    return looks


def _leg(biped: ReducedBiped, side: str) -> list[Look]:
    """Thigh, knee, shank, and a shoe on its sole."""
    thick, femur, crus = biped.leg_thickness, biped.femur_length, biped.crus_length
    long, wide, high = biped.sole_length, biped.sole_width, biped.ankle_height
    thigh, shank, foot = (f"{side}_{part}" for part in ("femur", "crus", FOOT))
    out = biped.sole_offset
    return [
        _ball([0.55 * thick] * 3, [0, 0, 0], _ACCENT, thigh),
        _bar([0, 0, -0.2 * femur], [0, 0, -0.8 * femur], 0.48 * thick, _SHELL, thigh),
        Look(shank, _CAPSULE, [0.4 * thick, 0.2 * thick, 0], [0] * 3, _ACROSS, _JOINT),
        _bar([0, 0, -0.25 * crus], [0, 0, -0.8 * crus], 0.4 * thick, _SHELL, shank),
        _ball([0.38 * thick] * 3, [0, 0, 0], _JOINT, foot),
        _ball(
            [0.47 * long, 0.46 * wide, 0.5 * high], [out, 0, -0.6 * high], _ACCENT, foot
        ),
        Look(
            foot,
            _BOX,
            [0.5 * long, 0.5 * wide, 0.12 * high],
            [out, 0, -0.88 * high],
            _UPRIGHT,
            _SOLE,
        ),
    ]


def _ball(
    half: Sequence[float],
    position: Sequence[float],
    colour: Sequence[float] = _ACCENT,
    body: str = "trunk",
) -> Look:
    return Look(body, _BALL, half, position, _UPRIGHT, colour)


def _bar(
    start: Sequence[float],
    end: Sequence[float],
    radius: float,
    colour: Sequence[float],
    body: str = "trunk",
) -> Look:
    """Return a capsule between two points."""
    way, turn = np.subtract(end, start), np.empty(4)
    mujoco.mju_quatZ2Vec(turn, way)
    size = [radius, 0.5 * float(np.linalg.norm(way)), 0.0]
    middle = 0.5 * np.add(start, end)
    return Look(body, _CAPSULE, size, middle.tolist(), turn.tolist(), colour)
