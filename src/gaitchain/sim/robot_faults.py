"""Faults that were identified of a robot, beside those that its world has. Ours."""

from dataclasses import replace

from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import draw_encoder_offsets

_OF_SERVOS = (
    "delay_s",
    "backlash_deg",
    "dry_friction",
    "stiction",
    "viscous_friction",
)


def world_of(robot: Robot, world: World) -> World:
    """Return a world with what was identified of a robot's servos, in addition."""
    found = robot.identified
    if found is None:
        return world
    return replace(
        world, **{n: getattr(world, n) + getattr(found, n) for n in _OF_SERVOS}
    )


def encoder_offsets(robot: Robot, world: World) -> Array:
    """Return what a robot's encoders show more than its angles in a world [rad]."""
    drawn = draw_encoder_offsets(world, len(robot.legs.joint_names))
    return drawn if robot.identified is None else drawn + robot.identified.offset
