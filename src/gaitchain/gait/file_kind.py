"""Which of the package's own files one is, by how it begins.

Libraries, records and logs of exercises are safetensors with a JSON header, logs of
runs are MCAP, ways up and polynomials are JSON, an index is CSV.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal

Kind = Literal[
    "a gait library",
    "the record of a walk",
    "the log of an exercise",
    "the log of a run",
    "a file of ways up",
    "the polynomials of motions",
    "the index of motions",
]

# Of each kind an entry of the header that no other kind has.
_OWN: Mapping[Kind, str] = {
    "a gait library": "qualification",
    "the record of a walk": "step_ticks",
    "the log of an exercise": "supports",
}
_OWN_JSON: Mapping[str, Kind] = {
    "ways": "a file of ways up",
    "true_period_s": "the polynomials of motions",
}
INDEX_HEADS = "file,vx [m/s],vy [m/s],yaw_rate [rad/s]"
"""How the index of motions begins."""

_KEY = "gaitchain"
_MOST_BYTES = 100_000_000  # of a header, as safetensors has it
_MCAP = b"\x89MCAP0\r\n"


def kind_of(path: Path) -> Kind | None:
    """Return what an existing file is; None if not known."""
    try:
        with path.open("rb") as file:
            return _kind(file)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _kind(file: BinaryIO) -> Kind | None:
    begin, heads = file.read(8), INDEX_HEADS.encode()
    if begin == _MCAP:
        return "the log of a run"
    if begin == heads[:8]:
        rest = file.read(len(heads) - 8)
        return "the index of motions" if rest == heads[8:] else None
    if begin.startswith(b"{") and begin[-1]:  # else the size of a header
        whole = json.loads(begin + file.read(_MOST_BYTES))
        return next((_OWN_JSON[key] for key in whole if key in _OWN_JSON), None)
    size = int.from_bytes(begin, "little")
    plain = json.loads(file.read(min(size, _MOST_BYTES)))
    return other_kind(json.loads(plain["__metadata__"][_KEY]), None)


def other_kind(header: Mapping[str, Any], wanted: Kind | None) -> Kind | None:
    """Return what a file is where that is not what was wanted; None if not known.

    Args:
        header: of the file.
        wanted: what the file was given for.
    """
    kinds = (kind for kind, own in _OWN.items() if own in header and kind != wanted)
    return next(kinds, None)
