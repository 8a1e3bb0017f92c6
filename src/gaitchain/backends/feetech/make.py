"""Feetech's STS servos: what they have of their own."""

import math
from collections.abc import Mapping
from typing import ClassVar

from gaitchain.backends.feetech import control_table as table
from gaitchain.backends.feetech.wire import StsProtocol
from gaitchain.backends.servos.make import (
    ON,
    Make,
    Settings,
    SetupBlocks,
    State,
    Writes,
)
from gaitchain.backends.servos.table import COUNTS

_TENTHS = 10.0  # of a percent in a percent


class Feetech(Make):
    """The STS series with 12-bit magnetic encoders.

    They have no watchdog: a servo holds its last goal until it is told otherwise. Goals
    are a control period ahead, so that is where it stops without any packet; a program
    that was silent for too long refuses to go on by itself (`ServoWatch.lapsed`).
    """

    name, models, wire = "feetech", table.MODELS, StsProtocol
    plain_model = "sts3215"
    bauds = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)
    rad_s_per_count = 2.0 * math.pi / COUNTS
    errors = table.ERRORS
    torque, setup, present, goal = table.TORQUE, table.SETUP, table.PRESENT, table.GOAL
    setup_blocks = SetupBlocks(
        table.MODE,
        table.RETURN_DELAY,
        table.TEMPERATURE_LIMIT,
        table.LOWEST_POSITION,
        table.HIGHEST_POSITION,
    )
    state, supply, watchdog = table.STATE, table.STATE, None
    position_mode = table.POSITION_MODE
    modes: ClassVar[Mapping[int, str]] = {1: "speed", 2: "PWM", 3: "steps"}
    baud_register, delay_register = "Baud Rate(6)", "Return Delay(7)"
    mode_register = "Mode(33) to 0 (position) with Feetech's FD"
    level_register = "Status Return Level(8) to 1 with Feetech's FD"
    obeys_not = "does not obey; overload, heat, supply, or outside its Limits(9, 11)?"
    examples = "sts3215, sts3250"

    def settings(self, data: bytes) -> Settings:
        """Return what the block `setup` says."""
        found = super().settings(data)
        # Both limits 0 are none.
        return found._replace(highest=found.highest or COUNTS - 1)

    def measured(self, data: bytes) -> tuple[int, int, int]:
        """Return current, velocity and position of the block `present` [counts]."""
        blocks = table.CURRENT, table.VELOCITY, table.POSITION
        current, velocity, position = (
            table.signed(block.unsigned(data, table.PRESENT)) for block in blocks
        )
        return current, velocity, position

    def status(self, data: bytes) -> State:
        """Return what the block `state` says."""
        errors = table.STATUS.unsigned(data, table.STATE)
        torque = table.TORQUE.unsigned(data, table.STATE) == 1
        return State(errors, torque, tripped=False)

    def supply_state(self, data: bytes) -> tuple[float, float]:
        """Return temperature [deg C] and voltage [V] of the block `supply`."""
        volts = 0.1 * table.VOLTAGE.unsigned(data, table.STATE)
        return float(table.TEMPERATURE.unsigned(data, table.STATE)), volts

    def goal_data(self, count: int) -> bytes:
        """Return the data of a goal [counts]."""
        number = -count | 1 << table.SIGN if count < 0 else count
        return number.to_bytes(self.goal.size, "little")

    def holding(
        self, goals: Mapping[int, int], limits: Mapping[int, float], watchdog_s: float
    ) -> Writes:
        """Return what makes servos hold a position; the torque comes last."""
        as_fast_as_it_can = bytes(table.GOAL_SPEED.end - table.GOAL_TIME.address)
        motion = {
            number: b"\0"
            + self.goal_data(count)
            + as_fast_as_it_can
            + round(_TENTHS * limits[number]).to_bytes(2, "little")
            for number, count in goals.items()
        }
        return [(table.MOTION, motion), (table.TORQUE, dict.fromkeys(goals, ON))]


MAKE = Feetech()
