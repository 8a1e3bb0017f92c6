"""Telemetry as a log keeps it: complete, with measured numbers to seven digits.

Servos and sensors measure three or four digits, a simulator's sixteen would double the
file. Times keep all of theirs. A message is MessagePack: the telemetry without its
arrays, their lengths, and their numbers as little-endian float64. These are the same
bytes as in the ROS messages beside it, so compression finds them.
"""

import struct
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from gaitchain.backends.base import Truth
from gaitchain.live.messages import Telemetry

_ARRAYS = (
    "joint_position",
    "joint_velocity",
    "joint_target",
    "joint_load",
    "angular_velocity",
    "acceleration",
)
_APART = ("self_contact", "whole")  # no arrays of every log
_TRUTH = tuple(n for n in Truth.__struct_fields__ if n not in _APART)
_NO_NUMBERS: dict[str, Any] = dict.fromkeys(_TRUTH, ())
_encode = msgspec.msgpack.Encoder().encode
_decode = msgspec.msgpack.Decoder(tuple[Telemetry, tuple[int, ...], bytes]).decode


def rounded(telemetry: Telemetry) -> Telemetry:
    """Return the telemetry with the numbers of its arrays to seven digits."""
    arrays = _arrays(telemetry)
    numbers = [number for array in arrays for number in array]
    with np.errstate(over="ignore"):  # of a simulation that blew up
        few = np.array(numbers, dtype=np.float32).tolist()
    return _filled(telemetry, [len(array) for array in arrays], few)


def pack(telemetry: Telemetry) -> bytes:
    """Return the telemetry as the bytes of one message."""
    arrays = _arrays(telemetry)
    numbers = [number for array in arrays for number in array]
    truth = telemetry.truth and replace(telemetry.truth, **_NO_NUMBERS)
    bare = replace(telemetry, truth=truth, **dict.fromkeys(_ARRAYS, ()))
    blob = struct.pack(f"<{len(numbers)}d", *numbers)
    return _encode((bare, [len(array) for array in arrays], blob))


def unpack(data: bytes) -> Telemetry:
    """Return the telemetry that `pack` made into bytes.

    Raises:
        ValueError: they are none.
    """
    try:
        bare, sizes, blob = _decode(data)
    except msgspec.DecodeError as error:
        raise ValueError(f"no telemetry: {error}") from None
    wanted = len(_ARRAYS) + (len(_TRUTH) if bare.truth else 0)
    if len(sizes) != wanted or min(sizes) < 0 or len(blob) != 8 * sum(sizes):
        raise ValueError(f"no telemetry: {len(sizes)} arrays in {len(blob)} bytes")
    return _filled(bare, sizes, struct.unpack(f"<{sum(sizes)}d", blob))


def _arrays(telemetry: Telemetry) -> list[tuple[float, ...]]:
    found = [getattr(telemetry, name) for name in _ARRAYS]
    if telemetry.truth is not None:
        found += [getattr(telemetry.truth, name) for name in _TRUTH]
    return found


def _filled(
    telemetry: Telemetry, sizes: Sequence[int], numbers: Sequence[float]
) -> Telemetry:
    ends = pairwise(accumulate(sizes, initial=0))
    arrays = [tuple(numbers[begin:end]) for begin, end in ends]
    own = dict(zip(_ARRAYS, arrays, strict=False))
    truth = telemetry.truth
    if truth is not None:
        known = zip(_TRUTH, arrays[len(_ARRAYS) :], strict=True)
        truth = replace(truth, **dict(known))
    return replace(telemetry, truth=truth, **own)
