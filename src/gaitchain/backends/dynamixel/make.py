"""What a make of servos has of its own: packets, tables, units, and what to say of it.

Everything else, from searching the bus to calibration and walking, is common to all.
"""

import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import ClassVar, NamedTuple

from gaitchain.backends.dynamixel import control_table as table
from gaitchain.backends.dynamixel.control_table import Block, Model
from gaitchain.backends.dynamixel.wire import Protocol2, Wire

Writes = list[tuple[Block, dict[int, bytes]]]
"""Blocks to write, one after the other, each with data by id."""
_ON, OFF = b"\1", b"\0"
_DELAY_UNIT_S = 2e-6


class Settings(NamedTuple):
    """What a servo's table says of how it is set up."""

    mode: int
    return_delay_s: float
    temperature_limit: int
    """[deg C]"""
    lowest: int
    """Least accepted goal [counts]."""
    highest: int
    pwm_limit: float = 100.0
    """Largest part of the supply voltage that may be asked for [%]."""


class SetupBlocks(NamedTuple):
    """Where the table has what `Settings` says, within the block `setup`."""

    mode: Block
    return_delay: Block
    """[2 us]"""
    temperature_limit: Block
    lowest: Block
    highest: Block


class State(NamedTuple):
    """What a servo says of itself."""

    errors: int
    """Bits of its hardware errors."""
    torque: bool
    tripped: bool
    """Whether its watchdog has stopped it."""


class Make(ABC):
    """A make of servos with 4096 counts a turn."""

    name: str
    models: Mapping[int, Model]
    plain_model: str
    """That of emulated servos whose calibration names none."""
    wire: type[Wire]
    bauds: tuple[int, ...]
    """Rates that a bus may have, the usual ones first [bit/s]."""
    rad_s_per_count: float
    errors: Mapping[int, str]
    """Meaning of the bits of a hardware error status."""
    torque: Block
    setup: Block
    setup_blocks: SetupBlocks
    present: Block
    goal: Block
    state: Block
    supply: Block
    watchdog: Block | None
    """Time without packets after which a servo stops; None if it has no such."""
    position_mode: int
    modes: ClassVar[Mapping[int, str]]
    baud_register: str
    delay_register: str
    mode_register: str
    level_register: str
    obeys_not: str
    """Why a servo may not do as it is told."""
    examples: str
    """Models, for messages."""

    def settings(self, data: bytes) -> Settings:
        """Return what the block `setup` says."""
        found = (block.unsigned(data, self.setup) for block in self.setup_blocks)
        mode, return_delay, temperature_limit, lowest, highest = found
        delay_s = _DELAY_UNIT_S * return_delay
        return Settings(mode, delay_s, temperature_limit, lowest, highest)

    @abstractmethod
    def measured(self, data: bytes) -> tuple[int, int, int]:
        """Return current, velocity and position of the block `present` [counts]."""

    @abstractmethod
    def status(self, data: bytes) -> State:
        """Return what the block `state` says."""

    @abstractmethod
    def supply_state(self, data: bytes) -> tuple[float, float]:
        """Return temperature [deg C] and voltage [V] of the block `supply`."""

    @abstractmethod
    def holding(
        self, goals: Mapping[int, int], limits: Mapping[int, float], watchdog: int
    ) -> Writes:
        """Return what makes servos hold a position; the torque comes last.

        Args:
            goals: positions by id [counts].
            limits: torque limits by id [%].
            watchdog: time without packets after which they stop.
        """

    def goal_data(self, count: int) -> bytes:
        """Return the data of a goal [counts]."""
        return count.to_bytes(self.goal.size, "little", signed=True)

    def error_words(self, bits: int) -> list[str]:
        """Return the names of the errors in a hardware error status."""
        return [words for bit, words in self.errors.items() if bits >> bit & 1]


class Dynamixel(Make):
    """The X series of ROBOTIS, and MX servos with the firmware for protocol 2.0."""

    name, models, wire = "dynamixel", table.MODELS, Protocol2
    plain_model = "xm430-w350"
    bauds = (1_000_000, 57_600, 2_000_000, 3_000_000, 4_000_000, 115_200, 4_500_000)
    rad_s_per_count = table.RAD_S_PER_COUNT
    errors = table.HARDWARE_ERRORS
    torque, setup, present, goal = table.TORQUE, table.SETUP, table.PRESENT, table.GOAL
    setup_blocks = SetupBlocks(
        table.OPERATING_MODE,
        table.RETURN_DELAY,
        table.TEMPERATURE_LIMIT,
        table.LOWEST_POSITION,
        table.HIGHEST_POSITION,
    )
    state, supply, watchdog = table.STATE, table.SUPPLY, table.WATCHDOG
    position_mode = table.POSITION_MODE
    modes: ClassVar[Mapping[int, str]] = {
        **{0: "current", 1: "velocity", 4: "extended position"},
        **{5: "current-based position", 16: "PWM"},
    }
    baud_register, delay_register = "Baud Rate(8)", "Return Delay Time(9)"
    mode_register = "Operating Mode(11) to 3 (position) with DYNAMIXEL Wizard"
    level_register = "Status Return Level(68) to 2 with DYNAMIXEL Wizard"
    obeys_not = (
        "does not obey; overload, heat, supply, or outside its Position Limits(52, 48)?"
    )
    examples = "xm430-w350, xl330-m288, mx-64 with protocol 2.0"

    def settings(self, data: bytes) -> Settings:
        """Return what the block `setup` says."""
        limit = table.PWM_LIMIT.unsigned(data, table.SETUP)
        return super().settings(data)._replace(pwm_limit=100.0 * limit / table.FULL_PWM)

    def measured(self, data: bytes) -> tuple[int, int, int]:
        """Return current, velocity and position of the block `present` [counts]."""
        current, velocity, position = struct.unpack(table.PRESENT_FORMAT, data)
        return current, velocity, position

    def status(self, data: bytes) -> State:
        """Return what the block `state` says."""
        watchdog = table.WATCHDOG.unsigned(data, table.STATE)
        return State(
            errors=table.HARDWARE_ERROR.unsigned(data, table.STATE),
            torque=bool(table.TORQUE.unsigned(data, table.STATE)),
            tripped=watchdog == table.WATCHDOG_TRIPPED,
        )

    def supply_state(self, data: bytes) -> tuple[float, float]:
        """Return temperature [deg C] and voltage [V] of the block `supply`."""
        volts = 0.1 * table.VOLTAGE.unsigned(data, table.SUPPLY)
        return float(table.TEMPERATURE.unsigned(data, table.SUPPLY)), volts

    def holding(
        self, goals: Mapping[int, int], limits: Mapping[int, float], watchdog: int
    ) -> Writes:
        """Return what makes servos hold a position; the torque comes last."""
        as_fast_as_it_can = bytes(table.PROFILE.size)
        pwm = {n: round(part / 100.0 * table.FULL_PWM) for n, part in limits.items()}
        return [
            # A tripped watchdog refuses goals.
            (table.WATCHDOG, dict.fromkeys(goals, OFF)),
            (
                table.PROFILE_AND_GOAL,
                {n: as_fast_as_it_can + self.goal_data(c) for n, c in goals.items()},
            ),
            (table.GOAL_PWM, {n: v.to_bytes(2, "little") for n, v in pwm.items()}),
            (table.WATCHDOG, dict.fromkeys(goals, bytes([watchdog]))),
            (table.TORQUE, dict.fromkeys(goals, _ON)),
        ]


DYNAMIXEL = Dynamixel()


def make_named(name: str) -> Make:
    """Return a make by the name that a calibration gives.

    Others than this package's are imported when asked for, as they build on it.
    """
    if name == DYNAMIXEL.name:
        return DYNAMIXEL
    found: Make = import_module(f"gaitchain.backends.{name}.make").MAKE
    return found
