"""Which of the package's own files one is: all are safetensors with a JSON header."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

Kind = Literal["a gait library", "the record of a walk", "the log of an exercise"]

# Of each kind an entry of the header that no other kind has.
_OWN: Mapping[Kind, str] = {
    "a gait library": "qualification",
    "the record of a walk": "step_ticks",
    "the log of an exercise": "supports",
}


_KEY = "gaitchain"
_MOST_BYTES = 100_000_000  # of a header, as safetensors has it


def kind_of(path: Path, wanted: Kind | None = None) -> Kind | None:
    """Return what an existing file is; None if not known, or what was wanted.

    Args:
        path: the file.
        wanted: what may be there.
    """
    try:
        with path.open("rb") as file:
            size = int.from_bytes(file.read(8), "little")
            plain = json.loads(file.read(min(size, _MOST_BYTES)))
        return other_kind(json.loads(plain["__metadata__"][_KEY]), wanted)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def other_kind(header: Mapping[str, Any], wanted: Kind | None) -> Kind | None:
    """Return what a file is where that is not what was wanted; None if not known.

    Args:
        header: of the file.
        wanted: what the file was given for.
    """
    kinds = (kind for kind, own in _OWN.items() if own in header and kind != wanted)
    return next(kinds, None)
