"""By what walks were judged before, as journals remember it."""

from dataclasses import astuple
from typing import Any

import msgspec

from gaitchain.build.journal import Journal
from gaitchain.gait.qualification import EarlierCriterion


def as_kept(criterion: EarlierCriterion) -> list[float]:
    """Return a criterion as a journal keeps it."""
    return list(astuple(criterion))


def tried(journal: Journal) -> list[EarlierCriterion]:
    """Return the other criteria that a journal remembers, but for damaged ones."""
    return [one for one in map(_read, journal.criteria) if one is not None]


def _read(kept: Any) -> EarlierCriterion | None:
    try:
        return EarlierCriterion(*msgspec.convert(kept, tuple[float, float, float]))
    except msgspec.ValidationError:
        return None
