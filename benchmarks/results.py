"""Measure what docs/results.md publishes anew, write the tables, and say what moved.

Usage: python benchmarks/results.py [PART ...] [--out FOLDER]. The parts are those of
results.toml: smallest (seconds, the shipped library), brisk, paper, robots (needs the
extra `robots`, or MENAGERIE_ROOT); all by default. Libraries are built into the folder
once, and what was measured stays there: a run that was interrupted goes on. The exit
code is 1 if a figure moved by more than its tolerance.
"""

import argparse
import json
import math
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gaitchain.gait.library_file import load_library

CLAIMS = Path(__file__).with_name("results.toml")


@dataclass(frozen=True)
class Figure:
    """One published number, measured again."""

    what: str
    name: str
    published: float
    measured: float | None
    tolerance: float
    command: str

    @property
    def moved(self) -> bool:
        """Whether it is further from what was published than its tolerance."""
        if self.measured is None:
            return True
        return abs(self.measured - self.published) > self.tolerance

    def row(self) -> str:
        """Return it as a row of the table."""
        now = "-" if self.measured is None else f"{self.measured:.4g}"
        mark = "**moved**" if self.moved else ""
        cells = (self.what, self.name, f"{self.published:g}", now, mark, self.command)
        return f"| {' | '.join(cells)} |"


def measure(parts: list[str], out: Path) -> list[Figure]:
    """Measure every figure of some parts; build the libraries that they need."""
    table = tomllib.loads(CLAIMS.read_text("utf-8"))
    figures = []
    for claim in table["claim"]:
        if parts and claim["part"] not in parts:
            continue
        verb, library, *options = claim["command"]
        found = result(verb, _library(library, table["build"], out), options, out)
        shown = f"`{' '.join(['gaitchain', *claim['command']])}`"
        for name, published in claim["published"].items():
            tolerance = table["tolerance"][name]
            value = found.get(name)
            figure = Figure(claim["what"], name, published, value, tolerance, shown)
            print(figure.row(), flush=True)
            figures.append(figure)
    return figures


def write_tables(figures: list[Figure], path: Path) -> None:
    """Write the table of all figures as Markdown."""
    heads = (
        "| what | figure | published | now | | command |\n|---|---|---|---|---|---|\n"
    )
    rows = "\n".join(figure.row() for figure in figures)
    path.write_text(f"{heads}{rows}\n", encoding="utf-8")


def _library(name: str, builds: dict[str, list[str]], out: Path) -> str:
    if name not in builds:
        return name  # one that comes with the package
    path = out / f"{name}.gait"
    if not path.exists():
        _gaitchain("build", *builds[name], "-o", str(path))
    if not path.exists():
        sys.exit(f"{name}: not built, so nothing of it can be measured")
    return str(path)


def result(verb: str, library: str, options: list[str], out: Path) -> dict[str, Any]:
    """Return what a command found, from the folder if it has run before.

    Nothing where it is refused, as for a speed that a library does not walk any more.
    """
    name = "_".join([verb, Path(library).stem, *options])
    path = out / f"{''.join(c if c.isalnum() else '_' for c in name)}.json"
    if not path.exists():
        words = [verb, library, *options, "--quiet", "--json", str(path)]
        if not _gaitchain(*words):
            return {}
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


def fastest(library: str) -> list[float]:
    """Return its fastest commands ahead, to the left and around, to four digits."""
    ends = load_library(library).command_range.ends
    return [math.floor(1e4 * ends[axis][1]) / 1e4 for axis in range(3)]


def pushes(library: str, out: Path) -> dict[str, Any]:
    """Return what pushes a robot holds at 0.6 of its speed."""
    ahead = load_library(library).command_range.vx[1]
    options = ["--runs", "20", "--seed", "3", "--vx", f"{0.6 * ahead:.3f}"]
    return result("push", library, options, out)


def _gaitchain(*words: str) -> bool:
    """Run a command; return whether it has a result, as a fall of the robot is one."""
    done = subprocess.run([sys.executable, "-m", "gaitchain", *words], check=False)
    return done.returncode <= 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help="of results.toml; all by default")
    parser.add_argument("--out", type=Path, default=Path("runs/results"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    figures = measure(options.parts, options.out)
    if not figures:
        sys.exit(f"no such part: {' '.join(options.parts)}; see {CLAIMS.name}")
    write_tables(figures, options.out / "results.md")
    moved = [figure for figure in figures if figure.moved]
    print(f"{len(moved)} of {len(figures)} figures moved; {options.out / 'results.md'}")
    sys.exit(bool(moved))


if __name__ == "__main__":
    main()
