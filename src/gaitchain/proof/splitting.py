"""Rare events by adaptive multilevel splitting, of any process in slices. Ours.

N paths are walked. Those whose highest level is among the K lowest are dropped, and as
many take their place, which follow one of the others up to the slice in which it first
got beyond that level Z, and have new chances from there on [Cerou07]. With K_i the
paths dropped in round i (more than K where several have level Z), and M that have had
the event at the end,

    p = prod_i (1 - K_i / N) M / N                                                 (1)

has the chance of the event as its mean, whatever the level is [Brehier16]; a poor one
makes p spread. So independent repetitions are averaged, and tell how well p is known.

A path is nothing but a seed for each of its slices. It is walked from its beginning,
which takes longer than a copy of a simulator's state would, but needs none, so that
nothing that a state hides can be forgotten.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from gaitchain.errors import CommandError

Seeds = tuple[int, ...]
"""One for each slice of a path."""
EVENT = 1.0
"""Level of a path that has had the event; others have less."""
_FEWEST = 4  # paths, and 2 repetitions
_SEEDS = 2**62


class Path(NamedTuple):
    """One path."""

    seeds: Seeds
    levels: tuple[float, ...]
    """Highest level in each slice, up to the event."""

    @property
    def top(self) -> float:
        """Highest level."""
        return min(max(self.levels), EVENT)


class SplitRun(NamedTuple):
    """One repetition."""

    chance: float
    """Of the event, p of (1)."""
    paths: int
    """That were walked."""
    first: int
    """Of them without splitting."""
    met: int
    """Of these first ones with the event: what brute force sees."""


@dataclass(frozen=True)
class Chance:
    """A chance, and the interval in which it is."""

    mean: float
    low: float
    high: float


WalkAll = Callable[[Sequence[Seeds]], Iterable[Sequence[float]]]
"""Walks paths; gives the highest level in each slice of each, up to the event."""


def split(
    walk_all: WalkAll,
    slices: int,
    paths: int,
    rng: np.random.Generator,
    dropped: float = 0.5,
) -> SplitRun:
    """Estimate the chance of an event once.

    Args:
        walk_all: walks paths; a path is determined by its seeds, and the first k of its
            levels by the first k of its seeds.
        slices: of a path.
        paths: N, 4 or more.
        rng: source of all seeds.
        dropped: K / N.

    Raises:
        CommandError: there are too few paths.
    """
    if paths < _FEWEST:
        raise CommandError(f"splitting with {paths} paths: takes {_FEWEST} or more")
    drop = min(max(round(dropped * paths), 1), paths - 1)
    now = _walk(walk_all, [_draw(rng, slices) for _ in range(paths)])
    walked, met, chance = paths, sum(path.top >= EVENT for path in now), 1.0
    while True:
        level = sorted(path.top for path in now)[drop - 1]
        kept = [path for path in now if path.top > level]
        if level >= EVENT or not kept:
            reached = sum(path.top >= EVENT for path in now)
            return SplitRun(chance * reached / paths, walked, paths, met)
        new = [_branch(kept, level, slices, rng) for _ in range(paths - len(kept))]
        chance *= len(kept) / paths
        walked += len(new)
        now = kept + _walk(walk_all, new)


def mean_chance(runs: Sequence[SplitRun], confidence: float = 0.95) -> Chance:
    """Combine repetitions; the interval is that of the mean of log-normal ones.

    With logarithms of mean m and variance s^2 that mean is exp(m + s^2 / 2), known to
    t sqrt(s^2 / n + s^4 / 2 (n - 1)) in its logarithm [Zhou97]. It is approximate. A
    repetition without the event has no logarithm; with some of these the interval is
    that of the logarithm of the mean and too narrow, so take more paths. Repetitions
    that are all alike, such as those where no path, or every one, has met the event,
    say nothing of their spread: then it is what their first paths leave possible
    [Clopper34].

    Args:
        runs: two or more repetitions, independent of each other.
        confidence: of the interval.
    """
    found = np.array([run.chance for run in runs])
    mean = float(found.mean())
    if np.ptp(found) == 0.0:
        met, first = sum(run.met for run in runs), sum(run.first for run in runs)
        _, low, high = brute_force(met, first, confidence)
        return Chance(mean, min(low, mean), max(high, mean))
    count = len(found)
    if found.all():
        logs = np.log(found)
        spread = float(logs.var(ddof=1))
        middle = float(logs.mean()) + 0.5 * spread
        error = math.sqrt(spread / count + 0.5 * spread**2 / (count - 1))
    else:
        middle = math.log(mean)
        error = float(found.std(ddof=1)) / (math.sqrt(count) * mean)
    far = float(scipy.stats.t.ppf(0.5 + 0.5 * confidence, count - 1)) * error
    low, high = math.exp(middle - far), min(math.exp(middle + far), 1.0)
    return Chance(mean, min(low, mean), max(high, mean))


def brute_force(
    met: int, paths: int, confidence: float = 0.95
) -> tuple[float, float, float]:
    """Return the part of paths with the event, and its exact interval [Clopper34]."""
    out = 0.5 - 0.5 * confidence
    beta, missed = scipy.stats.beta, paths - met
    low = float(beta.ppf(out, met, missed + 1)) if met else 0.0
    high = float(beta.ppf(1.0 - out, met + 1, missed)) if missed else 1.0
    return met / paths, low, high


def count_events(
    walk_all: WalkAll, slices: int, paths: int, rng: np.random.Generator
) -> int:
    """Walk paths without splitting; return how many have the event.

    Args:
        walk_all: walks paths, as for `split`.
        slices: of a path.
        paths: how many.
        rng: source of all seeds, not that of `split`.
    """
    drawn = [_draw(rng, slices) for _ in range(paths)]
    return sum(path.top >= EVENT for path in _walk(walk_all, drawn))


def overlap(one: Chance, other: Chance) -> bool:
    """Return whether some chance is in both intervals."""
    return one.low <= other.high and other.low <= one.high


def _draw(rng: np.random.Generator, count: int) -> Seeds:
    return tuple(rng.integers(_SEEDS, size=count).tolist())


def _walk(walk_all: WalkAll, seeds: Sequence[Seeds]) -> list[Path]:
    found = (tuple(levels) for levels in walk_all(seeds))
    return [Path(*pair) for pair in zip(seeds, found, strict=True)]


def _branch(
    kept: Sequence[Path], level: float, slices: int, rng: np.random.Generator
) -> Seeds:
    """Follow a path until it is beyond a level, and then another way."""
    path = kept[int(rng.integers(len(kept)))]
    shared = next(i for i, high in enumerate(path.levels) if high > level) + 1
    return path.seeds[:shared] + _draw(rng, slices - shared)
