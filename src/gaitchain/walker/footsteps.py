"""Footsteps: given landings of the feet, one after another, checked before they begin.

Ours. A foot's place is that of its ankle on the floor, in the frame of `Walker.place`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.gait.step_target import Landing
from gaitchain.walker.place import Place, check_place
from gaitchain.walker.stride_generator import StrideGenerator

_SIDES = {1.0: "left", -1.0: "right"}


class Footstep(NamedTuple):
    """Where a foot is to land."""

    left: bool
    """Whether it is the left foot."""
    x: float
    """[m]"""
    y: float
    """[m]"""
    yaw: float = 0.0
    """To the left [rad]."""

    @property
    def side(self) -> float:
        """+1 for the left foot, else -1."""
        return 1.0 if self.left else -1.0

    @property
    def place(self) -> Place:
        """Place on the floor."""
        return Place(self.x, self.y, self.yaw)


def landing_from(support: Place, step: Footstep, stance: float) -> Landing:
    """Return a footstep as a landing seen from the support foot.

    Args:
        support: place of the other foot.
        step: where the foot is to land.
        stance: distance of the ankles side by side [m].
    """
    x, y, yaw = step.place.seen_from(support)
    return Landing(x, step.side * y - stance, step.side * yaw)


def check_footsteps(
    generator: StrideGenerator,
    feet: Mapping[float, Place],
    steps: Sequence[Footstep],
    stance: float,
) -> None:
    """Make sure that the chain can make all footsteps, and stand after them.

    Args:
        generator: selects the strides.
        feet: places of the standing feet, by side.
        steps: the footsteps, first to last.
        stance: distance of the ankles side by side [m].

    Raises:
        CommandError: one is no footstep, or not by the other foot than the one before,
            or no stride that physics passed lands there after the step before; the
            message names the step, and the nearest landing.
    """
    _check_kinds(steps)
    if not steps:
        raise CommandError("no footstep to follow; give at least one")
    # All at once, in a fifth of the time: API and loop do nothing else meanwhile.
    supports = [feet[-steps[0].side], *(step.place for step in steps)]
    landings = [landing_from(*at, stance) for at in zip(supports, steps, strict=False)]
    found = generator.nearest_in_turn(landings)
    for number, step in enumerate(steps, start=1):
        if number > 1 and step.left == steps[number - 2].left:
            foot = _SIDES[step.side]
            raise CommandError(
                f"footstep {number}: the {foot} foot again; feet land by turns"
            )
        wanted, made = landings[number - 1], next(found)
        if not generator.is_near(wanted, made):
            raise CommandError(_refusal(number, step, wanted, made))


def _check_kinds(steps: object) -> None:
    """Refuse what are no footsteps, or are further than a robot is sent."""
    if not isinstance(steps, Sequence):
        raise CommandError(f"footsteps {steps!r}: give a list of Footstep")
    for number, step in enumerate(steps, start=1):
        such = "give one such as Footstep(left=True, x=0.05, y=0.1)"
        if not isinstance(step, Footstep):
            raise CommandError(f"footstep {number}: {step!r} is none; {such}")
        if not isinstance(step.left, bool | np.bool_):
            raise CommandError(f"footstep {number}: left is {step.left!r}; {such}")
        check_place(step.place, f"footstep {number}")


def _refusal(number: int, step: Footstep, wanted: Landing, made: Landing) -> str:
    """Say what a step asks for and what could be made."""
    return (
        f"footstep {number}, the {_SIDES[step.side]} foot at {step.x:.3g}, "
        f"{step.y:.3g} m: it asks for {_tell(wanted)} of the other foot; after the "
        f"step before, the nearest that physics passed is {_tell(made)}"
    )


def _tell(landing: Landing) -> str:
    ahead, outward, turn = landing
    return (
        f"{ahead:.3f} m ahead, {outward:+.3f} m outward of the stance and "
        f"{turn:+.2f} rad outward"
    )
