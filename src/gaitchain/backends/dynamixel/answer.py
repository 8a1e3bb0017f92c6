"""What a servo sends back, out of the packets that the SDK has received."""

from collections.abc import Sequence
from dataclasses import dataclass

from gaitchain.backends.dynamixel.control_table import ALERT

ID = 4
"""Place of the id in a packet."""
_LENGTH, _ERROR, _DATA = 5, 8, 9
_OTHERS = 4  # instruction, error and CRC count as well


@dataclass(frozen=True)
class Answer:
    """What a servo sent back."""

    data: bytes
    alert: bool
    """Whether it has a hardware error."""


def unpacked(packet: Sequence[int], size: int) -> Answer | None:
    """Take a status packet apart.

    Args:
        packet: as the SDK has received it, stuffing removed.
        size: bytes of data that were asked for.

    Returns:
        None if it is an error, or the late answer to another request.
    """
    length = packet[_LENGTH] + 256 * packet[_LENGTH + 1]
    error = packet[_ERROR]
    if length != size + _OTHERS or error & ~ALERT:
        return None
    return Answer(bytes(packet[_DATA : _DATA + size]), bool(error & ALERT))
