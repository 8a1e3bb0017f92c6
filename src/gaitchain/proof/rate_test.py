"""A sequential test of a rate of falls per step, which stops once it is sure. Ours.

Walks are independent of each other, their steps are not. Walk i has N_i steps and
Y_i = 0 or 1 falls; the rate is r = E[Y] / E[N]. Against the bound b, with Z = Y - b N,

    K(l) = prod_i (1 - l Z_i)        0 <= l <= 1                                   (1)
    L(m) = prod_i (1 + m Z_i)        0 <= m <= 1 / (b max N)                       (2)

are what a gambler has of 1 who bets that robots fall less often, or more often, than b.
Where the rate is b or more, K is not expected to grow, and exceeds 1 / a with a
probability of at most a, at whatever time one looks [Ville39]; likewise L where it is b
or less. So the test may look after every walk, and stop. A mean of several bets is a
bet, too. The rates that the bets leave possible are an interval that holds at any time
[Waudby24].

A walk in a world that was chosen is no draw, and no bet is fair on it. If it falls, K
may still be multiplied by 1 - l, the least that any walk leaves: K then grows even less
where the rate is b or more, however the world was chosen.
"""

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array

Verdict = Literal["below", "above", "open"]
"""Of a rate: below the bound, above it, or not known yet."""
# Bets that robots fall less often. The largest wins most where nobody falls, and loses
# nearly all by one fall; what the best one is depends on the true rate over the bound.
_LESS = np.array([0.97, 0.8, 0.5, 0.25, 0.1, 0.05])
_LESS_LOG = np.log([0.5, 0.1, 0.1, 0.1, 0.1, 0.1])
_MORE = np.array([0.05, 0.2, 1.0, 3.0, 10.0, 30.0])  # bets that they fall more often
_MORE_LOG = np.full(len(_MORE), -math.log(len(_MORE)))
_LOG = np.stack([_LESS_LOG, _MORE_LOG])
_RUIN = 0.5  # of a bet (2): the most that a walk without a fall may cost
_FINE = 60  # halvings of the interval in which an end is looked for
_TINY = 1e-300  # in place of a rate of 0


class RateTest:
    """The test of one bound, walk by walk."""

    def __init__(self, bound: float, longest: int, confidence: float = 0.95) -> None:
        """Begin without a walk.

        Args:
            bound: b, falls per step.
            longest: most steps of a walk, max N.
            confidence: 1 - a, of either verdict.

        Raises:
            CommandError: the bound or the confidence is not between 0 and 1, or a walk
                would count as a fall by its length alone.
        """
        _check("bound", bound)
        _check("confidence", confidence)
        fault = length_fault(bound, longest)
        if fault:
            raise CommandError(f"{fault}; take shorter walks or a smaller bound")
        self._need = -math.log(1.0 - confidence)
        self._bound = bound
        self._bets = np.stack([-_LESS, _within(_MORE, bound, longest)])
        self._logs = np.zeros(self._bets.shape)

    def add(self, steps: int, *, fell: bool) -> Verdict:
        """Count a walk; return what is known after it."""
        off = float(fell) - self._bound * steps
        self._logs += np.log1p(self._bets * off)
        return self.verdict

    def count_against(self) -> Verdict:
        """Count a fall in a walk that was no draw: against "below", and for nothing."""
        self._logs[0] += np.log1p(self._bets[0])
        return self.verdict

    @property
    def verdict(self) -> Verdict:
        """What is known."""
        less, more = self._wealths
        if less >= self._need:
            return "below"
        return "above" if more >= self._need else "open"

    @property
    def sureness(self) -> float:
        """How near to a verdict the test is, 0 to 1, in the logarithm of the wealth."""
        return min(max(max(self._wealths) / self._need, 0.0), 1.0)

    @property
    def _wealths(self) -> list[float]:
        """The logarithm of what each of the two has."""
        wealths: list[float] = np.logaddexp.reduce(self._logs + _LOG, axis=1).tolist()
        return wealths


def steps_needed(bound: float, confidence: float = 0.95, length: int = 1) -> int:
    """Return how many steps without a fall show that a rate is below a bound.

    The largest bet (1) is enough for that; from 95 % confidence on the others spare a
    twentieth of the steps at most. It wins log(1 + l b N) by a walk of N steps, which
    is less than N times what one of a single step wins: longer walks take more steps.

    Args:
        bound: b, falls per step.
        confidence: of the verdict.
        length: N, steps of each walk.
    """
    need = -math.log(1.0 - confidence) - float(_LESS_LOG[0])
    return math.ceil(need / math.log1p(float(_LESS[0]) * bound * length)) * length


def fewest_steps(bound: float, confidence: float = 0.95) -> int:
    """Return the fewest steps, without a fall, by which any walks show the same.

    Those of walks of one step, by all bets.

    Args:
        bound: b, falls per step.
        confidence: of the verdict.
    """
    need, wins = -math.log(1.0 - confidence), np.log1p(_LESS * bound)
    enough = range(steps_needed(bound, confidence))
    return bisect_left(enough, need, key=lambda n: _wealth(n * wins, _LESS_LOG))


def length_fault(bound: float, longest: int) -> str:
    """Say why walks are too long for the test of a bound; empty if they are not.

    One of 1 / bound steps would count as a fall by its length alone.

    Args:
        bound: b, falls per step.
        longest: most steps of a walk, max N.
    """
    if bound * longest < 1.0:
        return ""
    return (
        f"bound {bound:g} and walks of up to {longest} steps: a walk may have less "
        f"than 1 / bound, {1.0 / bound:.0f} steps"
    )


def rate_interval(
    walks: Iterable[tuple[int, bool, int]], longest: int, confidence: float = 0.95
) -> tuple[float, float]:
    """Return the rates that walks leave possible, by (1) and (2); (0, 1) without walks.

    Each end is wrong with a probability of at most 1 - confidence, at whatever time one
    looks.

    Args:
        walks: (steps, whether they ended in a fall, number) of those that are alike.
        longest: most steps of a walk, max N.
        confidence: of each end.
    """
    found: Array = np.array(list(walks), dtype=np.float64).reshape(-1, 3)
    lengths, fell, counts = found.T
    if not counts.any():
        return 0.0, 1.0
    need = -math.log(1.0 - confidence)

    def rarer(rate: float) -> bool:
        """Whether the walks refute that robots fall so often."""
        off = fell - rate * lengths
        logs = np.log1p(-np.outer(_LESS, off)) @ counts
        return _wealth(logs, _LESS_LOG) >= need

    def not_oftener(rate: float) -> bool:
        """Whether the walks do not refute that they fall so seldom."""
        off = fell - rate * lengths
        bets = _within(_MORE, rate, longest)
        return _wealth(np.log1p(np.outer(bets, off)) @ counts, _MORE_LOG) < need

    low = _first_rate(not_oftener)[0] if fell.any() else 0.0
    return low, _first_rate(rarer)[1]


def _check(name: str, value: float) -> None:
    if not 0.0 < value < 1.0:
        raise CommandError(f"{name} is {value:g}, must be between 0 and 1")


def _within(bets: Array, bound: float, longest: float) -> Array:
    """Limit the bets (2), so that no walk can ruin who makes them."""
    return np.minimum(bets, _RUIN / max(bound * longest, _TINY))


def _wealth(logs: Array, parts: Array) -> float:
    """Return the logarithm of a mean of bets, from their logarithms."""
    return float(np.logaddexp.reduce(logs + parts))


def _first_rate(holds: Callable[[float], bool]) -> tuple[float, float]:
    """Return rates between which the least is for which holds what then holds on."""
    low, high = 0.0, 1.0
    for _ in range(_FINE):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return low, high
