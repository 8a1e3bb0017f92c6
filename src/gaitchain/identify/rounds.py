"""Rounds of a fit, each of which is kept as soon as it is done. Ours."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from gaitchain.build.jobs import run_once

_T = TypeVar("_T")


class Rounds:
    """Rounds that draw from one source, and end alike where the journal has some.

    A fit of a robot takes many minutes: an interrupt loses one round of it.
    """

    def __init__(self, rng: np.random.Generator, begin: Callable[[], None]) -> None:
        """Set what they draw from.

        Args:
            rng: source of randomness; a kept round leaves it as the round did.
            begin: called before each round.
        """
        self.rng, self.begin = rng, begin

    def run(self, work: Callable[[], _T], result: type[_T]) -> _T:
        """Do a round, unless the journal has what came of it.

        Args:
            work: the round.
            result: type of what comes of it.
        """
        self.begin()

        def anew() -> tuple[_T, dict[str, Any]]:
            return work(), dict(self.rng.bit_generator.state)

        kind: Any = tuple[result, dict[str, Any]]  # type: ignore[valid-type]
        done: tuple[_T, dict[str, Any]] = run_once("round", anew, kind)
        self.rng.bit_generator.state = done[1]
        return done[0]
