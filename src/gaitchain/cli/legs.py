"""Print the leg joints of a robot and their servos; of a library, without MuJoCo."""

import math

from gaitchain.cli.console import print_table
from gaitchain.discover.findings import Findings
from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel

_ALONG = 0.999  # least component of a unit axis that counts as x, y or z
_JOINTS = ("joint", "axis", "range [deg]", "stand [deg]")
_SERVOS = (
    "joint",
    "kp\n[N m/rad]",
    "kv\n[N m s/rad]",
    "joint's damping\n[N m s/rad]",
    "limit\n[N m]",
    "speed\n[rad/s]",
)


def show_legs(full: LegModel, found: Findings | None = None) -> None:
    """Print a robot's leg joints, hip to ankle, left leg first.

    Args:
        full: the robot's legs.
        found: findings with the sources of the servo parameters, if known.
    """
    names = full.joint_names
    axes = full.axis.reshape(-1, 3)
    spans = [
        f"{math.degrees(low):.0f} to {math.degrees(high):.0f}"
        for low, high in zip(full.lower, full.upper, strict=True)
    ]
    stand = map(degrees, full.stand)
    joints = zip(names, map(_axis, axes), spans, stand, strict=True)
    print_table("Leg joints, hip to ankle", _JOINTS, joints, range(2))
    servos = [
        (
            name,
            f"{full.stiffness[j]:.4g}",
            f"{full.damping[j] - full.joint_damping[j]:.3g}",
            f"{full.joint_damping[j]:.3g}",
            f"{full.torque_limit[j]:.3g}",
            _speed(full, j, found),
            *(() if found is None else (found.servos[name].source,)),
        )
        for j, name in enumerate(names)
    ]
    heads = _SERVOS if found is None else (*_SERVOS, "servo from")
    print_table("Their servos", heads, servos, {0, len(_SERVOS)})


def _speed(full: LegModel, joint: int, found: Findings | None) -> str:
    """Return a servo's speed limit as text, or the assumed one if the file has none."""
    limit = f"{full.speed_limit[joint]:.3g}"
    unsaid = found and found.servos[full.joint_names[joint]].speed_limit == math.inf
    return f"unsaid: {limit}" if unsaid else limit


def degrees(angle: float) -> str:
    """Format an angle [rad] in deg."""
    # + 0.0 turns -0.0 into 0.0.
    return f"{round(math.degrees(angle), 1) + 0.0:.1f}"


def _axis(axis: Array) -> str:
    """Return the name of an axis of the pelvis frame: x forward, y left, z up."""
    for name, share in zip("xyz", axis.tolist(), strict=True):
        if abs(share) > _ALONG:
            return f"{'+' if share > 0.0 else '-'}{name}"
    return "({:.2f}, {:.2f}, {:.2f})".format(*(axis + 0.0).tolist())
