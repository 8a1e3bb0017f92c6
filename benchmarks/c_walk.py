"""Exported C against the walker in Python: equality over a walk, times, memory.

    python benchmarks/c_walk.py [LIBRARY ...] [--seconds 60] [--seed 1]

Each library walks random commands in physics, a new one every 2 s, driven by Python.
C gets the same sensors; its targets are compared in every control period, those of
position servos and those of motor drivers. Then both compute the last sensors of the
walk again and again, by turns, in this process: the times are medians of batches.
"""

import argparse
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import read_library
from gaitchain.export.c_trial import try_c
from gaitchain.export.c_walker import CWalker
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.walker.walker import Walker

EVERY_S, REST_S = 2.0, 1.0
BATCHES, BATCH = 40, 100
HEAD = """\
library       steps fell   targets   motors'     place   Python    C   code state
                             [rad] [rad,Nm..]      [m]     [us] [us]  [KiB] [KiB]"""
FIELDS = "position", "velocity", "torque"


def main() -> None:
    """Measure each library, and print a row for it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("libraries", nargs="*", default=["res"], metavar="LIBRARY")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print(HEAD)
    for word in asked.libraries:
        measure(word, asked)


def measure(word, asked) -> None:
    """Walk one library; print its row."""
    library = read_library(word)
    with tempfile.TemporaryDirectory() as folder:
        walker, in_c = Walker(library), CWalker(library, Path(folder))
        steps, fell, off = walk(walker, in_c, library, asked)
        python_us, c_us = times(walker, in_c)
        trial = try_c(Path(folder))
    told = "yes" if fell else "no"
    print(
        f"{Path(word).stem:12} {steps:6d} {told:>4} {off[0]:9.1e} {off[1]:9.1e} "
        f"{off[2]:9.1e} {python_us:8.1f} {c_us:4.1f}  {trial.code_bytes / 1024:5.1f} "
        f"{trial.state_bytes / 1024:5.1f}"
    )


def walk(walker, in_c, library, asked):
    """Return the steps, whether it fell, and the largest differences."""
    rng, backend = np.random.default_rng(asked.seed), MujocoBackend(library.robot)
    backend.connect(walker.stand)
    off, fell = np.zeros(3), False
    for tick in range(round(asked.seconds / CONTROL_PERIOD_S)):
        since_s = tick * CONTROL_PERIOD_S - REST_S
        if since_s >= 0.0 and tick % round(EVERY_S / CONTROL_PERIOD_S) == 0:
            crouch = rng.choice([0.0, 0.5, 1.0]) * library.command_range.crouch[0]
            command = replace(library.command_range.draw(rng), crouch=float(crouch))
            walker.command(command)
            in_c.command(command)
        sensors = backend.read()
        targets, others = walker.step(sensors), in_c.step(sensors)
        motors = [
            np.abs(getattr(targets.motors, n) - getattr(others.motors, n)).max()
            for n in FIELDS
        ]
        apart = np.abs(in_c.place - np.array(walker.place)).max()
        position = np.abs(targets.position - others.position).max()
        assert np.isfinite([position, *motors, apart]).all()
        off = np.maximum(off, [position, max(motors), apart])
        backend.write(targets.position)
        fell = fell or bool(np.abs(backend.tilt).max() > 0.7)
    return walker.gait.steps, fell, off


def times(walker, in_c):
    """Return the medians of a period's time in Python and in C [us]."""
    sensors = walker._good
    in_c.measure(sensors)
    spans = [], []
    for _ in range(BATCHES):
        for span, compute in zip(
            spans, (lambda: walker.step(sensors), in_c.run), strict=True
        ):
            began_s = time.perf_counter()
            for _ in range(BATCH):
                compute()
            span.append(1e6 * (time.perf_counter() - began_s) / BATCH)
    return tuple(map(statistics.median, spans))


if __name__ == "__main__":
    main()
