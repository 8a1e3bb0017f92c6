"""Faults that were identified of a robot, beside those that its world has. Ours."""

import math
from dataclasses import replace

import numpy as np

from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_draws import draw_encoder_offsets

_OF_GEARS = "backlash_deg", "dry_friction", "stiction", "viscous_friction"
_OF_ALL = "delay_s", "stiction", "viscous_friction"
_BOUND = math.sqrt(3.0)  # of uniform errors, over their standard deviation
_MOST_GAIN_ERROR = 0.9


def world_of(robot: Robot, world: World) -> World:
    """Return a world with what was identified of all servos and the IMU, in addition.

    No more than a world may have of each. A world's IMU is late by whole control
    periods, upwards: what was identified counts as the nearest number of them.
    """
    found = robot.identified
    if found is None:
        return world
    sums = {n: getattr(world, n) + getattr(found, n) for n in _OF_ALL}
    periods = round(found.imu_delay_s / CONTROL_PERIOD_S)
    sums["imu_delay_s"] = world.imu_delay_s + periods * CONTROL_PERIOD_S
    # Whoever gives a world at its limit gave no sum, which the world would refuse.
    return replace(world, **{n: min(total, _most(n)) for n, total in sums.items()})


def _most(name: str) -> float:
    limits = DISTURBANCES[name].limits
    return math.inf if limits is None else limits.high


def unsure(robot: Robot) -> dict[str, float]:
    """Return fields of `World` for what is left unknown of an identified robot.

    Errors drawn uniformly within these bounds have the deviations that were found; what
    was identified of its servos' gears is the robot's, and not drawn again.
    """
    left = left_unknown(robot)
    return dict.fromkeys(_OF_GEARS, 0.0) | left if left else {}


def left_unknown(robot: Robot) -> dict[str, float]:
    """Return the errors of `unsure` alone; none where nothing was identified."""
    found = robot.identified
    if found is None:
        return {}
    return {
        "gain_error": min(_BOUND * found.gain_sd, _MOST_GAIN_ERROR),
        "encoder_offset_deg": _BOUND * math.degrees(found.offset_sd),
        "imu_tilt_deg": _BOUND * math.degrees(found.tilt_sd),
        "com_m": _BOUND * found.com_sd,
    }


def plays(robot: Robot, world: World) -> Array:
    """Return the play of the gears in a world, from end to end, (2 n,) [rad]."""
    play = np.full(len(robot.legs.joint_names), world.backlash_deg)
    if robot.identified is not None:
        play += robot.identified.backlash_deg
    return np.asarray(np.radians(play))


def encoder_offsets(robot: Robot, world: World) -> Array:
    """Return what a robot's encoders show more than its angles in a world [rad]."""
    drawn = draw_encoder_offsets(world, len(robot.legs.joint_names))
    return drawn if robot.identified is None else drawn + robot.identified.offset
