"""Identify hidden robots by their logs alone, and say what came against what is true.

    python benchmarks/hidden_robots.py LIBRARY FOLDER N [N ...] [--workers 1]
        [--part 0.7] [--only table]

Of each hidden robot N it makes a log (`calibrate --exercise`), walks the library
(`trial --robot-hidden`), identifies the robot (`identify`) and walks the library that
this wrote, four walks of 30 s each at 0.7 of the range before. All is kept in FOLDER,
so that an interrupted run goes on; `--only table` prints what is there. Only the table
reads the robot's true numbers.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from gaitchain.cli.libraries import read_library
from gaitchain.gait.command_range import inward
from gaitchain.gait.library_file import load_library
from gaitchain.messages import Array
from gaitchain.robot.identified import Identified
from gaitchain.sim.hidden_robot import draw_hidden_robot
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import (
    draw_com_shift,
    draw_encoder_offsets,
    draw_gains,
)

HEADS = (
    *("N", "asked [m/s]", "before: held of 4; m/s", "after: held of 4; m/s"),
    *("end after [m/s]", "kp, RMS / worst [%]", "worst joint, play [deg]"),
    *("offsets, RMS [deg]", "CoM, worst axis [mm]", "delay [ms]", "minutes"),
)


class Robot:
    """One hidden robot, and its files."""

    def __init__(self, library: str, folder: Path, number: int, asked: float) -> None:
        """Name the files.

        Args:
            library: of the robot's file.
            folder: for all files.
            number: of the hidden robot.
            asked: what the walks are commanded [m/s].
        """
        self.library, self.number, self.asked = library, number, asked
        kinds = "log", "gait", "before.json", "after.json", "seconds"
        name = f"{Path(library).stem}_{number}"
        files = [folder / f"{name}.{kind}" for kind in kinds]
        self.log, self.fitted, self.before, self.after, self.took = files

    def measure(self, workers: int) -> None:
        """Do what is not done yet."""
        hidden = "--robot-hidden", str(self.number)
        if not self.log.exists():
            gaitchain("calibrate", self.library, "--exercise", self.log, *hidden)
        self._walk(self.library, self.before, workers)
        if not self.fitted.exists():
            self._identify(workers)
        if self._end >= self.asked:
            self._walk(self.fitted, self.after, workers)

    @property
    def _end(self) -> float:
        """Speed ahead that the gate left [m/s]."""
        return inward(load_library(self.fitted).command_range.vx[1])

    def _identify(self, workers: int) -> None:
        """Identify the robot; of an interrupted one the time of all starts counts."""
        before = float(self.took.read_text()) if self.took.exists() else 0.0
        start = time.monotonic()
        words = "--workers", str(workers)
        try:
            gaitchain("identify", self.library, self.log, "-o", self.fitted, *words)
        finally:
            self.took.write_text(str(before + time.monotonic() - start))

    def _walk(self, library: str | Path, out: Path, workers: int) -> None:
        if not out.exists():
            words = (
                f"--robot-hidden {self.number} --runs 4 --seed 7 --workers {workers}"
            )
            schedule = "--schedule", f"{self.asked:.3f},0,0@30"
            gaitchain("trial", library, *words.split(), *schedule, "--json", out)

    def row(self) -> tuple[str, ...]:
        """Return what came, and by how much that is off."""
        known = load_library(self.fitted).robot.identified
        assert known is not None
        seconds = float(self.took.read_text()) if self.took.exists() else np.nan
        within = self._end >= self.asked
        return (
            *(str(self.number), f"{self.asked:.3f}", walks(self.before)),
            walks(self.after) if within else "out of its range",
            *(f"{self._end:.3f}", *errors(known, self.number)),
            f"{seconds / 60.0:.0f}",
        )


def gaitchain(*words: str | Path) -> None:
    """Run a command; its output is shown, and a robot that is not found ends nothing.

    Raises:
        SystemExit: it did neither succeed nor find something bad (1).
    """
    done = subprocess.run([sys.executable, "-m", "gaitchain", *words], check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(done.returncode)


def walks(path: Path) -> str:
    """Return how many of some walks held, and how fast those were."""
    if not path.exists():
        return "-"
    walked = json.loads(path.read_text("utf-8"))
    speed = walked["speed_mps"]
    return f"{walked['survived']}; {'-' if speed is None else f'{speed:.3f}'}"


def errors(found: Identified, number: int) -> tuple[str, ...]:
    """Return by how much the numbers of a hidden robot are off."""
    world, joints = World(**draw_hidden_robot(number), seed=number), len(found.gain)
    gain = 100.0 * (found.gain / draw_gains(world, joints) - 1.0)
    offset = np.degrees(found.offset - draw_encoder_offsets(world, joints))
    play = found.backlash_deg - world.backlash_deg
    com = 1000.0 * (found.com - draw_com_shift(world))
    delay = 1000.0 * (found.delay_s - world.delay_s)
    return (
        f"{rms(gain):.1f} / {np.abs(gain).max():.1f}",
        f"{np.abs(play).max():.2f}",
        f"{rms(offset):.2f}",
        f"{np.abs(com).max():.1f}",
        f"{abs(delay):.1f}",
    )


def rms(of: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(of**2)))


def main() -> None:
    """Measure the robots, and print a row of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", help="res, or a library of the robot's file")
    parser.add_argument("folder", type=Path)
    parser.add_argument("numbers", type=int, nargs="+", metavar="N")
    parser.add_argument("--part", type=float, default=0.7, help="of the range before")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", choices=["table"])
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    end = inward(read_library(options.library).command_range.vx[1])
    robots = [
        Robot(options.library, options.folder, number, round(options.part * end, 3))
        for number in options.numbers
    ]
    if options.only is None:
        for robot in robots:
            robot.measure(options.workers)
    for row in (HEADS, ["---"] * len(HEADS), *(robot.row() for robot in robots)):
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
