"""What a make of servos has of its own: packets, tables, units, and what to say of it.

Everything else, from searching the bus to calibration and walking, is common to all.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import ClassVar, NamedTuple

from gaitchain.backends.servos.table import Block, Model
from gaitchain.backends.servos.wire import Wire

Writes = list[tuple[Block, dict[int, bytes]]]
"""Blocks to write, one after the other, each with data by id."""
ON, OFF = b"\1", b"\0"
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

    def watchdog_time_s(self, wanted_s: float) -> float:
        """Return the time nearest to a wanted one that the watchdog can have [s]."""
        return wanted_s

    @abstractmethod
    def holding(
        self, goals: Mapping[int, int], limits: Mapping[int, float], watchdog_s: float
    ) -> Writes:
        """Return what makes servos hold a position; the torque comes last.

        Args:
            goals: positions by id [counts].
            limits: torque limits by id [%].
            watchdog_s: time without packets after which they stop, if they can [s].
        """

    def goal_data(self, count: int) -> bytes:
        """Return the data of a goal [counts]."""
        return count.to_bytes(self.goal.size, "little", signed=True)

    def error_words(self, bits: int) -> list[str]:
        """Return the names of the errors in a hardware error status."""
        return [words for bit, words in self.errors.items() if bits >> bit & 1]


def make_named(name: str) -> Make:
    """Return a make by the name that a calibration gives, imported when asked for."""
    found: Make = import_module(f"gaitchain.backends.{name}.make").MAKE
    return found
