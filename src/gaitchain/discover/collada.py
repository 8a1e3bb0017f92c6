"""Meshes of COLLADA files (.dae), which URDFs often have and MuJoCo does not read."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from gaitchain.discover.notes import listed
from gaitchain.errors import needed_by
from gaitchain.messages import Array

SUFFIX = ".dae"
_MAX_BYTES = 100_000_000
_Y_UP = re.compile(rb"<up_axis>\s*Y_UP")


class Placed(NamedTuple):
    """A mesh of a URDF."""

    link: ET.Element
    shape: ET.Element
    """Its <visual> or <collision>."""
    file: Path

    @property
    def mesh(self) -> ET.Element:
        """Its <mesh>."""
        found = self.shape.find("geometry/mesh")
        assert found is not None  # whoever placed it has seen it
        return found


class Converted(NamedTuple):
    """What became of the COLLADA files of a URDF."""

    stl: dict[str, bytes]
    """Binary STL [m] by the name that its <mesh> has now."""
    lost: list[Placed]
    """What cannot be read."""
    notes: list[str]


class _Read(NamedTuple):
    mesh: Any
    """A `trimesh.Trimesh` [m]."""
    colour: tuple[float, ...]
    """Of most of its triangles: red, green, blue, opacity, 0 to 1."""
    y_up: bool


def convert(placed: list[Placed]) -> Converted:
    """Make STL of COLLADA meshes, and put their names and colours into the URDF.

    Lengths are in a file's <unit>. RViz leaves its <up_axis> alone, and most URDFs are
    drawn for that; other programs turn what has y up. Here all of a robot's meshes are
    turned if they are nearer to the CoMs of their links then.

    Args:
        placed: the meshes; changed in place.

    Returns:
        The meshes by name.

    Raises:
        MissingExtraError: what reads such files is not installed.
    """
    read = {file: _read(file) for file in dict.fromkeys(p.file for p in placed)}
    lost = [p for p in placed if read[p.file] is None]
    known = {p: mesh for p in placed if (mesh := read[p.file]) is not None}
    y_up = {p: found for p, found in known.items() if found.y_up}
    rotation = scipy.spatial.transform.Rotation
    upright = rotation.from_euler("x", 90, degrees=True)  # y becomes z
    turned = _off(y_up, upright) < _off(y_up, rotation.identity())
    stl: dict[str, bytes] = {}
    for one, found in known.items():
        name = f"{one.file}.stl"
        if name not in stl:
            mesh = found.mesh.copy()
            if turned and found.y_up:
                mesh.vertices = upright.apply(mesh.vertices)
            stl[name] = mesh.export(file_type="stl")
        one.mesh.set("filename", name)
        _paint(one.shape, found.colour)
    names = list(dict.fromkeys(p.file.name for p in y_up))
    note = f"{listed('mesh file', names)} turned from y up to z up: nearer to the CoMs."
    return Converted(stl, lost, [note] if turned else [])


def _read(file: Path) -> _Read | None:
    """Read all meshes of a file as one; None if there is none that can be read."""
    with needed_by(f"reading {file.name}"):
        import collada  # noqa: F401, PLC0415 - trimesh reads such files with it
        import trimesh  # noqa: PLC0415 - few robots have such meshes
    if file.stat().st_size > _MAX_BYTES:
        return None
    data = file.read_bytes()
    if b"<!ENTITY" in data:  # which can blow a small file up to gigabytes
        return None
    try:
        scene = trimesh.load_scene(file)
        mesh = scene.to_mesh()
    except Exception:  # whatever its parsers stumble over
        return None
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        return None
    mesh.apply_scale(_unit_m(scene.units))
    return _Read(mesh, _colour(scene), _Y_UP.search(data) is not None)


def _unit_m(units: str | None) -> float:
    """Return the length of a scene's unit [m]."""
    from trimesh.units import unit_conversion  # noqa: PLC0415 - see `_read`

    return float(unit_conversion(units, "meters")) if units else 1.0


def _colour(scene: Any) -> tuple[float, ...]:
    """Return the colour of the part that has most triangles."""
    parts = list(scene.geometry.values())
    most = max(parts, key=lambda part: len(part.faces)).visual
    colour = getattr(most, "material", most).main_color
    return tuple((np.asarray(colour) / 255.0).round(3).tolist())


def _off(placed: dict[Placed, _Read], turn: Any) -> float:
    """Return how far turned meshes' middles are from their links' CoMs in all [m]."""
    total = 0.0
    for one, found in placed.items():
        inertial = one.link.find("inertial")
        if inertial is None:
            continue
        middle = turn.apply(found.mesh.bounds.mean(axis=0))
        scale = _numbers(one.mesh.get("scale"), 1.0)
        at, axes = _place(one.shape)
        com, _ = _place(inertial)
        total += float(np.linalg.norm(at + axes.apply(scale * middle) - com))
    return total


def _place(element: ET.Element) -> tuple[Array, Any]:
    origin = element.find("origin")
    told = {} if origin is None else origin.attrib
    turn = scipy.spatial.transform.Rotation.from_euler(
        "xyz", _numbers(told.get("rpy"), 0.0)
    )
    return _numbers(told.get("xyz"), 0.0), turn


def _numbers(text: str | None, usual: float) -> Array:
    """Return three numbers; the usual one where there are none that can be."""
    try:
        found = np.array((text or "").split(), dtype=float)
    except ValueError:
        found = np.empty(0)
    return found if found.shape == (3,) else np.full(3, usual)


def _paint(shape: ET.Element, colour: tuple[float, ...]) -> None:
    """Give a shape that is drawn the mesh's own colour, unless the URDF has one.

    Beside a texture, which is not drawn, the URDF's colour means nothing.
    """
    given = shape.find("material")
    if shape.tag != "visual" or (given is not None and given.find("texture") is None):
        return
    if given is not None:
        shape.remove(given)
    material = ET.SubElement(shape, "material", name="")
    ET.SubElement(material, "color", rgba=" ".join(map(str, colour)))
