"""Blocks, models and angles of servos with 4096 counts a turn, of any make."""

from dataclasses import dataclass

COUNTS = 4096
"""Positions in one turn."""
DEG_PER_COUNT = 360.0 / COUNTS


@dataclass(frozen=True)
class Block:
    """A contiguous range of bytes in the control table."""

    address: int
    size: int

    @property
    def end(self) -> int:
        """First address after the block."""
        return self.address + self.size

    def unsigned(self, data: bytes, within: "Block") -> int:
        """Return the block's unsigned number from the data of the block around it."""
        start = self.address - within.address
        return int.from_bytes(data[start : start + self.size], "little")


@dataclass(frozen=True)
class Model:
    """A servo model."""

    name: str
    amperes_per_count: float
    """Unit of the present current [A]; NaN if the servo measures no current."""
