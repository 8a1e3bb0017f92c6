"""The names that options of the command line have, by the fields that hold them."""

from dataclasses import Field
from typing import Any

import tyro


def option_name(field: Field[Any]) -> str:
    """Return how an option is written, as `--step-s` of a field `step_s`.

    Args:
        field: of a verb's options; its type may have another name, `tyro.conf.arg`.
    """
    notes = getattr(field.type, "__metadata__", ())
    names = (getattr(note, "name", None) for note in notes)
    return "--" + next(filter(None, names), field.name).replace("_", "-")


def is_positional(field: Field[Any]) -> bool:
    """Return whether it is given by its place alone."""
    return tyro.conf.Positional in getattr(field.type, "__metadata__", ())
