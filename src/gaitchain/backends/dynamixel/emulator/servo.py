"""An emulated X-series servo: table, motion and watchdog."""

import math
import struct
from bisect import bisect_left

from gaitchain.backends.dynamixel import control_table as table
from gaitchain.backends.servos.emulator.imu import EmulatedImu
from gaitchain.backends.servos.emulator.motor import Motor
from gaitchain.backends.servos.emulator.servo import TableServo
from gaitchain.backends.servos.table import COUNTS, Block

OK, RESULT_FAIL, RANGE, LENGTH, LIMIT, ACCESS = 0, 1, 4, 5, 6, 7
"""Error codes of a status packet."""
_SIZE, _IMU_SIZE = 662, 1100  # bytes of the tables
_RAM = 64  # lower addresses are EEPROM, which can only be written with torque off
_COUNTS_PER_RAD = COUNTS / (2.0 * math.pi)
_AMPERES_PER_RAD, _MOST_COUNTS, _MOST_INT16 = 20.0, 1193, 2**15 - 1
# Address: size, least and largest value.
_FIELDS = {
    table.RETURN_DELAY.address: (1, 0, 254),
    10: (1, 0, 5),
    table.OPERATING_MODE.address: (1, 0, 16),
    table.TEMPERATURE_LIMIT.address: (1, 0, 100),
    table.PWM_LIMIT.address: (2, 0, table.FULL_PWM),
    table.HIGHEST_POSITION.address: (4, 0, COUNTS - 1),
    table.LOWEST_POSITION.address: (4, 0, COUNTS - 1),
    table.TORQUE.address: (1, 0, 1),
    65: (1, 0, 1),
    table.STATUS_LEVEL.address: (1, 0, 2),
    **dict.fromkeys((80, 82, 84), (2, 0, 16383)),
    table.WATCHDOG.address: (1, 0, table.WATCHDOG_MOST),
    table.GOAL_PWM.address: (2, 0, table.FULL_PWM),
    102: (2, 0, 2**16 - 1),
    104: (4, 0, 2**32 - 1),
    **dict.fromkeys((table.PROFILE.address, table.PROFILE.address + 4), (4, 0, 32767)),
    table.GOAL.address: (4, 0, COUNTS - 1),
}
_STARTS = sorted(_FIELDS)
_GOALS = {*range(table.GOAL_PWM.address, table.PROFILE.address), table.GOAL.address}


class EmulatedXSeries(TableServo):
    """A servo that follows its goal with a first-order lag and limited speed.

    Its motion is computed when the servo is accessed. It answers pings, from status
    level 1 on also reads, and with 2 all instructions.
    """

    torque_at, status_level_at = table.TORQUE, table.STATUS_LEVEL
    errors_at = table.HARDWARE_ERROR

    def __init__(
        self,
        number: int,
        model: int = 1020,
        angle_deg: float = 180.0,
        speed_deg_s: float = 300.0,
        lag_s: float = 0.02,
    ) -> None:
        """Power the servo on.

        Args:
            number: id.
            model: model number, XM430-W350 by default.
            angle_deg: initial angle [deg].
            speed_deg_s: speed limit [deg/s].
            lag_s: time constant of the lag [s].
        """
        super().__init__(number, _SIZE, Motor(angle_deg, speed_deg_s, lag_s))
        self._model = model
        # Infinite of a servo that measures no current: the register is 0.
        known = table.MODELS.get(model)
        unit_a = math.nan if known is None else known.amperes_per_count
        self._unit_a = math.inf if math.isnan(unit_a) else unit_a
        self._now = self._heard_at = 0.0
        self.registered: tuple[int, bytes] | None = None
        """Address and data of a write that waits for an action."""
        self.put(Block(0, 2), model)
        self.put(Block(6, 1), 45)  # firmware
        self.put(Block(7, 1), number)
        self.put(table.OPERATING_MODE, table.POSITION_MODE)
        self.put(table.TEMPERATURE_LIMIT, 80)
        self.put(table.PWM_LIMIT, table.FULL_PWM)
        self.put(table.HIGHEST_POSITION, COUNTS - 1)
        self.reboot()

    def reboot(self) -> None:
        """Restart the servo: torque off, no error, RAM reset."""
        self.registered = None
        self._table[_RAM:] = bytes(_SIZE - _RAM)
        self.put(table.STATUS_LEVEL, 2)
        self.put(table.GOAL_PWM, self._get(table.PWM_LIMIT))
        self.put(table.VOLTAGE, 120)
        self.put(table.TEMPERATURE, 35)
        self.put(table.GOAL, round(self._motor.position) % COUNTS)

    @property
    def ping_data(self) -> bytes:
        """Return model number and firmware version, for the answer to a ping."""
        return self._model.to_bytes(2, "little") + bytes([self._table[6]])

    @property
    def alert(self) -> int:
        """Bits added to the error byte of every status packet."""
        return table.ALERT if self._get(table.HARDWARE_ERROR) else 0

    @property
    def watchdog(self) -> int:
        """Value of the bus watchdog, 255 if it has tripped."""
        return self._get(table.WATCHDOG)

    def hear(self, now: float) -> None:
        """Register a packet for any device at a time [s], which resets the watchdog."""
        self.advance(now)
        self._heard_at = now

    def advance(self, now: float) -> None:
        """Advance the motion to a time [s], up to the watchdog's stop if it trips."""
        armed = self.torque and 0 < self.watchdog <= table.WATCHDOG_MOST
        ends = self._heard_at + self.watchdog * table.WATCHDOG_UNIT_S
        if armed and now > ends:
            self._move(ends - self._now)
            self.put(table.WATCHDOG, table.WATCHDOG_TRIPPED)
            self.put(table.GOAL, round(self._motor.position))
        else:
            self._move(now - self._now)
        if self.watchdog == table.WATCHDOG_TRIPPED:
            self._motor.velocity = 0.0
        self._now = now

    def read(self, block: Block) -> tuple[int, bytes]:
        """Return the error, and the data if there is no error."""
        if block.end > _SIZE or block.size == 0:
            return ACCESS, b""
        self._refresh()
        return OK, bytes(self._table[block.address : block.end])

    def write(self, address: int, data: bytes) -> int:
        """Write consecutive fields from an address on; return the error."""
        fields = self._fields(address, data)
        if isinstance(fields, int):
            return fields
        for block, value in fields:
            error = self._check(block, value)
            if error:
                return error
        for block, value in fields:
            self.put(block, value)
        self.torque_seen |= self.torque
        return OK

    def _fields(self, address: int, data: bytes) -> list[tuple[Block, int]] | int:
        """Split data into whole fields, or return the error."""
        found: list[tuple[Block, int]] = []
        start = bisect_left(_STARTS, address)
        for at in _STARTS[start:]:
            if not data:
                break
            if at != address:
                return ACCESS
            size = _FIELDS[at][0]
            if len(data) < size:
                return LENGTH
            found.append((Block(at, size), int.from_bytes(data[:size], "little")))
            address, data = at + size, data[size:]
        return ACCESS if data or not found else found

    def _check(self, block: Block, value: int) -> int:
        _, low, high = _FIELDS[block.address]
        if block.address < _RAM and self.torque:
            return ACCESS
        if not low <= value <= high:
            return RANGE
        tripped = self.watchdog == table.WATCHDOG_TRIPPED
        rearmed = block == table.WATCHDOG and value > 0  # only 0 clears it
        if tripped and (block.address in _GOALS or rearmed):
            return RANGE
        if not self._allows(block, value):
            return LIMIT
        if block == table.TORQUE and value and self._get(table.HARDWARE_ERROR):
            return RESULT_FAIL
        return OK

    def _allows(self, block: Block, value: int) -> bool:
        """Whether a goal is within the limits that the servo's owner has set."""
        if block == table.GOAL_PWM:
            return value <= self._get(table.PWM_LIMIT)
        ends = table.LOWEST_POSITION, table.HIGHEST_POSITION
        lowest, highest = map(self._get, ends)
        return block != table.GOAL or lowest <= value <= highest

    def _move(self, elapsed_s: float) -> None:
        """Move towards the goal: first at the speed limit, then by the lag."""
        if not self.torque:
            self._motor.velocity = 0.0
            return
        self._motor.follow(self._get(table.GOAL), elapsed_s)

    def _refresh(self) -> None:
        """Write the measurements to the table."""
        error = (self._get(table.GOAL) - self._motor.position) / _COUNTS_PER_RAD
        amperes = error * _AMPERES_PER_RAD if self.torque else 0.0
        current = max(-_MOST_COUNTS, min(_MOST_COUNTS, round(amperes / self._unit_a)))
        speed = round(self._motor.velocity / _COUNTS_PER_RAD / table.RAD_S_PER_COUNT)
        present = struct.pack(
            table.PRESENT_FORMAT, current, speed, round(self._motor.position)
        )
        self._table[table.PRESENT.address : table.PRESENT.end] = present


Device = EmulatedXSeries | EmulatedImu
"""A device on the bus."""
