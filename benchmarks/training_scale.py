"""Measure how training scales: 1e4, 1e5 and 1e6 gaits over 4 layers of 1000 poses.

Run it with `python benchmarks/training_scale.py`. Counts rise, so the peak memory of
the process printed in a row is the peak of that row's run.
"""

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gaitchain.chain import LayeredChain, draw_gaits
from gaitchain.expectation import expected_costs
from gaitchain.training import train_batch, train_sequential

LAYER_SIZES = (1000, 1000, 1000, 1000)


@dataclass(frozen=True)
class Measurement:
    """Hold the seconds of each routine and the peak memory of the process so far."""

    samples: int
    batch: float  # [s]
    expected: float  # [s]
    sequential: float  # [s]
    peak: float  # [MiB]


def measure(samples: int) -> Measurement:
    """Train on `samples` random gaits in the three ways."""
    rng = np.random.default_rng(0)
    gaits = draw_gaits(LAYER_SIZES, samples, rng)
    costs = rng.random(samples)
    untrained = LayeredChain.uniform(LAYER_SIZES)
    batch = _seconds(lambda: train_batch(LAYER_SIZES, gaits, costs))
    expected = _seconds(lambda: expected_costs(LAYER_SIZES, gaits, costs))
    sequential = _seconds(lambda: train_sequential(untrained, gaits, costs))
    # Linux reports kilobytes, macOS bytes.
    unit = 2**20 if sys.platform == "darwin" else 2**10
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return Measurement(samples, batch, expected, sequential, peak)


def main() -> None:
    """Print one row per number of gaits."""
    print("  gaits  batch [s]  expected [s]  sequential [s]  peak [MiB]")
    for samples in (10_000, 100_000, 1_000_000):
        row = measure(samples)
        print(
            f"{row.samples:7d}  {row.batch:9.2f}  {row.expected:12.2f}"
            f"  {row.sequential:14.2f}  {row.peak:10.0f}"
        )


def _seconds(routine: Callable[[], object]) -> float:
    begin = time.perf_counter()
    routine()
    return time.perf_counter() - begin


if __name__ == "__main__":
    main()
