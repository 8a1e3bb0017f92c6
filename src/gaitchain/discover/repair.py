"""Repair masses, inertias, meshes and textures until a robot compiles."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.isolate import drop_keys
from gaitchain.discover.model_numbers import check_numbers
from gaitchain.discover.notes import listed
from gaitchain.errors import RobotFileError

_MAX_MESH_BYTES = 200_000_000
_MAX_CURES = 100
_OF_MESH = re.compile(r"mesh|stl|obj file|msh|vert|face|decoder|opening|volume", re.I)
_BALLAST_INERTIA = 1e-5  # of a moving body that has no mass
_WATER = 1000.0  # density that an inertia is made up from [kg/m^3]
_NOTHING = 1e-15  # an inertia below that is zero, as to MuJoCo [kg m^2]
_LIGHT = 0.2  # of the robot's mass: what may have a made-up inertia
BALLAST_KG = 1e-3
"""Mass that a moving body without any is given."""


def repair(spec: Any, strict: bool) -> tuple[Any, list[str]]:
    """Make a robot compile, or say what in it cannot be simulated.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.
        strict: whether to refuse a robot that a missing mesh leaves without contacts.

    Returns:
        The robot, compiled, and a note for everything that was repaired or left out.

    Raises:
        RobotFileError: something in it cannot be repaired.
    """
    _check_geoms(spec)
    notes = _repair_inertias(spec) + _ballast(spec)
    notes += _drop_meshes(spec, _meshes(spec, _is_unfit), strict)
    notes += _drop_textures(spec, _is_unfit)
    model, cures = _compile(spec, strict)
    check_numbers(model)
    if not (model.geom_contype | model.geom_conaffinity).any():
        cures.append(
            "Nothing of it collides, unless by contact pairs: its shapes say where it "
            "touches the ground."
        )
    return model, notes + cures


def _meshes(spec: Any, bad: Callable[[Path], bool]) -> dict[str, str]:
    """Return the names of the meshes whose files are bad, and the files."""
    found = {}
    for mesh in spec.meshes:
        try:
            if mesh.file and bad(_path(spec, mesh)):
                found[mesh.name] = mesh.file
        except (OSError, ValueError):  # names that no file can have
            found[mesh.name] = mesh.file
    return found


def _path(spec: Any, mesh: Any) -> Path:
    name = Path(mesh.file).name if spec.strippath else str(mesh.file)
    return Path(spec.modelfiledir or ".", mesh.compiler.meshdir, name)


def _is_unfit(path: Path) -> bool:
    """Return whether MuJoCo would wait for a file for ever, or run out of memory."""
    return path.exists() and (
        not path.is_file() or path.stat().st_size > _MAX_MESH_BYTES
    )


def _drop_meshes(spec: Any, lost: dict[str, str], strict: bool) -> list[str]:
    """Delete meshes and their geoms, where their bodies can do without."""
    if not lost:
        return []
    files = [Path(file).name for file in lost.values()]
    what = f"{listed('mesh file', files)} cannot be read"
    for body in spec.bodies:
        gone = [geom for geom in body.geoms if geom.meshname in lost]
        kept = [geom for geom in body.geoms if geom.meshname not in lost]
        if not body.explicitinertial and any(map(_weighs, gone)):
            raise RobotFileError(
                f"{what}, and body {body.name!r} has its mass from one; restore the "
                "files or give the body an <inertial>"
            )
        if strict and any(map(_touches, gone)) and not any(map(_touches, kept)):
            raise RobotFileError(
                f"{what}, and body {body.name!r} touches by nothing else; restore the "
                f"files below {spec.modelfiledir or 'the folder'}"
            )
        for geom in gone:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name in lost:
            spec.delete(mesh)
    return [f"{what}; left out."]


def _touches(geom: Any) -> bool:
    return bool(geom.contype or geom.conaffinity)


def _compile(spec: Any, strict: bool) -> tuple[Any, list[str]]:
    notes: list[str] = []
    for _ in range(_MAX_CURES):
        try:
            # A spec that failed to compile can be read no more, so a copy tries.
            spec.copy().compile()
        except ValueError as error:
            cure = _cure(spec, str(error), strict)
            if cure is None:
                raise
            notes += cure
        else:
            # A copy lacks what refers to nothing; the spec itself still complains.
            return spec.compile(), notes
    raise RobotFileError(f"more than {_MAX_CURES} of its meshes cannot be read")


def _cure(spec: Any, error: str, strict: bool) -> list[str] | None:
    """Take out what MuJoCo complains of; None where nothing can be done."""
    match = re.search(r"Element name '([^']*)'", error)
    name = match[1] if match else ""
    if "moving bodies" in error and not spec.compiler.boundmass:
        spec.compiler.boundmass = BALLAST_KG
        spec.compiler.boundinertia = _BALLAST_INERTIA
        return [f"No body weighs less than {BALLAST_KG:g} kg: {name!r} did."]
    if "keyframe" in error and spec.keys:
        return drop_keys(spec, lambda _: True)
    if "texture" in error or any(t.file and t.file in error for t in spec.textures):
        return _drop_textures(spec, lambda _: True) or None
    for mesh in spec.meshes if _OF_MESH.search(error) else ():
        if mesh.name == name or (not name and mesh.file and mesh.file in error):
            return _cure_mesh(spec, mesh, error, strict)
    return None


def _drop_textures(spec: Any, bad: Callable[[Path], bool]) -> list[str]:
    """Make textures plain whose files are bad."""
    gone = []
    for texture in spec.textures:
        files = [name for name in (texture.file, *texture.cubefiles) if name]
        folder = Path(spec.modelfiledir or ".", texture.compiler.texturedir)
        if any(bad(folder / name) for name in files):
            gone.append(Path(files[0]).name)
            texture.file, texture.width, texture.height = "", 2, 2
            texture.cubefiles = [""] * 6
            texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
    return [f"{listed('texture', gone)} cannot be read; left out."] if gone else []


def _cure_mesh(spec: Any, mesh: Any, error: str, strict: bool) -> list[str]:
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    if "volume" in error and mesh.inertia != shell:
        mesh.inertia = shell
        return [f"Mesh {mesh.name!r} has next to no volume; taken as a shell."]
    if "ASCII" in error and len(corners := _ascii_corners(_path(spec, mesh))) >= 12:
        mesh.file, mesh.uservert = "", corners
        mesh.userface = list(range(len(corners) // 3))
        return []
    lost = {mesh.name: mesh.file or mesh.name}
    if "opening" in error:
        lost |= _meshes(spec, lambda path: not path.exists())
    return _drop_meshes(spec, lost, strict)


def _ascii_corners(path: Path) -> list[float]:
    """Return all corners of the triangles of a text STL file, which MuJoCo refuses."""
    try:
        found = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", path.read_bytes())
        corners = [float(number) for corner in found for number in corner]
    except (OSError, ValueError):
        return []
    return corners if len(corners) % 9 == 0 and np.isfinite(corners).all() else []


def _check_geoms(spec: Any) -> None:
    for body in spec.bodies:
        for geom in body.geoms:
            for what, value in (("mass", geom.mass), ("density", geom.density)):
                unset = what == "mass" and math.isnan(value)
                if not unset and not 0.0 <= value < math.inf:
                    raise RobotFileError(
                        f"body {body.name!r}: a geom of {what} {value:g}; give 0 or up"
                    )


def _repair_inertias(spec: Any) -> list[str]:
    """Make every inertia one that a body of positive density can have."""
    bodies = [body for body in spec.bodies if body.explicitinertial]
    for body in bodies:
        if not 0.0 <= body.mass < math.inf:
            raise RobotFileError(
                f"body {body.name!r} has a mass of {body.mass:g} kg; give 0 or more"
            )
    total = sum(body.mass for body in bodies)
    repaired: dict[str, list[str]] = {}
    for body in bodies:
        if body.mass > 0.0 and (how := _repair_inertia(spec, body, total)):
            repaired.setdefault(how, []).append(body.name)
    return [
        f"Inertia of {listed('body', names)} {how}." for how, names in repaired.items()
    ]


def _repair_inertia(spec: Any, body: Any, total: float) -> str | None:
    """Repair one inertia; return what was done."""
    inertia = _inertia_of(body)
    diagonal = np.diag(inertia).copy()
    if not np.isfinite(inertia).all() or diagonal.min() < -_NOTHING:
        raise RobotFileError(
            f"body {body.name!r} has an inertia of {inertia[np.triu_indices(3)]} "
            "kg m^2 (xx, xy, xz, yy, yz, zz); give positive xx, yy and zz"
        )
    if diagonal.min() <= _NOTHING:
        if body.mass > _LIGHT * total:
            raise RobotFileError(
                f"body {body.name!r} of {body.mass:g} kg has an inertia of {diagonal} "
                f"kg m^2; only a body below {_LIGHT:g} of the robot's {total:g} kg can "
                "do without"
            )
        _set_inertia(body, [_ball_of_water(body.mass)] * 3)
        return "was zero, taken as a ball of water"
    return _repair_moments(spec, body, inertia)


def _ball_of_water(mass: float) -> float:
    """Return the inertia of a ball of water, about any axis [kg m^2]."""
    radius: float = (0.75 * mass / (math.pi * _WATER)) ** (1 / 3)
    return max(0.4 * mass * radius**2, 1e-9)


def _repair_moments(spec: Any, body: Any, inertia: Any) -> str | None:
    """Make the principal moments positive, and none larger than the others' sum."""
    how, diagonal = None, np.diag(inertia).copy()
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 1e-9 * moments[2]:
        _set_inertia(body, diagonal)
        how, moments = "was not positive, taken without its products", np.sort(diagonal)
    if moments[0] + moments[1] < moments[2] * (1.0 - 1e-6):
        spec.compiler.balanceinertia = True
        return how or "broke A + B >= C, taken as its mean about all axes"
    return how


def _inertia_of(body: Any) -> Any:
    full = np.array(body.fullinertia)
    if np.isnan(full[0]) and not full[1:].any():  # not given
        return np.diag(body.inertia[:3])
    xx, yy, zz, xy, xz, yz = full
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _set_inertia(body: Any, diagonal: Any) -> None:
    body.fullinertia = [math.nan, 0, 0, 0, 0, 0]
    body.inertia[:3] = diagonal


def _ballast(spec: Any) -> list[str]:
    """Give a little mass to moving bodies that have none."""
    moving = [b for b in spec.bodies[1:] if b.joints]
    light = [b for b in moving if not _has_mass(b)]
    if light and len(light) == len(moving):
        raise RobotFileError(
            f"{len(light)} of {len(moving)} moving links have no mass; give them "
            "<inertial>"
        )
    for body in light:
        body.explicitinertial, body.mass = True, BALLAST_KG
        body.ipos, body.iquat = (0, 0, 0), (1, 0, 0, 0)
        _set_inertia(body, [_BALLAST_INERTIA] * 3)
    names = [body.name for body in light]
    given = f"{BALLAST_KG:g} kg and {_BALLAST_INERTIA:g} kg m^2 given to"
    return [f"{given} {listed('moving body', names)} without mass."] if light else []


def _has_mass(body: Any) -> bool:
    if body.explicitinertial:
        if body.mass > 0.0:
            return True
    elif any(_weighs(geom) for geom in body.geoms):
        return True
    return any(not child.joints and _has_mass(child) for child in body.bodies)


def _weighs(geom: Any) -> bool:
    """Return whether a geom adds mass to a body that has no inertia of its own."""
    return bool(geom.density > 0.0 if math.isnan(geom.mass) else geom.mass > 0.0)
