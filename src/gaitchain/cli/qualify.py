"""`gaitchain qualify`: walk a library's steps and commands on a grid of worlds."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import takewhile
from pathlib import Path
from typing import Any

import msgspec

from gaitchain.build.grid import EVERY_STEP, GridRun
from gaitchain.build.journal import Journal
from gaitchain.build.qualify import default_grid, qualify_grid
from gaitchain.build.workers import Crew, available_cores
from gaitchain.cli.cluster import check_address, on_backend
from gaitchain.cli.console import print_table, progress, resumable, say
from gaitchain.cli.files import (
    check_files,
    check_picture,
    check_replaced,
    make_folder,
)
from gaitchain.cli.libraries import find_library, shipped_library
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Qualify
from gaitchain.cli.proof import prove_bound
from gaitchain.cli.splitting import estimate_falls
from gaitchain.errors import CommandError
from gaitchain.figures.proof_report import REPORT_FILES
from gaitchain.figures.robustness import plot_pass_rates
from gaitchain.gait.command_range import AXES, ends_text
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.qualification import CellReport, GridReport
from gaitchain.walker.walker import Walker

_OF_GRID = ("quick", "seeds", "map")
_OF_BOUND = (
    "splitting",
    "confidence",
    "seconds",
    "most_steps",
    "pages",
    "report_walks",
)
_OF_TEST = ("seconds", "most_steps", "pages", "report_walks")
_NAMED = 12  # number of steps printed in a line
_UNSETTLED = (
    "round {} still took steps out, so that what is left was not walked together: it "
    "does not pass; qualify it again with more --seeds, or build it again"
)


def run(options: Qualify) -> tuple[int, dict[str, Any]]:
    """Walk the grid, or for a bound; the exit code is 1 if it does not pass."""
    check_address(options)
    _check_kind(options)
    path = find_library(options.library)
    library, out = load_library(path), options.output or path
    if out == shipped_library(path.stem):
        split = options.splitting is not None
        what = "beside which finished walks are kept" if split else "for the verdict"
        raise CommandError(
            f"{options.library}: comes with gaitchain and stays as it is; name another "
            f"file {what} with -o"
        )
    check_files([out, options.map, *_pages(options)], [])
    check_replaced(options.output, "the library", "a gait library")
    if options.map is not None:
        check_picture(options.map)
    if options.bound is not None:
        if options.splitting is not None:
            return estimate_falls(options, library, out)
        return prove_bound(options, library, out)
    Walker(library.as_built())  # refuses what the build did not pass, before any work
    return _walk_grid(options, library, out)


def _check_kind(options: Qualify) -> None:
    """Refuse what is the grid's beside a bound, and what is a bound's without one."""
    bounded = options.bound is not None
    if not bounded:
        refuse(options, _OF_BOUND, "of a bound on falls; give --bound as well")
        return
    refuse(options, _OF_GRID, "of the grid of worlds, which --bound does not walk")
    if options.splitting is not None:
        refuse(options, _OF_TEST, "of the test of a bound, which --splitting replaces")
    if options.pages is None:
        refuse(options, ("report_walks",), "of the report; give --report DIR as well")


def _pages(options: Qualify) -> list[Path]:
    """Return the files of the report; its folder is made and checked."""
    if options.pages is None:
        return []
    folder = make_folder(options.pages)
    return [folder / name for name in REPORT_FILES]


def _walk_grid(
    options: Qualify, library: GaitLibrary, out: Path
) -> tuple[int, dict[str, Any]]:
    grid = default_grid(library, quick=options.quick, seeds=options.seeds)
    built = library_bytes(library.as_built())
    journal = Journal(out.with_name(f"{out.name}.qualify.jsonl"), built, grid)
    say(journal.greeting)
    kept = [run for run in takewhile(bool, map(_read_run, journal.found)) if run]
    # Otherwise new walks would follow what is damaged, and be dropped with it again.
    del journal.found[len(kept) :]
    done = {run.key: run for run in kept}
    workers = options.workers or available_cores()
    with (
        resumable(journal.path),
        journal,
        on_backend(options, workers),
        progress() as tell,
    ):
        crew = Crew(workers, tell)
        found = qualify_grid(library, grid, crew, done, journal.add)
    save_library(found, out)
    journal.remove()
    return 0 if found.qualified else 1, _hand_out(options, found, out)


def _read_run(kept: Any) -> GridRun | None:
    """Restore a finished walk from the journal; None if the entry is damaged."""
    try:
        return msgspec.convert(kept, GridRun)
    except msgspec.ValidationError:
        return None


def _hand_out(options: Qualify, library: GaitLibrary, out: Path) -> dict[str, Any]:
    """Print the table, draw the map; return the figures."""
    report = library.qualification.grid
    assert report is not None  # set by `qualify_grid`
    _show(library, report)
    if options.map is not None:
        plot_pass_rates(report.cells, f"{library.robot.name}, {out.name}", options.map)
        say(f"{options.map}: the map")
    verdict = "passes" if library.qualified else "does not pass"
    say(f"{out}: {verdict}; what was found is in it")
    facts = {"robot": library.robot.name, "commands": asdict(library.command_range)}
    return facts | asdict(report)


def _show(library: GaitLibrary, report: GridReport) -> None:
    walks = "commands\nheld", "every\nstep"
    heads = "world", "required", *walks, "steps\nwalked", "fallen\non"
    rows = [_row(cell) for cell in report.cells]
    print_table(f"{library.robot.name} on a grid of worlds", heads, rows)
    say(_taken_out(library, report.taken_out))
    if not report.settled:
        say(_UNSETTLED.format(report.rounds))
    span = library.command_range
    units = AXES.values()
    left = (ends_text(*ends, unit) for ends, unit in zip(span.ends, units, strict=True))
    say(f"left: {', '.join(left)}")


def _row(cell: CellReport) -> tuple[str, ...]:
    every = cell.groups.get(EVERY_STEP, (0, 0))
    return (
        cell.name,
        "yes" if cell.required else "",
        f"{cell.passes}/{cell.runs}",
        f"{every[1]}/{every[0]}",
        f"{cell.steps[0]}",
        f"{cell.steps[1]}",
    )


def _taken_out(library: GaitLibrary, out: Sequence[tuple[int, int]]) -> str:
    """Say how many steps were taken out, and name the first ones."""
    named = ", ".join(f"{first} to {last}" for first, last in out[:_NAMED])
    more = " ..." if len(out) > _NAMED else ""
    before = int(library.as_built().allowed_pairs.sum())
    return f"steps taken out: {len(out)} of {before}{': ' * bool(out)}{named}{more}"
