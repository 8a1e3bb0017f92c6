"""What a person sees beside a robot in commission: how it should move. Ours."""

from typing import Protocol

from gaitchain.messages import Array


class Screen(Protocol):
    """Shows the robot as it is asked to be, for comparison with the real one."""

    def show(self, target: Array) -> None:
        """Show targets of the joints (2 n,) [rad], once in each control period."""

    def point(self, joint: int, text: str) -> None:
        """Point at a joint by its number, and say what it should do."""

    def play(self, targets: Array, period_s: float, text: str) -> None:
        """Show a motion again and again, until something is cleared.

        Args:
            targets: (N, 2 n) of the joints [rad].
            period_s: from one to the next [s].
            text: what it is.
        """

    def clear(self) -> None:
        """Point at nothing, and play nothing any more."""


class NoScreen:
    """A screen that nobody looks at."""

    def show(self, target: Array) -> None:
        """Do nothing."""

    def point(self, joint: int, text: str) -> None:
        """Do nothing."""

    def play(self, targets: Array, period_s: float, text: str) -> None:
        """Do nothing."""

    def clear(self) -> None:
        """Do nothing."""
