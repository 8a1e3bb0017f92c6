"""A robot as the files of libraries and records hold it: a header and arrays."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.robot.leg_model import Anatomy, anatomy_from
from gaitchain.robot.reduced_biped import Biped

PREFIX = "anatomy_"
"""Of the names of a full robot's arrays."""


def robot_facts(biped: Biped) -> dict[str, Any]:
    """Return all of a robot that is no array; a full robot has an "anatomy"."""
    facts: dict[str, Any] = {"name": biped.name, "numbers": biped.numbers()}
    if biped.anatomy is not None:
        facts["anatomy"] = biped.anatomy.facts()
    return facts


def robot_arrays(biped: Biped) -> dict[str, NDArray[Any]]:
    """Return the arrays of a full robot; none of a robot of boxes."""
    if biped.anatomy is None:
        return {}
    own = biped.anatomy.arrays()
    return {f"{PREFIX}{name}": np.ascontiguousarray(a) for name, a in own.items()}


def robot_from(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Biped:
    """Put a robot together from its facts and arrays.

    Raises:
        ValueError: a number is missing, unknown or not finite.
        GaitchainError: the arrays do not fit together.
    """
    wanted = {f.name for f in fields(Biped) if f.metadata}
    numbers: dict[str, Any] = {n: float(x) for n, x in facts["numbers"].items()}
    if set(numbers) != wanted or not np.isfinite(list(numbers.values())).all():
        raise ValueError(f"numbers of the robot: {sorted(set(numbers) ^ wanted)}")
    anatomy = _anatomy(facts.get("anatomy"), arrays)
    return Biped(name=str(facts["name"]), sources={}, anatomy=anatomy, **numbers)


def _anatomy(
    facts: Mapping[str, Any] | None, arrays: Mapping[str, NDArray[Any]]
) -> Anatomy | None:
    if facts is None:
        return None
    own = {
        name.removeprefix(PREFIX): array
        for name, array in arrays.items()
        if name.startswith(PREFIX)
    }
    return anatomy_from(facts, own)
