"""Turn a URDF into what MuJoCo can read: its tree checked, its meshes found."""

import math
import re
import xml.etree.ElementTree as ET
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import mujoco

from gaitchain.discover.notes import Doubt, listed
from gaitchain.discover.urdf_meshes import find_meshes
from gaitchain.errors import RobotFileError, short_name

_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_MIMICS = ("revolute", "continuous", "prismatic")
_MAX_LINKS = 2_000
# How many numbers MuJoCo reads of each attribute.
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "limit": dict.fromkeys(("lower", "upper", "effort"), 1),
    "dynamics": dict.fromkeys(("damping", "friction"), 1),
    "mimic": dict.fromkeys(("multiplier", "offset"), 1),
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": dict.fromkeys(("radius", "length"), 1),
    "capsule": dict.fromkeys(("radius", "length"), 1),
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
}
_SHOWN = 3


def read_urdf(root: ET.Element, path: Path) -> tuple[Any, list[str]]:
    """Read a URDF that is parsed already.

    Args:
        root: its `<robot>`; changed in place.
        path: its file, from which meshes are looked for, also where that is a link.

    Returns:
        The `mujoco.MjSpec`, not yet compiled, and a note for all that was left out.

    Raises:
        RobotFileError: its links and joints are not a tree, or a number is none.
    """
    _refuse_macros(root)
    compiler = root.find("mujoco/compiler")
    meshdir = "" if compiler is None else compiler.get("meshdir", "")
    for child in list(root):
        if child.tag not in ("link", "joint", "material"):
            root.remove(child)  # what simulators and controllers add
    for shape in (*root.iterfind("link/visual"), *root.iterfind("link/collision")):
        shape.attrib.pop("name", None)  # often given twice, which MuJoCo complains of
    _check_numbers(root)
    notes = _check_tree(root) + _drop_empty_shapes(root) + _doubt_massless(root)
    found, converted = find_meshes(root, _folders_of(path), meshdir)
    notes += found
    for material in root.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
    kept = dict.fromkeys(("strippath", "fusestatic", "discardvisual"), "false")
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", kept)
    spec = _parse(ET.tostring(root, encoding="unicode"), converted)
    for body in spec.bodies:
        if not body.explicitinertial:
            # A link without <inertial> weighs nothing; MuJoCo would fill its shapes.
            for geom in body.geoms:
                geom.mass = 0.0
    return spec, notes + _joint_notes(root)


def _folders_of(path: Path) -> list[Path]:
    """Return the folder of a file, and that of the one to which it is a link."""
    return list(dict.fromkeys((path.absolute().parent, path.resolve().parent)))


def _parse(text: str, meshes: dict[str, bytes]) -> Any:
    try:
        return mujoco.MjSpec.from_string(text, assets=meshes)
    except ValueError as error:
        # It counts the lines of the text that was written here, not of the file.
        raise ValueError(re.sub(r",? line \d+", "", str(error))) from None


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


def _check_numbers(root: ET.Element) -> None:
    """Refuse what is no number, by its link or joint: MuJoCo would not say whose."""
    for owner in root:
        for element in owner.iter():
            for name, count in _NUMBERS.get(element.tag, {}).items():
                given = element.get(name, "").strip()
                if given and not _are_numbers(given, count):  # empty is left out
                    many = "a number" if count == 1 else f"{count} numbers"
                    raise RobotFileError(
                        f"{owner.tag} {short_name(owner.get('name', ''))!r}: "
                        f"<{element.tag} {name}={short_name(given)!r}>: give {many}"
                    )


def _are_numbers(text: str, count: int) -> bool:
    words = text.split()
    try:
        return len(words) == count and bool([*map(float, words)])
    except ValueError:
        return False


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


def _drop_empty_shapes(root: ET.Element) -> list[str]:
    """Take out shapes without a geometry or of no size, which MuJoCo refuses."""
    links = list[str]()
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            solid = shape.find("geometry/*")
            if solid is None or _is_empty(solid):
                link.remove(shape)
                links.append(link.get("name", ""))
    if not links:
        return []
    where = listed("link", list(dict.fromkeys(links)))
    return [Doubt(f"Shapes without a size left out of {where}.")]


def _doubt_massless(root: ET.Element) -> list[str]:
    """Doubt links that may touch something, and weigh nothing."""
    links = [
        link.get("name", "")
        for link in root.findall("link")
        if link.find("collision") is not None and link.find("inertial") is None
    ]
    if not links:
        return []
    what = f"{listed('link', links)} with <collision> and without <inertial>"
    return [Doubt(f"{what}: without mass, as nothing says how much.")]


def _is_empty(solid: ET.Element) -> bool:
    sizes = " ".join(solid.get(key, "") for key in ("size", "radius", "length"))
    try:
        return not all(float(size) for size in sizes.split())
    except ValueError:  # MuJoCo says what is wrong with it
        return False


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
    low, high = _limits(joint)
    return joint.get("type") in ("revolute", "prismatic") and low > high


def _limits(joint: ET.Element) -> tuple[float, float]:
    limit = joint.find("limit")
    if limit is None:
        return 0.0, 0.0
    try:
        return float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    except ValueError:
        return 0.0, 0.0
