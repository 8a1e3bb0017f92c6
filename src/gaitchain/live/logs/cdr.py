"""CDR, the bytes of ROS 2 messages, as far as logs need it: little-endian, aligned."""

import struct
from collections.abc import Sequence
from typing import Self

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
_SECOND = 1_000_000_000  # ns
_LAST_SECOND = 2**31 - 1  # that a stamp of ROS 2 can hold


class Cdr:
    """One message, written field by field in the order of its definition."""

    def __init__(self, begun: bytes = _HEADER) -> None:
        """Begin a message, or go on with one."""
        self._data = bytearray(begun)

    def __bytes__(self) -> bytes:
        """Return the message so far."""
        return bytes(self._data)

    def byte(self, value: int) -> Self:
        """Write a uint8 or bool."""
        self._data.append(value)
        return self

    def whole(self, *values: int) -> Self:
        """Write each as uint32."""
        return self._fields("I", values)

    def signed(self, *values: int) -> Self:
        """Write each as int32."""
        return self._fields("i", values)

    def numbers(self, *values: float) -> Self:
        """Write each as float64: fields one by one, or an array of fixed length."""
        return self._fields("d", values)

    def sequence(self, values: Sequence[float]) -> Self:
        """Write an array of float64 and its length."""
        self.whole(len(values))
        return self.numbers(*values) if values else self

    def text(self, value: str) -> Self:
        """Write a string."""
        data = value.encode(errors="replace") + b"\x00"
        self.whole(len(data))
        self._data += data
        return self

    def texts(self, values: Sequence[str]) -> Self:
        """Write an array of strings and its length."""
        self.whole(len(values))
        for value in values:
            self.text(value)
        return self

    def stamp(self, time_ns: int) -> Self:
        """Write a builtin_interfaces/Time."""
        seconds, rest = divmod(time_ns, _SECOND)
        return self.signed(min(max(seconds, 0), _LAST_SECOND)).whole(rest)

    def header(self, time_ns: int, frame: str) -> Self:
        """Write a std_msgs/Header."""
        return self.stamp(time_ns).text(frame)

    def _fields(self, kind: str, values: Sequence[float]) -> Self:
        # Aligned to the field's size, counted from behind the four bytes of the header.
        gap = (len(_HEADER) - len(self._data)) % struct.calcsize(kind)
        self._data += struct.pack(f"<{gap}x{len(values)}{kind}", *values)
        return self
