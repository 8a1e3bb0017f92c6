"""Turn a URDF into what MuJoCo can read: its tree checked, its meshes found."""

import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import mujoco

from gaitchain.discover import collada
from gaitchain.discover.isolate import listed
from gaitchain.errors import RobotFileError

_MESHES = (".stl", ".obj", ".msh")  # formats that MuJoCo reads
_READ = (*_MESHES, collada.SUFFIX)
_PARENTS = 8  # folders above the file in which meshes are looked for
_SCHEME = re.compile(r"^(?:package|model)://|^\$\(find ([^)]+)\)/")
_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_MIMICS = ("revolute", "continuous", "prismatic")
_MAX_LINKS = 2_000
_SHOWN = 3


def read_urdf(root: ET.Element, path: Path) -> tuple[Any, list[str]]:
    """Read a URDF that is parsed already.

    Args:
        root: its `<robot>`; changed in place.
        path: its file, from which meshes are looked for.

    Returns:
        The `mujoco.MjSpec`, not yet compiled, and a note for all that was left out.

    Raises:
        RobotFileError: its links and joints are not a tree.
    """
    _refuse_macros(root)
    for child in list(root):
        if child.tag not in ("link", "joint", "material"):
            root.remove(child)  # what simulators and controllers add
    for shape in (*root.iterfind("link/visual"), *root.iterfind("link/collision")):
        shape.attrib.pop("name", None)  # often given twice, which MuJoCo complains of
    notes = _check_tree(root)
    found, converted = _find_meshes(root, path.resolve().parent)
    notes += found
    for material in root.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
    kept = dict.fromkeys(("strippath", "fusestatic", "discardvisual"), "false")
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", kept)
    text = ET.tostring(root, encoding="unicode")
    spec = mujoco.MjSpec.from_string(text, assets=converted)
    for body in spec.bodies:
        if not body.explicitinertial:
            # A link without <inertial> weighs nothing; MuJoCo would fill its shapes.
            for geom in body.geoms:
                geom.mass = 0.0
    return spec, notes + _joint_notes(root)


def read_speeds(root: ET.Element) -> dict[str, float]:
    """Return the speed limits of a URDF's joints, which MuJoCo leaves out.

    Args:
        root: its `<robot>`.

    Returns:
        [rad/s] by joint, [m/s] of slides; without those that are no positive number,
        as exporters write 0 for "not known".
    """
    speeds = {}
    for joint in root.iterfind("joint"):
        limit = joint.find("limit")
        try:
            speed = float("" if limit is None else limit.get("velocity", ""))
        except ValueError:
            continue
        if 0.0 < speed < math.inf:
            speeds[joint.get("name", "")] = speed
    return speeds


def _refuse_macros(root: ET.Element) -> None:
    for element in root.iter():
        if "xacro" in element.tag or any("${" in v for v in element.attrib.values()):
            raise RobotFileError(
                f"<{element.tag.split('}')[-1]:.40}> is a xacro macro; expand the file "
                "first: xacro robot.urdf.xacro > robot.urdf"
            )


def _check_tree(root: ET.Element) -> list[str]:
    """Refuse what is not a tree of links; free the base where a joint says so."""
    links = [link.get("name", "") for link in root.findall("link")]
    if not links:
        raise RobotFileError("it has no <link>")
    if len(links) > _MAX_LINKS:
        raise RobotFileError(f"{len(links)} links; at most {_MAX_LINKS}")
    for name in links:
        if not name or links.count(name) > 1:
            what = f"two links are called {name!r}" if name else "a link has no name"
            raise RobotFileError(what)
    parents: dict[str, tuple[str, str]] = {}
    for joint in root.findall("joint"):
        name, parent, child = _ends(joint, set(links))
        if child in parents:
            raise RobotFileError(
                f"link {child!r} is the child of two joints, {parents[child][0]!r} and "
                f"{name!r}; a URDF is a tree"
            )
        parents[child] = (name, parent)
    _refuse_rings(parents)
    return _free_floating(root, parents)


def _ends(joint: ET.Element, links: set[str]) -> tuple[str, str, str]:
    name, kind = joint.get("name", ""), joint.get("type", "")
    if kind not in _JOINTS:
        raise RobotFileError(
            f"joint {name!r} has type {kind!r}; known are {', '.join(_JOINTS)}"
        )
    ends = []
    for end in ("parent", "child"):
        element = joint.find(end)
        link = "" if element is None else element.get("link", "")
        if link not in links:
            raise RobotFileError(
                f"joint {name!r}: its {end} link {link!r} is not in the file"
            )
        ends.append(link)
    return name, ends[0], ends[1]


def _refuse_rings(parents: dict[str, tuple[str, str]]) -> None:
    tree = TopologicalSorter({link: [parent] for link, (_, parent) in parents.items()})
    try:
        tree.prepare()
    except CycleError as error:
        ring = " -> ".join(error.args[1][:_SHOWN])
        raise RobotFileError(f"its links go round in a ring: {ring} -> ...") from None


def _free_floating(root: ET.Element, parents: dict[str, tuple[str, str]]) -> list[str]:
    notes = []
    for joint in root.findall("joint[@type='floating']"):
        name = joint.get("name", "")
        child = next(c for c, (j, _) in parents.items() if j == name)
        parent = parents[child][1]
        if parent in parents:
            raise RobotFileError(
                f"joint {name!r} lets link {child!r} float below {parent!r}; only the "
                "base can float"
            )
        root.remove(joint)
        notes.append(f"Floating joint {name!r} taken as the free base {child!r}.")
    return notes


def _find_meshes(root: ET.Element, folder: Path) -> tuple[list[str], dict[str, bytes]]:
    """Put the path of each mesh in; take out those that cannot be had.

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


def _joint_notes(root: ET.Element) -> list[str]:
    joints = root.findall("joint")
    movable = {j.get("name", ""): j for j in joints if j.get("type") in _MIMICS}
    led: list[str] = []
    lost: list[str] = []
    for name, joint in movable.items():
        mimic = joint.find("mimic")
        if mimic is not None:
            (led if mimic.get("joint", "") in movable else lost).append(name)
    turned = [j.get("name", "") for j in joints if _turned_round(j)]
    groups = (
        (led, "mimic joint", "held to another by an equality"),
        (lost, "mimic joint", "free, since what it should follow is not in the file"),
        (turned, "joint", "without limits, since the lower lies above the upper"),
    )
    return [f"{listed(what, names)} {how}." for names, what, how in groups if names]


def _turned_round(joint: ET.Element) -> bool:
    limit = joint.find("limit")
    if limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return False
    try:
        return float(limit.get("lower", "0")) > float(limit.get("upper", "0"))
    except ValueError:
        return False
