"""Measure what docs/results.md says of robots from their files, as its table.

Usage: python benchmarks/any_robot.py FILE ... [--out FOLDER]. The library of a FILE
NAME.xml is FOLDER/NAME.gait, as gallery.py builds it; it is built if it is not there.
What was measured stays in the folder: a run that was interrupted goes on.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from results import fastest, pushes, result

from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library

TWENTY = ("--runs", "20", "--seed", "7")
SIXTY = ("--runs", "60", "--seed", "8")
HARDER = (
    ("--payload", "0.2"),
    ("--gain", "0.8"),
    ("--friction", "0.4"),
    ("--delay", "0.04"),
)


class Subject:
    """A robot's library, and what its trials found."""

    def __init__(self, file: Path, out: Path) -> None:
        """Build the library if it is not there.

        Args:
            file: the robot's MJCF or URDF.
            out: folder of libraries and results.
        """
        self._file, self._out = file, out
        self._path = out / f"{file.stem}.gait"
        if not self._path.exists():
            words = ["build", str(file), "-o", str(self._path)]
            subprocess.run([sys.executable, "-m", "gaitchain", *words], check=True)
        self.library: GaitLibrary = load_library(self._path)

    @property
    def name(self) -> str:
        """The robot's, as its file says it."""
        return self.library.robot.name

    def trial(self, *options: str) -> dict[str, Any]:
        """Return what a trial found."""
        return result("trial", str(self._path), list(options), self._out)

    def own(self, *options: str) -> dict[str, Any]:
        """Return what a trial in the robot's own model found."""
        return self.trial("--own-model", str(self._file), *options)

    def straight(self, part: float, seconds: float) -> dict[str, Any]:
        """Return twenty walks ahead at a part of the fastest speed."""
        return self.ahead(part * self.ends[0], seconds)

    def ahead(self, speed_mps: float, seconds: float) -> dict[str, Any]:
        """Return twenty walks ahead."""
        return self.trial(*TWENTY, "--schedule", f"{speed_mps:g},0,0@{seconds:.4g}")

    def push(self) -> dict[str, Any]:
        """Return what pushes the robot holds."""
        return pushes(str(self._path), self._out)

    @property
    def ends(self) -> list[float]:
        """The fastest commands ahead, to the left and around."""
        return fastest(str(self._path))


def _range(robot: Subject) -> str:
    ends = robot.library.command_range.ends
    return ", ".join(f"{low:.3f} to {high:.3f}" for low, high in ends[:3])


def _fastest(robot: Subject) -> str:
    found = robot.straight(1.0, 30.0)
    return f"{_held(found)}{found['speed_mps']:.3f}; {found['yaw_drift_deg']:.1f}"


def _aside(robot: Subject) -> str:
    left, around = robot.ends[1:]
    cells = []
    if left:
        found = robot.trial(*TWENTY, "--schedule", f"0,{left:g},0@30")
        cells.append(f"{_held(found)}{found['speed_mps']:.3f}")
    if around:
        found = robot.trial(*TWENTY, "--schedule", f"0,0,{around:g}@30")
        cells.append(f"{_held(found)}{around:.2f}")
    return " / ".join(cells) or "-"


def _ten_metres(robot: Subject) -> str:
    speed = 0.7 * robot.ends[0]
    return _of(robot.ahead(speed, 10.0 / speed + 0.5))


def _accuracy(robot: Subject) -> str:
    cells = []
    for part in (0.5, 0.8, 1.0):
        found, asked = robot.straight(part, 10.0), part * robot.ends[0]
        error = abs(found["speed_mps"] / asked - 1.0)
        cells.append(f"{_held(found)}{100 * error:.1f} / {found['yaw_drift_deg']:.1f}")
    return ", ".join(cells)


def _own_speeds(robot: Subject) -> str:
    cells = []
    for part in (0.5, 0.7, 1.0):
        words = ["--schedule", f"{part * robot.ends[0]:g},0,0@20"]
        found = robot.own("--runs", "4", "--seed", "7", *words)
        cells.append(f"{_held(found)}{found['speed_mps']:.3f}")
    return ", ".join(cells)


def _harder(robot: Subject) -> str:
    found = [robot.trial(*TWENTY, *harder) for harder in HARDER]
    return ", ".join(str(one["survived"]) for one in found)


def _pushes(robot: Subject) -> str:
    found = robot.push()
    worst, mean = (found[f"{which}_over_m_sqrt_gh"] for which in ("worst", "mean"))
    return f"{worst:.3f} / {mean:.3f}"


def _of(found: dict[str, Any]) -> str:
    return f"{found['survived']}/{found['runs']}"


def _held(found: dict[str, Any]) -> str:
    """Return how many walks held if not all did, to stand before a number."""
    return "" if found["survived"] == found["runs"] else f"**{_of(found)}**: "


ROWS: dict[str, Callable[[Subject], str]] = {
    "range of commands, ahead [m/s], to the left [m/s], around [rad/s]": _range,
    "fastest, 20 x 30 s [m/s]; yaw drift [deg]": _fastest,
    "aside [m/s] / around [rad/s], 20 x 30 s": _aside,
    "10 m straight at 0.7 of the top speed, then stop": _ten_metres,
    "speed error / yaw drift in 10 s straight, at half, 0.8 and all of the range "
    "[%, deg]": _accuracy,
    "random schedules over the range, 30 s": lambda robot: _of(robot.trial(*SIXTY)),
    "the same in its own model": lambda robot: _of(robot.own(*SIXTY)),
    "there 20 s straight at half, 0.7 and all of the range, 4 walks each [m/s]": (
        _own_speeds
    ),
    "random schedules with payload of 20 %, servo gain -20 %, friction 0.4, delay of "
    "40 ms, of 20 each": _harder,
    "push while walking, worst / mean, over m sqrt(g h)": _pushes,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="MJCF or URDF")
    parser.add_argument("--out", type=Path, default=Path("runs/gallery"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    robots = [Subject(file, options.out) for file in options.files]
    print(f"| | {' | '.join(robot.name for robot in robots)} |")
    print(f"|---|{'---|' * len(robots)}")
    for what, cell in ROWS.items():
        print(f"| {what} | {' | '.join(map(cell, robots))} |", flush=True)


if __name__ == "__main__":
    main()
