"""Make a robot fit to compile: its masses, inertias, meshes and textures."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from gaitchain.discover.mass import (
    BALLAST_INERTIA,
    BALLAST_KG,
    mend_masses,
    weighs,
)
from gaitchain.discover.mend import drop_keys, listed
from gaitchain.errors import RobotFileError

_MAX_MESH_BYTES = 200_000_000
_MAX_CURES = 100
_OF_MESH = re.compile(r"mesh|stl|obj file|msh|vert|face|decoder|opening|volume", re.I)


def make_fit(spec: Any, strict: bool) -> list[str]:
    """Make a robot compile, or say what in it no simulation can have.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.
        strict: whether to refuse a robot that a missing mesh leaves without contacts.

    Returns:
        A note for everything that was mended or left out.

    Raises:
        RobotFileError: something in it cannot be mended.
    """
    notes = mend_masses(spec)
    notes += _drop_meshes(spec, _meshes(spec, _is_unfit), strict)
    notes += _drop_textures(spec, _is_unfit)
    model, cures = _compile(spec, strict)
    _check_finite(model)
    if not (model.geom_contype | model.geom_conaffinity).any():
        cures.append("Nothing of it is left that can touch the ground.")
    return notes + cures


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
        if not body.explicitinertial and any(map(weighs, gone)):
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
        spec.compiler.boundinertia = BALLAST_INERTIA
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


def _check_finite(model: Any) -> None:
    for what, ids, arrays in (
        ("body", model.nbody, ("body_pos", "body_quat", "body_mass", "body_inertia")),
        ("joint", model.njnt, ("jnt_pos", "jnt_axis", "jnt_range")),
        ("geom", model.ngeom, ("geom_pos", "geom_quat", "geom_size")),
    ):
        for array in arrays:
            values = getattr(model, array).reshape(ids, -1 if ids else 1)
            for i in np.flatnonzero(~np.isfinite(values).all(axis=1)):
                name = getattr(model, what)(int(i)).name
                raise RobotFileError(
                    f"{what} {name!r}: {array} = {values[i]}; give finite numbers"
                )
