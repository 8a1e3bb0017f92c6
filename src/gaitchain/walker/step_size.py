"""The size of each step, by how far the steps before it were off their plan."""

from collections.abc import Sequence
from typing import Protocol

from gaitchain.chain.recovery import CALM, Option, unrest_after


class Choice(Protocol):
    """What chooses the size of a disturbed walk's next step, as `Recovery` does."""

    def options(self, unrest: float, most: float) -> Sequence[Option]:
        """Return the choices, the one to take first; see `Recovery.options`."""


class StepSize:
    """Choose the size of each step: all of the command unless the walk is disturbed."""

    def __init__(self, choice: Choice | None, errors: tuple[float, ...]) -> None:
        """Begin with a calm walk.

        Args:
            choice: what chooses; None always takes all of the command.
            errors: at which the levels of unrest begin, see `chain.recovery.errors_of`
                [legs].
        """
        self.choice, self.errors = choice, errors
        self.reset()

    def reset(self) -> None:
        """Forget what was measured."""
        self.unrest = CALM
        self.options: Sequence[Option] = ()
        """Choices of the latest step, the one taken first; empty for a calm walk."""

    def following(self, off: float, most: float) -> float:
        """Return the size of the next step, part of the command range.

        Args:
            off: what the last step was off beyond its usual [legs], see
                `errors`.
            most: size that the command asks for.
        """
        self.unrest = unrest_after(self.unrest, off, self.errors)
        self.options = ()
        if self.choice is not None and self.unrest > CALM:
            self.options = self.choice.options(self.unrest, most)
        return self.options[0].size if self.options else most
