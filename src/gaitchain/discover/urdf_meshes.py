"""Find the mesh files of a URDF, and take out the shapes whose meshes are not there."""

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from gaitchain.discover import collada
from gaitchain.discover.notes import Doubt, listed

_MESHES = (".stl", ".obj", ".msh")  # formats that MuJoCo reads
_READ = (*_MESHES, collada.SUFFIX)
_PARENTS = 8  # folders above the file in which meshes are looked for
_SHOWN = 3
_SCHEME = re.compile(r"^(?:package|model)://|^\$\(find ([^)]+)\)/")


def find_meshes(
    root: ET.Element, folders: Sequence[Path], own: str = ""
) -> tuple[list[str], dict[str, bytes]]:
    """Put the path of each mesh in; take out those that cannot be had.

    Args:
        root: the URDF's `<robot>`; changed in place.
        folders: where the file lies, from which meshes are looked for, first one first.
        own: folder of meshes that the file names for MuJoCo, if it does.

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
            name = mesh.get("filename", "").replace("\\", "/")  # as of Windows
            mesh.set("filename", name)
            found = _find(name, folders, own)
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
    notes = made.notes + _take_out(lost) + _say_missing(packages, folders)
    return notes + _say_case(lost, folders, own), made.stl


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
            note = (
                f"{listed(f'{kind} mesh file', list(dict.fromkeys(names)))} left out: "
                f"not found, or not in a format that can be read ({', '.join(_READ)})."
            )
            # Without shapes to collide with, the visible ones are what is judged.
            counts = any(link.find("collision") is None for link, _ in lost)
            notes.append(Doubt(note) if counts or kind == "collision" else note)
    return notes


def _is_folder(path: Path) -> bool:
    """Whether a folder is there; not where its name is none, or it is locked away."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _say_missing(packages: list[str], folders: Sequence[Path]) -> list[str]:
    places = _above(folders)
    gone = [
        package
        for package in dict.fromkeys(packages)
        if not any(_is_folder(place / package) for place in places)
    ]
    if not gone:
        return []
    note = (
        f"{listed('package', gone)} of meshes not found near {folders[0]}: set "
        "ROS_PACKAGE_PATH to the folder that holds it, or AMENT_PREFIX_PATH to where "
        "it is installed."
    )
    return [Doubt(note)]


def _say_case(
    lost: list[tuple[ET.Element, ET.Element]], folders: Sequence[Path], own: str
) -> list[str]:
    """Say where a mesh is there, but for capital letters in its name."""
    for _, shape in lost[:_SHOWN]:
        mesh = shape.find("geometry/mesh")
        name = "" if mesh is None else unquote(mesh.get("filename", ""))
        for path in _places(name, folders, own):
            if near := _other_case(path):
                note = f"{path.name} is not there, {near} is: the case of names counts."
                return [Doubt(note)]
    return []


def _other_case(path: Path) -> str:
    """Return the name of a file that differs in capital letters only, if one is."""
    try:
        names = [] if path.exists() else [p.name for p in path.parent.iterdir()]
    except (OSError, ValueError):  # no such folder, or a name that no file can have
        return ""
    return next((n for n in names if n.lower() == path.name.lower()), "")


def _package_of(name: str) -> list[str]:
    """Return the ROS package that a mesh's name begins with, if it names one."""
    scheme = _SCHEME.match(name)
    if scheme is None:
        return []
    return [scheme[1] or name[scheme.end() :].partition("/")[0]]


def _find(name: str, folders: Sequence[Path], own: str) -> Path | None:
    try:
        places = _places(unquote(name), folders, own)
        return next((p for p in places if p.is_file()), None)
    except (OSError, ValueError):  # names that no file can have
        return None


def _above(folders: Sequence[Path]) -> list[Path]:
    """Return folders and those above them, each once."""
    above = [[folder, *list(folder.parents)[:_PARENTS]] for folder in folders]
    return list(dict.fromkeys(place for places in above for place in places))


def _places(name: str, folders: Sequence[Path], own: str) -> Iterator[Path]:
    """Say where a mesh may be: MuJoCo's folder, packages, then folders above."""
    scheme = _SCHEME.match(name)
    plain = name[scheme.end() :] if scheme else name.removeprefix("file://")
    if own:  # without the folders of the name too, as MuJoCo does by default
        for folder in folders:
            yield from (folder / own / plain, folder / own / Path(plain).name)
    if scheme is None:
        yield from (place / plain for place in _above(folders))
        return
    package, rest = (scheme[1], plain) if scheme[1] else plain.partition("/")[::2]
    for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if entry:
            yield Path(entry) / package / rest
            yield Path(entry).parent / package / rest
    for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if entry:
            yield Path(entry) / "share" / package / rest
    for place in _above(folders):
        yield from (place / package / rest, place / rest)
