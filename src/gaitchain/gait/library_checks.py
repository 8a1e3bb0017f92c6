"""Checks of a gait library that its file's checksum cannot make."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import LibraryError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.strides import StridePoses


def verify(
    library: GaitLibrary, arrays: Mapping[str, NDArray[Any]], origin: str
) -> None:
    """Check that the parts of a library fit together.

    Args:
        library: put together from its file.
        arrays: as the file has them.
        origin: what messages call the file.

    Raises:
        LibraryError: two parts do not fit, or a number is none.
    """
    counts = library.poses.counts
    if library.chain.layer_sizes != counts:
        raise LibraryError(
            f"{origin}: inconsistent: the chain has {library.chain.layer_sizes} poses "
            f"per layer, the primitives {counts}"
        )
    _check_verdicts(library, origin)
    if isinstance(library.poses, StridePoses):
        return
    for i, q in enumerate(library.poses.q, start=1):
        off = np.abs(arrays[f"pose_{i}"] - q).max()
        if not off < 1e-9:
            raise LibraryError(
                f"{origin}: inconsistent: a pose of layer {i} is {off:.2g} rad away "
                "from what its primitives compose"
            )


def _check_verdicts(library: GaitLibrary, origin: str) -> None:
    counts = library.poses.counts
    edges = list(pairwise(counts))
    pairs = (counts[0], counts[-1])
    expected = {
        "edge_cost": ([c.shape for c in library.edge_costs], edges),
        "path_cost": ([c.shape for c in library.path_costs], edges),
        "pair_advance": ([library.pair_advance.shape], [pairs]),
        "pair_runs": ([library.pair_runs.shape], [pairs]),
        "pair_passes": ([library.pair_passes.shape], [pairs]),
    }
    if (grid := library.grid) is not None:
        found = [grid.runs.shape, grid.passes.shape, grid.forbidden.shape]
        expected["grid"] = found, [pairs] * 3
    for name, (found, needed) in expected.items():
        if found != needed:
            raise LibraryError(
                f"{origin}: inconsistent: {name} has shape {found}, needs {needed}"
            )
    costs = (*library.edge_costs, *library.path_costs)
    bad = any(bool(np.isnan(c).any() or (c == -np.inf).any()) for c in costs)
    if bad or not np.isfinite(library.pair_advance).all():
        raise LibraryError(f"{origin}: inconsistent: a cost or advance is not a number")
    verdicts = [(library.pair_runs, library.pair_passes)]
    verdicts += [(grid.runs, grid.passes)] if grid is not None else []
    if any(bool((p < 0).any() or (p > runs).any()) for runs, p in verdicts):
        raise LibraryError(f"{origin}: inconsistent: more steps held than were walked")
