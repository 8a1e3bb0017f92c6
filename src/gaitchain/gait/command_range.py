"""The commands that a library can carry out, and how their components share the range.

The rule: divide each component by its limit in that direction; the absolute values of
these parts add up to at most 1. So the allowed commands fill a cross polytope. The rule
is implemented here only: clients of the service send and receive parts. How low the
hips can go besides depends on the speed ahead alone.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Command

AXES = {"vx": "m/s ahead", "vy": "m/s to the left", "yaw_rate": "rad/s to the left"}
"""Components of a command with their units."""
SHARED = "Parts of the most ahead, aside and around add up to at most 1."
"""The rule above, for a person."""
_ROUND = 0.005  # m/s, rad/s: tolerance of `check`, as the ends of a range are measured
_ROUND_SHARE = 0.02  # the same tolerance for the sum of the parts
_SLACK = 1.0 + 1e-9


@dataclass(frozen=True)
class CommandRange:
    """Least and greatest value of each command component while the others are 0."""

    vx: tuple[float, float]
    """[m/s]"""
    vy: tuple[float, float] = (0.0, 0.0)
    """[m/s]"""
    yaw_rate: tuple[float, float] = (0.0, 0.0)
    """[rad/s]"""
    crouch: tuple[float, float] = (0.0, 0.0)
    """Most beside a walk in place, and beside the fastest one ahead or back [m]."""

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """(least, greatest) value of vx, vy and yaw rate."""
        return self.vx, self.vy, self.yaw_rate

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """The same, widened to include 0, as a stop is always allowed."""
        return tuple((min(low, 0.0), max(high, 0.0)) for low, high in self.ends)

    @property
    def both_ways(self) -> tuple[bool, ...]:
        """Whether each of vx, vy and yaw rate goes both ways."""
        return tuple(low < 0.0 < high for low, high in self.ends)

    def within(self, other: "CommandRange") -> "CommandRange":
        """Return the speeds that are in both ranges, with the crouch of this one."""
        pairs = zip(self.ends, other.ends, strict=True)
        return self._with_ends(
            (max(own[0], lim[0]), min(own[1], lim[1])) for own, lim in pairs
        )

    def _with_ends(self, ends: Iterable[tuple[float, float]]) -> "CommandRange":
        return replace(CommandRange(*ends), crouch=self.crouch)

    def parts(self, command: Command) -> tuple[float, float, float]:
        """Return each component as a signed part of its limit in that direction.

        A part is infinite where the range allows no motion in that direction.
        """
        vx, vy, yaw_rate = map(_part, command.motion, self.ends)
        return vx, vy, yaw_rate

    def share(self, command: Command) -> float:
        """Return the share of the range that a command uses; 1 is the limit.

        share = sum over the axes of |part|; infinite where the range allows no motion
        in that direction, or a component is NaN.
        """
        total = sum(map(abs, self.parts(command)))
        return math.inf if math.isnan(total) else total

    def beside(self, command: Command) -> "CommandRange":
        """Return what remains of each component's range beside a command.

        Each end times 1 - share; all are 0 where the command takes the whole range.
        """
        rest = max(1.0 - self.share(command), 0.0)
        return self._with_ends((rest * low, rest * high) for low, high in self.ends)

    def deepest(self, command: Command) -> float:
        """Return how low the hips can go beside the speeds of a command [m]."""
        part = min(abs(self.parts(command)[0]), 1.0)
        slow, fast = self.crouch
        return slow + part * (fast - slow)

    def room(self, command: Command, crouch: float) -> float:
        """Return the part of a command's speeds for which hips are high enough.

        All of them where hips may be as low at any speed: slower steps change nothing.

        Args:
            command: within the range.
            crouch: hips below their usual height now [m].
        """
        slow, fast = self.crouch
        ahead = abs(self.parts(command)[0])
        if ahead == 0.0 or slow <= fast or crouch <= self.deepest(command):
            return 1.0
        return max((slow - crouch) / ((slow - fast) * ahead), 0.0)

    def steer(
        self, parts: Iterable[float], most: float = 1.0, crouch: float = 0.0
    ) -> Command:
        """Return the command for the position of a driver's control wheel.

        Args:
            parts: signed part of the limit of each axis; 0 is used for directions that
                the range does not have.
            most: limit of the share, in (0, 1]; a command above it is scaled down in
                its direction.
            crouch: part of the deepest crouch, in [0, 1]; at speed less may be left.
        """
        command = self._within_share(self.at(parts), most)
        return replace(command, crouch=crouch * self.crouch[0])

    def _within_share(self, command: Command, most: float) -> Command:
        """Scale a command of finite share down to at most the share `most`."""
        over = self.share(command) / most
        if over <= _SLACK:
            return command
        less = Command(*(value / over for value in command.motion))
        return replace(less, crouch=command.crouch)

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Scale a command into the range, keeping its direction; then its crouch.

        Returns:
            The clamped command, and a note if it differs.
        """
        done, note = self._clamp_motion(command)
        crouch, why = self._clamp_crouch(command.crouch, self.deepest(done))
        return replace(done, crouch=crouch), "; ".join(filter(None, (note, why)))

    def _clamp_crouch(self, asked: float, most: float) -> tuple[float, str]:
        if 0.0 <= asked <= most * _SLACK:
            return min(asked, most), ""
        if not asked > 0.0:  # also if NaN
            return 0.0, f"crouch {asked:g} m is not 0 or more: 0"
        if self.crouch[0] == 0.0:
            return 0.0, f"crouch {asked:g} m: this library does not crouch"
        return (
            most,
            f"crouch {asked:g} m: the legs leave {inward(most):.3f} m at this speed",
        )

    def _clamp_motion(self, command: Command) -> tuple[Command, str]:
        asked = command.motion
        if command.stops:  # where it asks for speed, that is no number, or too large
            return Command(), f"{asked} is no command: stop" if any(asked) else ""
        share = self.share(command)
        if share <= _SLACK:
            return command, ""
        if math.isinf(share):
            return Command(), f"{command}: no such way in this library: stop"
        done = self._within_share(command, 1.0)
        return done, (
            f"{command.vx:g}, {command.vy:g} m/s, {command.yaw_rate:g} rad/s is "
            f"{share:.3g} of what the library walks: {done.vx:.3f}, {done.vy:.3f}, "
            f"{done.yaw_rate:.3f}"
        )

    def at(self, parts: Iterable[float]) -> Command:
        """Return the command with the given signed parts of the limits."""
        values = []
        for part, (low, high) in zip(parts, self.limits, strict=True):
            values.append(part * (high if part > 0.0 else -low) + 0.0)  # no -0
        return Command(*values)

    def rounded_at(self, parts: Iterable[float]) -> Command:
        """Return `at(parts)` rounded towards 0 to 0.001, so that its text is exact."""
        values = []
        for value in self.at(map(float, parts)).motion:
            slack = math.copysign(1e-9, value)
            values.append(math.trunc(1000.0 * value + slack) / 1000.0 + 0.0)  # no -0
        return Command(*values)

    def draw(self, rng: np.random.Generator) -> Command:
        """Draw a command uniformly from the cross polytope of allowed commands.

        Where an axis does not include 0, it is as fast as its slowest walk or faster.
        """
        ranges = np.array(self.limits)
        width = ranges[:, 1] - ranges[:, 0]
        # The volume of an octant of the polytope is proportional to the product of its
        # limits, so the sign of each axis is drawn in proportion to them.
        ahead = rng.random(3) * width < ranges[:, 1]
        low, high = np.array(self.ends).T
        slowest = np.maximum(np.maximum(low, -high), 0.0)
        parts, known = np.zeros(3), width > 0.0
        least = slowest[known] / width[known]
        rest = 1.0 - least.sum()
        parts[known] = least + rest * rng.dirichlet(np.ones(known.sum() + 1))[:-1]
        return self.rounded_at(np.where(ahead, parts, -parts))

    def check_each(self, command: Command) -> None:
        """Refuse a component outside its own limits; their sum is not checked.

        Raises:
            CommandError: a component is outside its limits.
        """
        values = zip(command.motion, self.limits, self.ends, AXES.values(), strict=True)
        for value, (least, most), ends, unit in values:
            if not least <= value <= most:
                raise _refusal(value, *ends, unit)
        self._check_crouch(command.crouch)

    def _check_crouch(self, crouch: float) -> None:
        most = self.crouch[0]
        if crouch == 0.0 or 0.0 < crouch <= most + _ROUND * (most > 0.0):
            return
        can = f"goes 0 to {inward(most):.3f} m lower, less at speed"
        what = can if most else "does not crouch: give 0"
        raise CommandError(f"crouch {crouch:g} m: this library {what}")

    def _no_way(self, value: float, unit: str) -> CommandError:
        """Return the refusal of a direction that no tolerance adds to the range."""
        ends = zip(self.ends, AXES.values(), strict=True)
        ways = [ends_text(*end, axis) for end, axis in ends if any(end)]
        known = ", ".join(ways) or "in no direction"
        return CommandError(f"{value:g} {unit}: this library walks {known}, and 0")

    def check(self, command: Command) -> None:
        """Refuse a command outside the range, with a tolerance for rounded values.

        Raises:
            CommandError: a component is outside the range, or their share above 1.
        """
        for name, unit in AXES.items():
            value, (low, high) = getattr(command, name), getattr(self, name)
            if math.isinf(_part(value, (low, high))) and math.isfinite(value):
                raise self._no_way(value, unit)
            if value != 0.0 and not low - _ROUND <= value <= high + _ROUND:
                raise _refusal(value, low, high, unit)
        self._check_crouch(command.crouch)
        widened = self._with_ends(
            (low - _ROUND, high + _ROUND) for low, high in self.ends
        )
        asked = widened.share(command)
        if asked > 1.0 + _ROUND_SHARE:
            less = (math.trunc(1e3 * v / asked) / 1e3 for v in command.motion)
            given = command_text(replace(Command(*less), crouch=command.crouch))
            raise CommandError(
                f"{command_text(command)} asks for {asked:.2f} of what this library "
                f"can do at once, at most 1: give {given} or less"
            )


def _part(value: float, ends: tuple[float, float]) -> float:
    if value == 0.0:
        return 0.0
    most = ends[1] if value > 0.0 else -ends[0]
    return value / most if most > 0.0 else math.copysign(math.inf, value)


def _refusal(value: float, low: float, high: float, unit: str) -> CommandError:
    walked = ends_text(low, high, unit)
    return CommandError(f"{value:g} {unit}: this library walks {walked}, and 0")


def ends_text(low: float, high: float, unit: str) -> str:
    """Return an axis' ends, rounded inward, so that they are valid commands."""
    return f"{-inward(-low) + 0.0:.3f} to {inward(high):.3f} {unit}"


def inward(most: float) -> float:
    """Return an upper limit with three digits, so that it is accepted itself."""
    return math.floor(1000.0 * most + 1e-6) / 1000.0


def command_text(command: Command) -> str:
    """Format a command as in a schedule, with all digits."""
    numbers = *command.motion, *((command.crouch,) if command.crouch else ())
    return ",".join(map(digits, numbers))


def digits(value: float) -> str:
    """Format a number in the shortest form that parses to the same value."""
    return repr(float(value) + 0.0).removesuffix(".0")
