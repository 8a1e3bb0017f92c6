"""Find the mesh files of a URDF, and take out the shapes whose meshes are not there."""

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from gaitchain.discover import collada
from gaitchain.discover.isolate import listed

_MESHES = (".stl", ".obj", ".msh")  # formats that MuJoCo reads
_READ = (*_MESHES, collada.SUFFIX)
_PARENTS = 8  # folders above the file in which meshes are looked for
_SCHEME = re.compile(r"^(?:package|model)://|^\$\(find ([^)]+)\)/")


def find_meshes(root: ET.Element, folder: Path) -> tuple[list[str], dict[str, bytes]]:
    """Put the path of each mesh in; take out those that cannot be had.

    Args:
        root: the URDF's `<robot>`; changed in place.
        folder: where the file lies, from which meshes are looked for.

    Returns:
        Notes, and by name the meshes that were converted.
    """
    packages: list[str] = []
    lost: list[tuple[ET.Element, ET.Element]] = []
    placed: list[collada.Placed] = []
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            found = _find(name, folder)
            suffix = "" if found is None else found.suffix.lower()
            if found is None or suffix not in _READ:
                lost.append((link, shape))
                packages += _package_of(name) if found is None else ()
            elif suffix == collada.SUFFIX:
                placed.append(collada.Placed(link, shape, found))
            else:
                mesh.set("filename", str(found))
    made = collada.convert(placed)
    lost += [(one.link, one.shape) for one in made.lost]
    return made.notes + _take_out(lost) + _say_missing(packages, folder), made.stl


def _take_out(lost: list[tuple[ET.Element, ET.Element]]) -> list[str]:
    """Take shapes out of their links; return notes that name their meshes."""
    notes = []
    for kind in ("visual", "collision"):
        names = []
        for link, shape in lost:
            if shape.tag == kind:
                link.remove(shape)
                mesh = shape.find("geometry/mesh")
                assert mesh is not None  # whoever lost it has seen it
                names.append(mesh.get("filename", "").rpartition("/")[2])
        if names:
            notes.append(
                f"{listed(f'{kind} mesh file', list(dict.fromkeys(names)))} left out: "
                f"not found, or not in a format that can be read ({', '.join(_READ)})."
            )
    return notes


def _say_missing(packages: list[str], folder: Path) -> list[str]:
    if not packages:
        return []
    return [
        f"{listed('package', list(dict.fromkeys(packages)))} of meshes not found "
        f"near {folder}: set ROS_PACKAGE_PATH to the folder that holds it, or "
        "AMENT_PREFIX_PATH to where it is installed."
    ]


def _package_of(name: str) -> list[str]:
    """Return the ROS package that a mesh's name begins with, if it names one."""
    scheme = _SCHEME.match(name)
    if scheme is None:
        return []
    return [scheme[1] or name[scheme.end() :].partition("/")[0]]


def _find(name: str, folder: Path) -> Path | None:
    try:
        return next((p for p in _places(unquote(name), folder) if p.is_file()), None)
    except (OSError, ValueError):  # names that no file can have
        return None


def _places(name: str, folder: Path) -> Iterator[Path]:
    """Say where a mesh may be: packages of the environment, then folders above."""
    above = (folder, *list(folder.parents)[:_PARENTS])
    scheme = _SCHEME.match(name)
    if scheme is None:
        plain = name.removeprefix("file://")
        yield from (place / plain for place in above)
        return
    rest = name[scheme.end() :]
    package, rest = (scheme[1], rest) if scheme[1] else rest.partition("/")[::2]
    for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if entry:
            yield Path(entry) / package / rest
            yield Path(entry).parent / package / rest
    for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if entry:
            yield Path(entry) / "share" / package / rest
    for place in above:
        yield from (place / package / rest, place / rest)
