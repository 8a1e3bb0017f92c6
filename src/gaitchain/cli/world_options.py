"""Parse options that several verbs share: worlds, pushes, schedules, feedback."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from gaitchain.cli.options import LoopOptions
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.limits import exact
from gaitchain.gait.schedule import Schedule, check_schedule, parse_schedule
from gaitchain.messages import Command
from gaitchain.robot.robot import Robot
from gaitchain.sim.bodies import body_names, check_body
from gaitchain.sim.known_servos import KNOWN_SERVOS
from gaitchain.sim.push import Punches, Push
from gaitchain.sim.robot_faults import likely_robot
from gaitchain.sim.world import DISTURBANCES, World

_PUSH = re.compile(r"^([^@]+)@([^@]+)(?:@([^@]+))?(?:@([^@]+))?$")
_PUSHED_AT_S = 4.0


def world_numbers(
    options: object, push: str | None = None, punches: str | None = None
) -> dict[str, Any]:
    """Return the given fields of `World` by name.

    Args:
        options: the options that `cli.options` derives from the disturbances.
        push: pushes in the format of `parse_pushes`.
        punches: in the format of `parse_punches`.

    Raises:
        CommandError: a number is outside its limits, or a push cannot be parsed.
    """
    servo = getattr(options, "servo", None)
    given: dict[str, Any] = dict(KNOWN_SERVOS[servo].numbers) if servo else {}
    for name, disturbance in DISTURBANCES.items():
        value = getattr(options, disturbance.option, None)
        if value is None or value is False:
            continue
        try:
            World(**{name: value})
        except CommandError as error:
            option = disturbance.option.replace("_", "-")
            raise CommandError(f"--{option}: {error}") from None
        given[name] = value
    if push is not None:
        given["push"] = parse_pushes(push)
    if punches is not None:
        given["punches"] = parse_punches(punches)
    return given


def given_by(name: str, options: object) -> str:
    """Return the option that gave a field of `World`, without dashes.

    Args:
        name: of the field.
        options: of which `world_numbers` returned it.
    """
    servo, own = getattr(options, "servo", None), DISTURBANCES[name].option
    alone = getattr(options, own, None) is not None
    if servo and name in KNOWN_SERVOS[servo].numbers and not alone:
        return "servo"
    return own.replace("_", "-")


def world_json(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Convert numbers of a world for JSON, without empty ones."""
    plain = {**numbers, "push": [asdict(push) for push in numbers.get("push", ())]}
    if numbers.get("punches") is not None:
        plain["punches"] = asdict(numbers["punches"])
    return {name: value for name, value in plain.items() if value not in ([], None)}


def parse_pushes(text: str) -> tuple[Push, ...]:
    """Parse pushes such as "8@90,5@-90@6.5,5@0@8@left_foot": N s, deg, s, body.

    Raises:
        CommandError: a push cannot be parsed, or a number is outside its limits.
    """
    pushes = []
    for part in text.split(","):
        match = _PUSH.match(part.strip())
        try:
            if match is None:
                raise ValueError
            *numbers, body = match.groups()
            impulse, direction, at_s = (
                float(_PUSHED_AT_S if group is None else group) for group in numbers
            )
        except ValueError:
            raise CommandError(
                f"--push {part.strip()!r}: expected impulse@direction, "
                "impulse@direction@time or impulse@direction@time@body, in N s, deg (0 "
                'forward, 90 to the left) and s, with commas between, as in "8@90,'
                '8@180@6.5"'
            ) from None
        try:
            pushes.append(Push(impulse, direction, at_s, body=body or Push.body))
        except CommandError as error:
            raise CommandError(f"--push {part.strip()!r}: {error}") from None
    return tuple(pushes)


def parse_punches(text: str) -> Punches:
    """Parse punches such as "20@5": the most N s, and s from one to the next.

    Raises:
        CommandError: they cannot be parsed, or a number is outside its limits.
    """
    try:
        return Punches(*map(float, text.split("@", 1)))
    except ValueError:
        raise CommandError(
            f"--punches {text!r}: expected impulse or impulse@interval, in N s and s, "
            'as in "20@5"'
        ) from None
    except CommandError as error:
        raise CommandError(f"--punches {text!r}: {error}") from None


def read_schedule(text: str, library: GaitLibrary) -> Schedule:
    """Parse a schedule and check that a library can walk it.

    Raises:
        CommandError: it cannot be parsed, or the library cannot walk it.
    """
    schedule = parse_schedule(text, steps=library.family.counts_steps)
    check_schedule(schedule, library.command_range)
    return schedule


def check_pushes(numbers: Mapping[str, Any], ends_s: float) -> None:
    """Refuse a push that may come after a walk, which would seem to withstand it.

    Args:
        numbers: of the world, as `world_numbers` returns them.
        ends_s: when the last command ends [s].

    Raises:
        CommandError: a push begins then or later.
    """
    latest_s = _latest_s(numbers.get("push", ()))
    if latest_s >= ends_s:
        raise CommandError(
            f"--push: one begins at {exact(latest_s)} s, the last command ends at "
            f"{ends_s:g} s; push earlier, or walk longer, or stand at the end by a "
            "command of 0"
        )


def check_pushes_on_way(pushes: Sequence[Push], took_s: float) -> None:
    """Refuse a push that comes after a way to places, whose time only a walk shows.

    Args:
        pushes: of the world.
        took_s: how long the way took [s].

    Raises:
        CommandError: a push was to begin then or later.
    """
    latest_s = _latest_s(pushes)
    if latest_s >= took_s:
        raise CommandError(
            f"--push: one begins at {exact(latest_s)} s, the way took "
            f"{took_s:.3g} s; push earlier, or give more way points"
        )


def _latest_s(pushes: Sequence[Push]) -> float:
    """Return when the last push begins [s]; -inf where there is none."""
    return max((push.at_s for push in pushes), default=-math.inf)


def check_effects(numbers: Mapping[str, Any], robot: Robot) -> None:
    """Refuse numbers that would do nothing to a robot, before any work.

    Args:
        numbers: of the world, as `world_numbers` returns them.
        robot: that walks.

    Raises:
        CommandError: it is doubted, and nothing was identified of it; or a disturbance
            comes without the one that it is a part of; or a push is on a body that it
            does not have.
    """
    try:
        likely_robot(robot, World(doubt=numbers.get("doubt", 0.0)))
    except CommandError as error:
        raise CommandError(f"--doubt: {error}") from None
    for push in numbers.get("push", ()):
        check_pushed("push", push.body, body_names(robot))
    for name, disturbance in DISTURBANCES.items():
        needed = disturbance.needs
        alone = needed and not numbers.get(needed) and not _has(robot, needed)
        if alone and numbers.get(name):
            option, other = (
                each.option.replace("_", "-")
                for each in (disturbance, DISTURBANCES[needed])
            )
            raise CommandError(f"--{option} has no effect without --{other}")


def check_pushed(option: str, name: str, bodies: Sequence[str]) -> None:
    """Refuse a push on a body that a robot does not have, before any work.

    Args:
        option: that has the name, for the message.
        name: of the body.
        bodies: names of those that can be pushed.

    Raises:
        CommandError: it is none of them.
    """
    try:
        check_body(name, bodies)
    except CommandError as error:
        raise CommandError(f"--{option}: {error}") from None


def _has(robot: Robot, disturbance: str) -> bool:
    """Return whether a robot has a disturbance by its file or by its log."""
    return disturbance == "dry_friction" and bool(robot.legs.friction_loss.any())


def check_crouch(crouch: float, library: GaitLibrary) -> None:
    """Refuse a crouch that a library does not go down to [m].

    Raises:
        CommandError: it is negative, or too low.
    """
    try:
        library.command_range.check(Command(crouch=crouch))
    except CommandError as error:
        raise CommandError(f"--crouch: {error}") from None


def wants_feedback(options: LoopOptions) -> bool:
    """Return whether to walk with balance feedback.

    Raises:
        CommandError: both feedback and open loop were chosen.
    """
    if options.feedback and options.open_loop:
        raise CommandError("--feedback and --open-loop: give one of them")
    return not options.open_loop
