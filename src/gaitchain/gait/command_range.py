"""What a library can be asked for, and how the parts of a command share it.

The rule: each number's part of its most in that direction; the parts add up to 1 at
most. Commands that a library can carry out fill a cross polytope. Nobody else computes
it: clients of the service send parts, and get those of a command.
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

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Least and most that each number may have; a stop is among them."""
        return tuple((min(low, 0.0), max(high, 0.0)) for low, high in self.ends)

    def within(self, other: "CommandRange") -> "CommandRange":
        """Return what both ranges allow."""
        pairs = zip(self.ends, other.ends, strict=True)
        return CommandRange(
            *((max(own[0], lim[0]), min(own[1], lim[1])) for own, lim in pairs)
        )

    def parts(self, command: Command) -> tuple[float, float, float]:
        """Return each number as a signed part of the most in its direction.

        Infinite where the range allows nothing that way.
        """
        vx, vy, yaw_rate = map(_part, astuple(command), self.ends)
        return vx, vy, yaw_rate

    def share(self, command: Command) -> float:
        """Return how much of the most at once a command asks for.

        share = sum over the axes of |part|; infinite where the range allows nothing
        that way, or where a number is none.
        """
        total = sum(map(abs, self.parts(command)))
        return math.inf if math.isnan(total) else total

    def steer(self, parts: Iterable[float], most: float = 1.0) -> Command:
        """Return the command for a wheel that is pulled so far.

        Args:
            parts: of the most of each axis, signed; a way that the range does not have
                counts as 0.
            most: of the range that the axes share, in (0, 1]. What asks for more keeps
                its direction.
        """
        return self._within_share(self.at(parts), most)

    def _within_share(self, command: Command, most: float) -> Command:
        """Bring a command with a finite share down to the most that it may ask for."""
        over = self.share(command) / most
        if over <= _SLACK:
            return command
        return Command(*(value / over for value in astuple(command)))

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
        done = self._within_share(command, 1.0)
        return done, (
            f"{command.vx:g}, {command.vy:g} m/s, {command.yaw_rate:g} rad/s is "
            f"{share:.2f} of what the library walks: {done.vx:.3f}, {done.vy:.3f}, "
            f"{done.yaw_rate:.3f}"
        )

    def at(self, parts: Iterable[float]) -> Command:
        """Return the command that asks for signed parts of the most of each axis."""
        values = []
        for part, (low, high) in zip(parts, self.limits, strict=True):
            values.append(part * (high if part > 0.0 else -low) + 0.0)  # no -0
        return Command(*values)

    def rounded_at(self, parts: Iterable[float]) -> Command:
        """Return the same in whole thousandths towards 0, so that its text is exact."""
        values = []
        for value in astuple(self.at(map(float, parts))):
            values.append(math.trunc(1000.0 * value + 1e-9) / 1000.0)
        return Command(*values)

    def draw(self, rng: np.random.Generator) -> Command:
        """Draw a command uniformly over all that the range allows at once."""
        ranges = np.array(self.limits)
        width = ranges[:, 1] - ranges[:, 0]
        # Each part of space between the axes has a volume like the product of its ends.
        ahead = rng.random(3) * width < ranges[:, 1]
        parts = np.zeros(3)
        known = width > 0.0
        parts[known] = rng.dirichlet(np.ones(known.sum() + 1))[:-1]
        return self.rounded_at(np.where(ahead, parts, -parts))

    def check_each(self, command: Command) -> None:
        """Refuse a number that is beyond its limits alone; for what will be clamped.

        Raises:
            CommandError: a number is less than the least, or more than the most.
        """
        values = zip(
            astuple(command), self.limits, self.ends, AXES.values(), strict=True
        )
        for value, (least, most), ends, unit in values:
            if not least <= value <= most:
                raise _refusal(value, *ends, unit)

    def check(self, command: Command) -> None:
        """Refuse a command outside the range; what rounds to its ends is inside.

        Raises:
            CommandError: a number is outside the range, or the command asks for more
                than can be done at once.
        """
        for name, unit in AXES.items():
            value, (low, high) = getattr(command, name), getattr(self, name)
            if value != 0.0 and not low - _ROUND <= value <= high + _ROUND:
                raise _refusal(value, low, high, unit)
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


def _part(value: float, ends: tuple[float, float]) -> float:
    if value == 0.0:
        return 0.0
    most = ends[1] if value > 0.0 else -ends[0]
    return value / most if most > 0.0 else math.copysign(math.inf, value)


def _refusal(value: float, low: float, high: float, unit: str) -> CommandError:
    # Rounded inward, so that what is said may be asked for.
    least = math.ceil(1000.0 * low - 1e-6) / 1000.0
    most = math.floor(1000.0 * high + 1e-6) / 1000.0
    return CommandError(
        f"{value:g} {unit}: this library walks {least:.3f} to {most:.3f} {unit}, and 0"
    )


def command_text(command: Command) -> str:
    """Write a command as a schedule has it, every digit of it."""
    return ",".join(map(digits, astuple(command)))


def digits(value: float) -> str:
    """Write a number shortly, so that reading it gives the same."""
    return repr(float(value) + 0.0).removesuffix(".0")
