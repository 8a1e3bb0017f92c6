"""The jointed robot of uniform boxes that a reduced biped's numbers describe.

The axes of hip yaw, roll and pitch meet in one point, those of ankle pitch and roll in
another; thigh, shank and foot are the boxes of `kinematics.LINKS`.
"""

import math
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np

from gaitchain.errors import RobotFileError
from gaitchain.messages import Array
from gaitchain.robot.kinematics import link_inertias
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.reduced_biped import ReducedBiped, builtin_robots, parse_biped
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import read_file

JOINTS = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
JOINT_NAMES = tuple(f"{side}_{j}" for side in ("left", "right") for j in JOINTS)
KNEE = 3
_AXES = np.eye(3)[[2, 0, 1, 1, 1, 0]]
_BENT = 1.1  # rad; knees bent as in walking
_OF_LIMIT = 0.9  # of the joints' range, at most: the rest is for balance
_MOST_BYTES = 1_000_000  # of a robot's numbers
_FOOT, _CRUS, _FEMUR, _TRUNK = 0, 1, 2, 3  # indices into `kinematics.LINKS`


def box_legs(biped: ReducedBiped) -> LegModel:
    """Return the legs of the box robot.

    Args:
        biped: the reduced biped that describes the robot.

    Returns:
        The leg model; joints in the order of `JOINT_NAMES`.
    """
    count = len(JOINT_NAMES)
    boxes = link_inertias(biped)
    at, com = np.zeros((6, 3)), np.zeros((6, 3))
    at[KNEE, 2], at[4, 2] = -biped.femur_length, -biped.crus_length
    com[[2, KNEE], 2] = -0.5 * biped.femur_length, -0.5 * biped.crus_length
    com[5] = biped.sole_offset, 0.0, -0.5 * biped.ankle_height
    mass, inertia = np.zeros(6), np.zeros((6, 3, 3))
    mass[[2, KNEE, 5]] = biped.femur_mass, biped.crus_mass, biped.foot_mass
    for joint, link in ((2, _FEMUR), (KNEE, _CRUS), (5, _FOOT)):
        inertia[joint] = np.diag(boxes[link])
    both = _both(at)
    both[:, 0, 1] = 0.5 * biped.hip_width * np.array([1.0, -1.0])
    return LegModel(
        joint_names=JOINT_NAMES,
        knee=KNEE,
        at=both,
        axis=_both(_AXES),
        com=_both(com),
        inertia=_both(inertia),
        link_mass=_both(mass),
        foot_at=np.zeros((2, 3)),
        foot_turn=_both(np.eye(3)),
        trunk_mass=biped.trunk_mass,
        trunk_com=[0.0, 0.0, 0.5 * biped.trunk_length],
        trunk_inertia=np.diag(boxes[_TRUNK]),
        lower=np.full(count, -biped.joint_angle_limit),
        upper=np.full(count, biped.joint_angle_limit),
        stiffness=np.full(count, biped.servo_stiffness),
        damping=np.full(count, biped.servo_damping),
        joint_damping=np.zeros(count),
        torque_limit=np.full(count, biped.joint_torque_limit),
        speed_limit=np.full(count, biped.joint_speed_limit),
        armature=np.full(count, biped.joint_armature),
        friction_loss=np.zeros(count),
        stand=np.tile(_stand(biped), 2),
    )


def box_robot(biped: ReducedBiped) -> Robot:
    """Return the box robot that the reduced biped describes."""
    return Robot(biped, box_legs(biped), boxes=True)


def load_box_robot(robot: str | Path) -> Robot:
    """Load a box robot from a TOML file, or a built-in one by name.

    Args:
        robot: path of a TOML file, or a name that `builtin_robots` lists.

    Returns:
        The robot, each number checked against its range.

    Raises:
        RobotFileError: the file is missing or not TOML; a key is missing, unknown,
            not a number, in another unit, or outside its range.
    """
    path = box_file(robot)
    try:
        table = tomllib.loads(_read(path))
    except (ValueError, RecursionError) as error:  # also numbers of 5000 digits
        raise RobotFileError(f"{path}: not a TOML file: {error}") from None
    return box_robot(parse_biped(table, str(robot)))


def box_file(robot: str | Path) -> Path:
    """Return the TOML file of a path or a built-in name."""
    if str(robot) in builtin_robots():
        return Path(str(resources.files("gaitchain")), "data", f"{robot}.toml")
    return Path(robot)


def _stand(biped: ReducedBiped) -> Array:
    """Return a leg's joints with a bent knee, the hip over the ankle, (6,) [rad].

    To 0.01 rad, by which the hip is off by 0.005 of the leg at most: so RES stands in
    round numbers as ever, on which its library was built.
    """
    knee = round(min(_BENT, _OF_LIMIT * biped.joint_angle_limit), 2)
    behind = biped.crus_length * math.sin(knee)
    below = biped.femur_length + biped.crus_length * math.cos(knee)
    thigh = -round(math.atan2(behind, below), 2)
    return np.array([0.0, 0.0, thigh, knee, round(-thigh - knee, 2), 0.0])


def _both(leg: Array) -> Array:
    return np.stack([leg, leg])


def _read(path: Path) -> str:
    try:
        return read_file(path, _MOST_BYTES).decode()
    except (OSError, ValueError) as error:
        known = ", ".join(builtin_robots())
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise RobotFileError(
            f"{path}: {reason}; give a robot's TOML file or a built-in name ({known})"
        ) from None
