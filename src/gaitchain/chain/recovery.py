"""How far to step after a disturbance, learned from disturbed walks in physics. Ours.

What was measured at the end of a step makes the walk restless; the more restless, the
smaller the next step may have to be. Each walk that is learned from has its own sizes
of steps, drawn at random. From how often the walks fell follows what a size does at
each level of unrest, and from that which sizes cost least, falls and lost way together.
Most walks have sizes that the earlier ones leave likely to cost least.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import ClassVar, NamedTuple

import numpy as np

from gaitchain.chain.layered_chain import FloatArray
from gaitchain.chain.logistic import Fitted, fit_logistic, logistic

ERRORS = (0.08, 0.15)
"""What a step is off beyond its usual at which the next level begins: its DCM error, or
how far the next foot lands aside as the support foot turned on the ground [legs]. A
robot whose own steps differ by more has larger ones, see `errors_of`."""
SIZES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Sizes of a step, parts of the command range."""
# Sizes that a walk may have at its levels, by their numbers; the largest ones first.
_LADDERS = np.array(
    list(combinations_with_replacement(range(len(SIZES))[::-1], len(ERRORS)))
)
AHEAD = 0.5
"""Legs to the next foot, which a support foot that turned on the ground puts aside."""
CALM = 0.0
"""The unrest of a walk that nothing has disturbed."""
_DECAY = 0.25  # levels of unrest that a quiet step takes off
_MORE = 0.015  # legs by which what is usual of a robot rises in a step, at least
_FIRST = 0.5  # of the most: the same in the first step
_LOWERS = 0.75 / 0.25  # times slower it falls: so three of four steps stay below it
_FALL_STEPS = 120.0  # a fall costs as much as so many steps in place
# Spreads of the log odds: of a fall, of what sizes do at any level, and at one of them.
_KNOWN, _UNKNOWN, _ALIKE = 10.0, 1.0, 0.3


def errors_of(spread: float) -> tuple[float, ...]:
    """Return at which errors the levels of a robot begin: `ERRORS`, or in proportion.

    What its steps differ by without a disturbance is none: the first level begins
    there, if that is beyond the first of `ERRORS`.

    Args:
        spread: what nine of ten steps of robots with usual faults are off less, beyond
            their own [legs].
    """
    scale = max(spread / ERRORS[0], 1.0)
    return tuple(scale * error for error in ERRORS)


def unrest_after(unrest: float, off: float, errors: tuple[float, ...]) -> float:
    """Return the level of unrest after a step, 0 to 2.

    It rises to the level of the error at once, and falls by a quarter a step.

    Args:
        unrest: before the step.
        off: what the step was off beyond its usual, as `ERRORS` [legs].
        errors: at which the levels begin, see `errors_of` [legs].
    """
    level = float(np.searchsorted(errors, off, "right"))
    return max(level, unrest - _DECAY, CALM)


def own_after(own: float, off: float, most: float, made: int) -> float:
    """Return the 75th percentile of what a robot's steps are off, after another step.

    The estimate follows the robot's own steps, so that a robot with faults is not taken
    for a disturbed one; up by a part of what is usual of such robots, down by a third.
    The first steps count more: half of it, a quarter, ... [Robbins51],

        own <- own + (d if off > own else -d / 3), within 0 and most,
        d = max(0.015, most / (2 made))                                           (1)

    Args:
        own: before the step [legs]; 0 at the start of a walk.
        off: what the step was off beyond its usual of sound robots [legs].
        most: the same of nearly all steps of robots with usual faults [legs].
        made: number of steps since the start, with this one.
    """
    more = max(_MORE, _FIRST * most / made)
    return min(max(own + (more if off > own else -more / _LOWERS), 0.0), most)


class Option(NamedTuple):
    """A size that the next step may have."""

    size: float
    """Part of the command range."""
    cost: float
    """Expected cost of a step where all are so chosen; 1 is a fall."""


@dataclass(frozen=True, eq=False)
class Recovery:
    """What the sizes of steps cost at each level of unrest."""

    SHAPE: ClassVar = (len(ERRORS), len(SIZES))

    cost: FloatArray
    """`SHAPE`: expected cost of a step in a disturbed world, if this size is chosen at
    this level and the best one at the others, none larger at a higher level; 1 is a
    fall."""
    error: float
    """Standard error of the least cost, that of its chance to fall."""

    def __post_init__(self) -> None:
        """Check the costs.

        Raises:
            ValueError: their shape is another one, a cost or the error is not a number,
                or the error is negative.
        """
        if self.cost.shape != self.SHAPE or not np.isfinite(self.cost).all():
            raise ValueError(
                f"costs of recovery have shape {self.cost.shape}, need {self.SHAPE} "
                "finite ones"
            )
        if not 0.0 <= self.error < np.inf:
            raise ValueError(
                f"the error of the costs of recovery is {self.error:g}, needs a number "
                "that is not negative"
            )

    def options(self, unrest: float, most: float) -> list[Option]:
        """Return the choices of a disturbed walk, the best one first.

        That is the largest size whose cost is within one standard error of the least
        one: what the walks cannot tell apart is decided for the command. The others
        follow by their cost. The rule is that of [Breiman84].

        Args:
            unrest: above `CALM`, see `unrest_after`.
            most: size of the step that the command asks for.

        Returns:
            All `SIZES` below `most`, and `most` itself.
        """
        sizes = [size for size in SIZES if size < most] + [most]
        costs = np.interp(sizes, SIZES, self.cost[row_of(unrest)]).tolist()
        found = [Option(*pair) for pair in zip(sizes, costs, strict=True)]
        least = min(costs)
        best = max(option for option in found if option.cost <= least + self.error)
        found.sort(key=lambda option: (option is not best, option.cost, -option.size))
        return found

    def describe(self) -> tuple[str, str]:
        """Describe the best sizes for a person."""
        levels = np.arange(len(ERRORS)) + 1.0
        best = (self.options(level, SIZES[-1])[0].size for level in levels.tolist())
        small, large = (f"{100.0 * size:.0f} %" for size in best)
        return (
            "after a disturbance",
            f"steps of {small} of the range, after a large one {large}",
        )


def row_of(unrest: float) -> int:
    """Return the row of `Recovery.cost` for a level of unrest above `CALM`."""
    return int(np.ceil(unrest)) - 1


class Lessons(NamedTuple):
    """Disturbed walks, one row each."""

    sizes: FloatArray
    """(W, levels) largest size of the steps at each level, part of the range."""
    steps: FloatArray
    """(W,) number of steps."""
    lost: FloatArray
    """(W,) mean over the steps of what is missing to the size that was asked for."""
    fell: FloatArray
    """(W,) 1 where the robot fell, else 0."""


def draw_sizes(
    count: int, rng: np.random.Generator, walks: Lessons | None = None
) -> FloatArray:
    """Draw the sizes of walks to learn from.

    At random, or, where earlier walks are known, those of least cost by odds drawn from
    what these leave possible (Thompson sampling): likely choices are told apart, not
    those that are never taken.

    Args:
        count: number of walks.
        rng: source of randomness.
        walks: the earlier ones.

    Returns:
        (count, levels) sizes, none larger at a higher level.
    """
    if walks is None:
        drawn = rng.choice(SIZES, (count, len(ERRORS)))
        return np.asarray(np.sort(drawn)[:, ::-1])
    learned, ladders = _learn(walks), np.array(SIZES)[_LADDERS]
    costs = learned.costs(ladders, learned.odds.drawn(count, rng))
    return np.asarray(ladders[costs.argmin(axis=0)])


def learn_recovery(walks: Lessons) -> Recovery:
    """Learn what the sizes of steps cost, from walks that had different ones.

    With x_l = 1 - size at level l, the odds of a fall in a step are those of a walk
    that goes on as commanded times exp(-sum_l b_l x_l); what is lost is sum_l g_l x_l.
    The b_l are alike beforehand: a few hundred walks tell what small steps are worth,
    but not well at which level. The cost of a step is p_fall + lost / N, a fall as bad
    as N = 120 steps in place. Its error is that of p_fall; what is lost is known far
    better.

    Args:
        walks: what happened.

    Returns:
        The costs, and the error of the least one.
    """
    learned, ladders = _learn(walks), np.array(SIZES)[_LADDERS]
    costs = learned.costs(ladders, learned.odds.weights[None])[:, 0]
    found = np.full(Recovery.SHAPE, np.inf)
    levels = np.arange(len(ERRORS))
    for taken, cost in zip(_LADDERS, costs, strict=True):
        found[levels, taken] = np.minimum(found[levels, taken], cost)
    best = ladders[costs.argmin()]
    return Recovery(found, learned.odds.error_of_chance(_features(best)))


class _Learned(NamedTuple):
    """What disturbed walks tell."""

    odds: Fitted
    """Of a fall in a step, by `_features`."""
    lost: FloatArray
    """(levels,) what is lost where a level's steps are in place."""

    def costs(self, sizes: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the costs of (N, levels) sizes, by (M, F) weights, (N, M)."""
        lost = (1.0 - sizes) @ self.lost
        return logistic(_features(sizes) @ weights.T) + lost[:, None] / _FALL_STEPS


def _learn(walks: Lessons) -> _Learned:
    held_back = 1.0 - walks.sizes
    spread = np.array([_KNOWN, _UNKNOWN] + [_ALIKE] * len(ERRORS))
    odds = fit_logistic(_features(walks.sizes), walks.fell, walks.steps, spread)
    lost = np.linalg.lstsq(held_back, walks.lost, rcond=None)[0]
    return _Learned(odds, np.asarray(lost, dtype=float))


def _features(sizes: FloatArray) -> FloatArray:
    """Return what the odds depend on: of any walk, of all levels, of each level."""
    back = 1.0 - sizes
    together = back.sum(axis=-1, keepdims=True)
    return np.concatenate([np.ones_like(together), together, back], axis=-1)
