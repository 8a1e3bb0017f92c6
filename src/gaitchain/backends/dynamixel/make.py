"""DYNAMIXEL's X series: what it has of its own."""

import math
import struct
from collections.abc import Mapping
from typing import ClassVar

from gaitchain.backends.dynamixel import control_table as table
from gaitchain.backends.dynamixel.wire import Protocol2
from gaitchain.backends.servos.make import (
    OFF,
    ON,
    Make,
    Settings,
    SetupBlocks,
    State,
    Writes,
)


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

    def watchdog_time_s(self, wanted_s: float) -> float:
        """Return the time nearest to a wanted one that the watchdog can have [s]."""
        units = math.ceil(wanted_s / table.WATCHDOG_UNIT_S - 1e-9)
        return min(max(units, 1), table.WATCHDOG_MOST) * table.WATCHDOG_UNIT_S

    def holding(
        self, goals: Mapping[int, int], limits: Mapping[int, float], watchdog_s: float
    ) -> Writes:
        """Return what makes servos hold a position; the torque comes last."""
        as_fast_as_it_can = bytes(table.PROFILE.size)
        units = round(self.watchdog_time_s(watchdog_s) / table.WATCHDOG_UNIT_S)
        pwm = {n: round(part / 100.0 * table.FULL_PWM) for n, part in limits.items()}
        return [
            # A tripped watchdog refuses goals.
            (table.WATCHDOG, dict.fromkeys(goals, OFF)),
            (
                table.PROFILE_AND_GOAL,
                {n: as_fast_as_it_can + self.goal_data(c) for n, c in goals.items()},
            ),
            (table.GOAL_PWM, {n: v.to_bytes(2, "little") for n, v in pwm.items()}),
            (table.WATCHDOG, dict.fromkeys(goals, bytes([units]))),
            (table.TORQUE, dict.fromkeys(goals, ON)),
        ]


MAKE = Dynamixel()
