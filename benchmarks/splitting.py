"""Falls by splitting against brute force, in disturbed settings where both see them.

    python benchmarks/splitting.py --settings 20 --json splitting.json

Each setting has its own hardness of the pushes and its own seeds. A setting agrees if
the part of brute force's walks that fall is in splitting's 95 % interval.
"""

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_scale
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.proof.fall_rate import mild_cells
from gaitchain.proof.split_walks import Disturbed, SliceWalk, walk_slices
from gaitchain.proof.splitting import (
    Chance,
    brute_force,
    count_events,
    mean_chance,
    overlap,
    split,
)

LEVELS = 5  # of hardness


class Compared:
    """One setting."""

    def __init__(self, hardest, number, options):
        self.library = load_library(shipped_library())
        self.walked = Disturbed(self.library, float(hardest), options.slices)
        self.entropy, self.options = 1000 + number, options
        self.cells = mild_cells(self.library)
        self.scale_ns = impulse_scale(self.library)[2]

    def walk_all(self, seeds):
        """Give the levels of paths."""
        fixed = self.walked, self.cells, self.scale_ns, self.entropy
        jobs = [(*fixed, own) for own in seeds]
        for walk in run_jobs(walk_slices, jobs, SliceWalk, self.options.workers):
            yield walk.levels

    def measure(self):
        """Walk both ways."""
        options, slices = self.options, self.options.slices
        rng = np.random.default_rng((self.entropy, 1))
        runs = [
            split(self.walk_all, slices, options.paths, rng)
            for _ in range(options.repetitions)
        ]
        other = np.random.default_rng((self.entropy, 2))
        fell = count_events(self.walk_all, slices, options.walks, other)
        chance = mean_chance(runs)
        alone = Chance(*brute_force(fell, options.walks))
        return {
            "hardest": self.walked.hardest,
            "splitting": asdict(chance),
            "split_walks": sum(run.paths for run in runs),
            "brute_force": asdict(alone),
            "brute_walks": options.walks,
            "agrees": chance.low <= alone.mean <= chance.high,
            "overlap": overlap(chance, alone),
        }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--settings", type=int, default=20)
    parser.add_argument(
        "--hardest",
        type=float,
        nargs=2,
        default=(0.14, 0.22),
        metavar=("LOW", "HIGH"),
        help="the pushes' hardness, over m sqrt(g h); each setting has one of five",
    )
    parser.add_argument("--slices", type=int, default=6, help="seconds of a walk")
    parser.add_argument("--paths", type=int, default=16)
    parser.add_argument("--repetitions", type=int, default=6)
    parser.add_argument("--walks", type=int, default=200, help="of brute force")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options, found = parser.parse_args(), []
    hardest = np.linspace(*options.hardest, LEVELS)
    for number in range(options.settings):
        began = time.monotonic()
        row = Compared(hardest[number % LEVELS], number, options).measure()
        found.append(row)
        brute, by = row["brute_force"], row["splitting"]
        print(
            f"{row['hardest']:.2f}: splitting {by['mean']:.4f} ({by['low']:.4f} to "
            f"{by['high']:.4f}) of {row['split_walks']}, brute force "
            f"{brute['mean']:.4f} ({brute['low']:.4f} to {brute['high']:.4f}), "
            f"agrees {row['agrees']}, "
            f"{time.monotonic() - began:.0f} s",
            flush=True,
        )
        if options.json is not None:
            options.json.write_text(json.dumps(found, indent=1))
    agree = sum(row["agrees"] for row in found)
    print(f"{agree} of {len(found)} in splitting's interval")


if __name__ == "__main__":
    main()
