"""What a library can be asked for, and how the parts of a command share it.

The rule: each number's part of its most in that direction; the parts add up to 1 at
most. Commands that a library can carry out fill a cross polytope.
"""

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Command

AXES = {"vx": "m/s ahead", "vy": "m/s to the left", "yaw_rate": "rad/s to the left"}
"""Numbers of a command with their units."""
_ROUND = 0.005  # m/s, rad/s: a range is measured; what rounds to its ends is inside
_ROUND_SHARE = 0.02  # the same, of the most at once
_SLACK = 1.0 + 1e-9


@dataclass(frozen=True)
class CommandRange:
    """Least and most of each number of a command, when it is the only one."""

    vx: tuple[float, float]
    """[m/s]"""
    vy: tuple[float, float] = (0.0, 0.0)
    """[m/s]"""
    yaw_rate: tuple[float, float] = (0.0, 0.0)
    """[rad/s]"""

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """Least and most of vx, vy and yaw rate."""
        return self.vx, self.vy, self.yaw_rate

    def within(self, other: "CommandRange") -> "CommandRange":
        """Return what both ranges allow."""
        pairs = zip(self.ends, other.ends, strict=True)
        return CommandRange(
            *((max(own[0], lim[0]), min(own[1], lim[1])) for own, lim in pairs)
        )

    def share(self, command: Command) -> float:
        """Return how much of the most at once a command asks for.

        share = sum over the axes of value / most in its direction; infinite where the
        range allows nothing that way.
        """
        total = 0.0
        for value, (low, high) in zip(astuple(command), self.ends, strict=True):
            most = high if value > 0.0 else -low
            if value != 0.0:
                known = most > 0.0 and not math.isnan(value)
                total += abs(value) / most if known else math.inf
        return total

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Bring a command into the range, keeping its direction.

        Returns:
            The command that can be carried out, and a note if it is another one.
        """
        asked = astuple(command)
        if command.stops:
            finite = all(map(math.isfinite, asked))
            return Command(), "" if finite else f"{asked} is no command: stop"
        share = self.share(command)
        if share <= _SLACK:
            return command, ""
        if math.isinf(share):
            return Command(), f"{command}: no such way in this library: stop"
        done = Command(*(value / share for value in asked))
        return done, (
            f"{command.vx:g}, {command.vy:g} m/s, {command.yaw_rate:g} rad/s is "
            f"{share:.2f} of what the library walks: {done.vx:.3f}, {done.vy:.3f}, "
            f"{done.yaw_rate:.3f}"
        )

    def at(self, parts: Iterable[float]) -> Command:
        """Return the command that asks for signed parts of the most of each axis."""
        values = []
        for part, (low, high) in zip(parts, self.ends, strict=True):
            values.append(part * max(high if part > 0.0 else -low, 0.0))
        return Command(*values)

    def rounded_at(self, parts: Iterable[float]) -> Command:
        """Return the same in whole thousandths towards 0, so that its text is exact."""
        values = []
        for part, (low, high) in zip(map(float, parts), self.ends, strict=True):
            end = max(high, 0.0) if part > 0.0 else max(-low, 0.0)
            values.append(math.trunc(1000.0 * part * end + 1e-9) / 1000.0)
        return Command(*values)

    def draw(self, rng: np.random.Generator) -> Command:
        """Draw a command uniformly over all that the range allows at once."""
        ranges = np.array(self.ends)
        ranges = np.column_stack([ranges[:, 0].clip(max=0), ranges[:, 1].clip(min=0)])
        width = ranges[:, 1] - ranges[:, 0]
        # Each part of space between the axes has a volume like the product of its ends.
        ahead = rng.random(3) * width < ranges[:, 1]
        parts = np.zeros(3)
        known = width > 0.0
        parts[known] = rng.dirichlet(np.ones(known.sum() + 1))[:-1]
        return self.rounded_at(np.where(ahead, parts, -parts))

    def check(self, command: Command) -> None:
        """Refuse a command outside the range; what rounds to its ends is inside.

        Raises:
            CommandError: a number is outside the range, or the command asks for more
                than can be done at once.
        """
        for name, unit in AXES.items():
            value, (low, high) = getattr(command, name), getattr(self, name)
            if value != 0.0 and not low - _ROUND <= value <= high + _ROUND:
                raise CommandError(
                    f"{value:g} {unit}: this library walks {low:.3f} to "
                    f"{high:.3f} {unit}, and 0"
                )
        widened = CommandRange(
            *((low - _ROUND, high + _ROUND) for low, high in self.ends)
        )
        asked = widened.share(command)
        if asked > 1.0 + _ROUND_SHARE:
            less = (math.trunc(1e3 * v / asked) / 1e3 for v in astuple(command))
            raise CommandError(
                f"{command_text(command)} asks for {asked:.2f} of what this library "
                f"can do at once, at most 1: give {command_text(Command(*less))} or "
                "less"
            )


def command_text(command: Command) -> str:
    """Write a command as a schedule has it, every digit of it."""
    return ",".join(map(digits, astuple(command)))


def digits(value: float) -> str:
    """Write a number shortly, so that reading it gives the same."""
    return repr(float(value) + 0.0).removesuffix(".0")
