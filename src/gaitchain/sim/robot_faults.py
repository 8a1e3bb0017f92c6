"""Faults that were identified of a robot, beside those that its world has. Ours."""

import math
from dataclasses import replace

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_draws import DOUBT_STREAM, draw_encoder_offsets, stream_of

_FOUND = (
    *("backlash_deg", "dry_friction", "stiction", "viscous_friction"),
    *("gain_error", "encoder_offset_deg", "imu_tilt_deg", "com_m"),
    *("servo_gain", "mass"),  # of all servos and links alike
)
_OF_ALL = "delay_s", "stiction", "viscous_friction"


def world_of(robot: Robot, world: World, period_s: float = CONTROL_PERIOD_S) -> World:
    """Return a world with what was identified of all servos and the IMU, in addition.

    No more than a world may have of each. A world's IMU is late by whole control
    periods, upwards: what was identified counts as the nearest number of them.

    Args:
        robot: the robot.
        world: in which it is.
        period_s: control period of the simulation [s].
    """
    found = robot.identified
    if found is None:
        return world
    sums = {n: getattr(world, n) + getattr(found, n) for n in _OF_ALL}
    late_s = period_s * round(found.imu_delay_s / period_s)
    sums["imu_delay_s"] = world.imu_delay_s + late_s
    # A field at its limit plus what was found would be refused by the world.
    return replace(world, **{n: min(total, _most(n)) for n, total in sums.items()})


def _most(name: str) -> float:
    limits = DISTURBANCES[name].limits
    return math.inf if limits is None else limits.high


def likely_robot(robot: Robot, world: World) -> Robot:
    """Return the robot as it may be for all that its log tells, by the world's seed.

    Its numbers are off together, as the log ties them: of a hip, a knee and an ankle
    that are all off, so that the robot crouches, a log tells little, of one alone much.

    Raises:
        CommandError: the world doubts a robot of which nothing was identified.
    """
    found, doubt = robot.identified, world.doubt
    if not doubt:
        return robot
    if found is None:
        raise CommandError(
            f"doubt is {doubt:g}, must be 0: nothing was identified of {robot.name}; "
            "take a library that `gaitchain identify` wrote"
        )
    by = stream_of(world, DOUBT_STREAM).standard_normal(len(found.unknown))
    return robot.as_identified(found.moved(doubt * by))


def unsure_fields(robot: Robot) -> dict[str, float]:
    """Return fields of `World` for what is left unknown of an identified robot.

    It is drawn as the log leaves it, play, friction and delays too. What other robots
    have of these is not drawn in addition, but for delays: those of the world come
    beside the robot's own, as its bus may be slower than it was.
    """
    if robot.identified is None:
        return {}
    return {name: getattr(World, name) for name in _FOUND} | doubt_field(robot)


def doubt_field(robot: Robot) -> dict[str, float]:
    """Return the field of what is unsure itself, if anything was identified."""
    return {} if robot.identified is None else {"doubt": 1.0}


def backlash_of(robot: Robot, world: World) -> Array:
    """Return the play of the gears in a world, from end to end, (2 n,) [rad]."""
    play = np.full(len(robot.legs.joint_names), world.backlash_deg)
    if robot.identified is not None:
        play += robot.identified.backlash_deg
    return np.asarray(np.radians(play))


def encoder_offsets(robot: Robot, world: World) -> Array:
    """Return what a robot's encoders show more than its angles in a world [rad]."""
    drawn = draw_encoder_offsets(world, len(robot.legs.joint_names))
    return drawn if robot.identified is None else drawn + robot.identified.offset
