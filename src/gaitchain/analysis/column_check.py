"""Check of the numbers in columns that come from a file."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def check_sizes(name: str, column: NDArray[Any], most: float) -> None:
    """Refuse numbers of a size that none is of; NaN alone is no measurement.

    Args:
        name: of the column, for the message.
        column: numbers, with one row per control period.
        most: the largest plausible size.

    Raises:
        ValueError: a number is larger, or infinite.
    """
    sizes = np.abs(np.where(np.isnan(column), 0.0, column))
    if float(sizes.max(initial=0.0)) <= most:
        return
    place = np.unravel_index(sizes.argmax(), sizes.shape)
    raise ValueError(
        f"{name} has a value of {column[place]:.3g} in row {place[0]}, "
        f"at most {most:g} in size"
    )
