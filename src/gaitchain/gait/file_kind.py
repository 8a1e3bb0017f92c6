"""Which of the package's own files one is: all are safetensors with a JSON header."""

from collections.abc import Mapping
from typing import Any, Literal

Kind = Literal["a gait library", "the record of a walk", "the log of an exercise"]

# Of each kind an entry of the header that no other kind has.
_OWN: Mapping[Kind, str] = {
    "a gait library": "qualification",
    "the record of a walk": "step_ticks",
    "the log of an exercise": "supports",
}


def other_kind(header: Mapping[str, Any], wanted: Kind) -> Kind | None:
    """Return what a file is where that is not what was wanted; None if not known.

    Args:
        header: of the file.
        wanted: what the file was given for.
    """
    kinds = (kind for kind, own in _OWN.items() if own in header and kind != wanted)
    return next(kinds, None)
