"""Falls by splitting against brute force, in disturbed settings where both see them.

    python benchmarks/splitting.py --settings 20 --json splitting.json

Each setting has one of five hardnesses of the pushes, and its own seeds. It agrees if
the part of brute force's walks that fall is in splitting's 95 % interval: of its own
walks, and of all that were pushed as hard, which have the same chance of a fall. Run
again with the same file of --json, it goes on where it was interrupted.
"""

import argparse
import json
import sys
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from gaitchain.build.jobs import run_jobs
from gaitchain.build.push import impulse_unit_ns
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.proof.proof_walks import mild_cells
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
        self.scale_ns = impulse_unit_ns(self.library)

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


def agreeing(found):
    """Return how many settings agree: with their own brute force, and with all of it.

    A few hundred walks know the chance hardly better than splitting does.
    """
    own = sum(row["agrees"] for row in found)
    pooled = 0
    for row in found:
        alike = [r for r in found if r["hardest"] == row["hardest"]]
        walks = sum(r["brute_walks"] for r in alike)
        fell = sum(r["brute_force"]["mean"] * r["brute_walks"] for r in alike)
        pooled += row["splitting"]["low"] <= fell / walks <= row["splitting"]["high"]
    return own, pooled


def earlier(options, asked):
    """Return the settings that were measured before, by a file of the same command."""
    if options.json is None or not options.json.exists():
        return []
    kept = json.loads(options.json.read_text())
    if kept["asked"] != asked:
        sys.exit(f"{options.json}: of another command: {kept['asked']}")
    return kept["found"]


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
    options = parser.parse_args()
    asked = {
        name: value
        for name, value in vars(options).items()
        if name not in ("settings", "workers", "json")
    }
    asked["hardest"] = list(options.hardest)
    found, hardest = earlier(options, asked), np.linspace(*options.hardest, LEVELS)
    for number in range(len(found), options.settings):
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
            told = {"asked": asked, "found": found}
            options.json.write_text(json.dumps(told, indent=1))
    own, pooled = agreeing(found)
    print(
        f"of {len(found)} settings splitting's interval has brute force's part in "
        f"{own} by its own walks, in {pooled} by all that were pushed as hard"
    )


if __name__ == "__main__":
    main()
