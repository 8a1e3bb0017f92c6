"""What emulated servos of every make have in common: a table and a motor."""

from typing import ClassVar

from gaitchain.backends.servos.emulator.motor import Motor
from gaitchain.backends.servos.table import DEG_PER_COUNT, Block


class TableServo:
    """A servo whose table says how it is; makes differ in addresses and answers."""

    torque_at: ClassVar[Block]
    status_level_at: ClassVar[Block]
    errors_at: ClassVar[Block]

    def __init__(self, number: int, size: int, motor: Motor) -> None:
        """Begin with an empty table.

        Args:
            number: id.
            size: of the table [bytes].
            motor: what the servo turns.
        """
        self.number = number
        self.torque_seen = False
        """Whether the torque was ever on."""
        self._motor, self._table = motor, bytearray(size)

    @property
    def status_level(self) -> int:
        """Which instructions the servo answers, as its table counts them."""
        return self._get(self.status_level_at)

    @property
    def torque(self) -> bool:
        """Whether the torque is on."""
        return self._get(self.torque_at) == 1

    @property
    def angle_deg(self) -> float:
        """Angle at the last access [deg]."""
        return self._motor.position * DEG_PER_COUNT

    def turn(self, angle_deg: float) -> None:
        """Turn the servo, as by hand, to an angle [deg]; its torque must be off."""
        self._motor.position = angle_deg / DEG_PER_COUNT

    def fail(self, bits: int) -> None:
        """Set error bits, which turns the torque off."""
        self.put(self.errors_at, bits)
        self.put(self.torque_at, 0)

    def put(self, block: Block, value: int) -> None:
        """Set a value in the table from inside the servo, such as its temperature."""
        self._table[block.address : block.end] = value.to_bytes(block.size, "little")

    def _get(self, block: Block) -> int:
        return int.from_bytes(self._table[block.address : block.end], "little")
