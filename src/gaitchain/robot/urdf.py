"""The robot's legs as a URDF, for viewers and nodes of ROS.

The trunk is `base_link`: origin between the hips, x ahead, y left, z up. Each leg joint
moves a link of its own, whose frame is the joint's with all joints at 0 parallel to
`base_link`; the soles are `l_sole` and `r_sole` as in REP 120. Joints that a walk holds
still are part of the trunk. Shapes are cylinders from joint to joint, and boxes.
"""

import math
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.robot import Robot

BASE = "base_link"
SOLES = ("l_sole", "r_sole")
_THICK = 0.06  # of the leg: radius of the cylinders
_SHORT = 0.02  # of the leg: links shorter than this are not drawn
_SOLE_M = 0.01  # thickness of a drawn sole
_TINY_KG, _TINY_M = 1e-6, 0.02  # of a link without mass, and its radius of gyration
_COLOURS = {
    "trunk": "0.35 0.4 0.5 1",
    "left": "0.2 0.5 0.8 1",
    "right": "0.8 0.4 0.2 1",
}


def link_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the links that the leg joints move, in the joints' order."""
    names = robot.legs.joint_names
    stems = tuple(name.removesuffix("_joint") for name in names)
    unique = len(set(stems)) == len(names)
    return tuple(f"{stem}_link" for stem in (stems if unique else names))


def link_parents(robot: Robot) -> tuple[str, ...]:
    """Return the name of the link before each joint, in the joints' order."""
    names, count = link_names(robot), robot.legs.leg_joints
    return tuple(BASE if i % count == 0 else names[i - 1] for i in range(len(names)))


def last_links(robot: Robot) -> tuple[str, str]:
    """Return the names of the links with the left and the right sole."""
    names, count = link_names(robot), robot.legs.leg_joints
    return names[count - 1], names[-1]


def sole_origins(robot: Robot) -> Array:
    """Return the soles below the ankles, from the last joints' centres, (2, 3) [m]."""
    legs = robot.legs
    up = legs.foot_turn[:, :, 2]
    return np.asarray(legs.foot_at - robot.reduced.ankle_height * up)


def urdf_of(robot: Robot) -> str:
    """Return the URDF as text."""
    root = ET.Element("robot", name=robot.name)
    for name, colour in _COLOURS.items():
        ET.SubElement(ET.SubElement(root, "material", name=name), "color", rgba=colour)
    legs = robot.legs
    trunk = ET.SubElement(root, "link", name=BASE)
    _add_inertia(trunk, legs.trunk_mass, legs.trunk_com, legs.trunk_inertia)
    _add_trunk(trunk, robot)
    for leg in range(2):
        _add_leg(root, robot, leg)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=False)


def _add_leg(root: ET.Element, robot: Robot, leg: int) -> None:
    legs, count = robot.legs, robot.legs.leg_joints
    names, parents = link_names(robot), link_parents(robot)
    ends = [*legs.at[leg, 1:], legs.foot_at[leg]]
    for j in range(count):
        i = leg * count + j
        link = ET.SubElement(root, "link", name=names[i])
        _add_inertia(
            link, legs.link_mass[leg, j], legs.com[leg, j], legs.inertia[leg, j]
        )
        _add_rod(link, ends[j], robot.reduced.leg_length, ("left", "right")[leg])
        _add_joint(root, robot, i, parents[i], names[i])
    _add_sole(root, robot, leg)


def _add_joint(root: ET.Element, robot: Robot, i: int, parent: str, child: str) -> None:
    legs = robot.legs
    at, axis = legs.at.reshape(-1, 3)[i], legs.axis.reshape(-1, 3)[i]
    joint = ET.SubElement(root, "joint", name=legs.joint_names[i], type="revolute")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_text(at), rpy="0 0 0")
    ET.SubElement(joint, "axis", xyz=_text(axis))
    speed = float(legs.speed_limit[i])
    ET.SubElement(
        joint,
        "limit",
        lower=_text([legs.lower[i]]),
        upper=_text([legs.upper[i]]),
        effort=_text([min(float(legs.torque_limit[i]), 1e6)]),
        velocity=_text([min(speed, 1e3)]),  # URDF has no infinity
    )


def _add_sole(root: ET.Element, robot: Robot, leg: int) -> None:
    link = ET.SubElement(root, "link", name=SOLES[leg])
    rear, front = robot.reduced.sole_x
    visual = ET.SubElement(link, "visual")
    middle = (0.5 * (rear + front), 0.0, 0.5 * _SOLE_M)
    ET.SubElement(visual, "origin", xyz=_text(middle), rpy="0 0 0")
    size = (front - rear, robot.reduced.sole_width, _SOLE_M)
    ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=_text(size))
    ET.SubElement(visual, "material", name=("left", "right")[leg])
    joint = ET.SubElement(root, "joint", name=f"{SOLES[leg]}_fixed", type="fixed")
    ET.SubElement(joint, "parent", link=last_links(robot)[leg])
    ET.SubElement(joint, "child", link=SOLES[leg])
    turn = _rpy(robot.legs.foot_turn[leg])
    origin = sole_origins(robot)[leg]
    ET.SubElement(joint, "origin", xyz=_text(origin), rpy=_text(turn))


def _add_trunk(link: ET.Element, robot: Robot) -> None:
    """Draw the trunk as a box about its CoM, from the hips up."""
    legs = robot.legs
    wide = max(robot.reduced.hip_width, 0.1 * robot.reduced.leg_length)
    high = max(2.0 * float(legs.trunk_com[2]), 0.5 * wide)
    visual = ET.SubElement(link, "visual")
    ET.SubElement(visual, "origin", xyz=_text((0.0, 0.0, 0.5 * high)), rpy="0 0 0")
    size = (0.5 * wide, wide, high)
    ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=_text(size))
    ET.SubElement(visual, "material", name="trunk")


def _add_rod(link: ET.Element, end: Array, leg_length: float, colour: str) -> None:
    """Draw a cylinder from the joint to the next one."""
    length = float(np.linalg.norm(end))
    if length < _SHORT * leg_length:
        return
    x, y, z = end / length
    visual = ET.SubElement(link, "visual")
    # R_z(yaw) R_y(pitch) turns z to the end.
    turn = (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))
    ET.SubElement(visual, "origin", xyz=_text(0.5 * end), rpy=_text(turn))
    shape = ET.SubElement(visual, "geometry")
    radius = _THICK * leg_length
    ET.SubElement(shape, "cylinder", radius=_text([radius]), length=_text([length]))
    ET.SubElement(visual, "material", name=colour)


def _add_inertia(link: ET.Element, mass: float, com: Array, inertia: Array) -> None:
    if mass <= 0.0:  # between joints that intersect; simulators take no link without
        mass, inertia = _TINY_KG, _TINY_KG * _TINY_M**2 * np.eye(3)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=_text([mass]))
    xyz = "xyz"
    parts = {
        f"i{xyz[i]}{xyz[j]}": _text([inertia[i, j]])
        for i in range(3)
        for j in range(i, 3)
    }
    ET.SubElement(inertial, "inertia", parts)


def _rpy(turn: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of R_z R_y R_x [rad]."""
    return (
        math.atan2(turn[2, 1], turn[2, 2]),
        math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0])),
        math.atan2(turn[1, 0], turn[0, 0]),
    )


def _text(numbers: Array | Sequence[float]) -> str:
    return " ".join(f"{number:.9g}" for number in np.ravel(numbers).tolist())
