"""Which of the package's own files one is, by how it begins.

Libraries, records and logs of exercises are safetensors with a JSON header, logs of
runs are MCAP, ways up are JSON.
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
]

# Of each kind an entry of the header that no other kind has.
_OWN: Mapping[Kind, str] = {
    "a gait library": "qualification",
    "the record of a walk": "step_ticks",
    "the log of an exercise": "supports",
}


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
    begin = file.read(8)
    if begin == _MCAP:
        return "the log of a run"
    if begin.startswith(b"{") and begin[-1]:  # else the size of a header
        whole = json.loads(begin + file.read(_MOST_BYTES))
        return "a file of ways up" if "ways" in whole else None
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
