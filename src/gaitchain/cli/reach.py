"""Print how far the commands of a library reach, alone and beside others."""

import math
from collections.abc import Iterator
from typing import Any

from gaitchain.cli.console import print_table, say
from gaitchain.gait.command_range import AXES, SHARED, CommandRange, inward
from gaitchain.messages import Command

_WAYS = (
    ("ahead", "back", "m/s"),
    ("left", "right", "m/s"),
    ("turn left", "right", "rad/s"),
)
_PARTS = {"half": 0.5, "all": 1.0}
_THIRD = 1.0 / 3.0


def show_reach(span: CommandRange) -> list[dict[str, Any]]:
    """Print and return what remains of each axis beside commands on the others."""
    known = [axis for axis, (low, high) in enumerate(span.limits) if low < high]
    rows, found = [], []
    for words, parts in _mixed(known):
        beside = span.at(parts)
        left, taken = span.beside(beside), beside.motion
        rows.append((words, *(_cell(taken[axis], left.ends[axis]) for axis in known)))
        found.append(_facts(beside, left))
    heads = ["{} / {}\n[{}]".format(*_WAYS[axis]) for axis in known]
    print_table("Reach of commands, beside others", ("beside", *heads), rows)
    if len(known) > 1:
        say(SHARED)
    return found


def _mixed(known: list[int]) -> Iterator[tuple[str, list[float]]]:
    """Yield commands beside which the others are shown: words, and parts of the most.

    Args:
        known: axes that the library walks.
    """
    yield "nothing", [0.0, 0.0, 0.0]
    if len(known) < 2:
        return
    for axis in known:
        for word, part in _PARTS.items():
            yield f"{word} {_WAYS[axis][0]}", [part * (a == axis) for a in range(3)]
    if len(known) == len(_WAYS):
        yield "a third each", [_THIRD, _THIRD, 0.0]


def _cell(taken: float, ends: tuple[float, float]) -> str:
    if taken:
        return f"at {_down(taken):.3f}"
    low, high = ends
    return f"{_down(max(high, 0.0)):.3f} / {_down(max(-low, 0.0)):.3f}"


def _facts(beside: Command, left: CommandRange) -> dict[str, Any]:
    taken = dict(zip(AXES, map(_down, beside.motion), strict=True))
    free = {n: e for n, e in zip(AXES, left.ends, strict=True) if not taken[n]}
    return {"beside": taken, **{n: [*map(_down, ends)] for n, ends in free.items()}}


def _down(value: float) -> float:
    """Round towards 0 to 0.001, so that the number is a valid command."""
    return math.copysign(inward(abs(value)), value) + 0.0  # no -0
