"""`gaitchain figures`: draw the paper's figures, each with the paper's claim."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.console import print_table, progress, say
from gaitchain.cli.files import make_folder
from gaitchain.cli.libraries import read_library
from gaitchain.cli.library_cache import cached_library
from gaitchain.cli.options import Figures
from gaitchain.discover.looks import find_looks
from gaitchain.errors import CommandError, LibraryError, RenderError
from gaitchain.figures.chain import figure_6, figure_7, regret_table
from gaitchain.figures.footing import figure_11
from gaitchain.figures.joints import figure_8
from gaitchain.figures.snapshots import figure_9
from gaitchain.figures.steps import two_cycles
from gaitchain.figures.sticks import figure_10
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import PAPER_WALK, parse_schedule
from gaitchain.walker.walker import Walker

_KNOWN = (6, 7, 8, 9, 10, 11)
_LAST_OF_THE_CHAIN = 7  # the figures after it show a walk


def run(options: Figures) -> tuple[int, dict[str, Any]]:
    """Draw the chosen figures and print their numbers beside those of the paper.

    Raises:
        LibraryError: a library is given that cannot be read, or not be compared.
        RenderError: none of them can be drawn here.
    """
    wanted = _numbers(options.only)
    given = None if options.library is None else read_library(options.library)
    out = make_folder(options.out)
    jobs = _walk_jobs(options, given, wanted, out) | {
        6: lambda: figure_6(out, options.seeds),
        7: lambda: figure_7(out, options.seeds),
    }
    results, missing = _draw([(number, jobs[number]) for number in wanted])
    rows = [(f"Fig. {n}", *_claim(result)) for n, result in results.items()]
    if min(wanted) <= _LAST_OF_THE_CHAIN:
        rows.append(("regret", *_claim(regret_table(out, options.seeds))))
    print_table("Figures of the paper", ("figure", "ours", "the paper"), rows)
    say(f"{out}: {', '.join(f'fig{n:02d}.png, fig{n:02d}.json' for n in results)}")
    for number, reason in missing.items():
        say(f"Fig. {number} is missing: {reason}")
    return 0, {name: {"ours": ours, "paper": paper} for name, ours, paper in rows}


def _draw(
    jobs: list[tuple[int, Callable[[], Any]]],
) -> tuple[dict[int, Any], dict[int, RenderError]]:
    """Draw figures; return the numbers of each, and why others are missing.

    Raises:
        RenderError: all are missing.
    """
    results: dict[int, Any] = {}
    missing: dict[int, RenderError] = {}
    with progress() as tell:
        for done, (number, job) in enumerate(jobs):
            tell("drawing", done, len(jobs))
            try:
                results[number] = job()
            except RenderError as error:  # the other figures do not need OpenGL
                missing[number] = error
        tell("drawing", len(jobs), len(jobs))
    if not results:
        raise next(iter(missing.values()))
    return results, missing


def _numbers(text: str) -> list[int]:
    known = ",".join(map(str, _KNOWN))
    try:
        numbers = sorted({int(part) for part in text.split(",")})
    except ValueError:
        raise CommandError(f"--only {text!r}: give numbers as in {known}") from None
    unknown = [n for n in numbers if n not in _KNOWN]
    if unknown:
        raise CommandError(f"--only {text!r}: no figure {unknown[0]}; known: {known}")
    return numbers


def _walk_jobs(
    options: Figures, given: GaitLibrary | None, wanted: list[int], out: Path
) -> dict[int, Callable[[], Any]]:
    """Walk the paper's schedule once, if any of the figures needs it."""
    if max(wanted) <= _LAST_OF_THE_CHAIN:
        return {}
    if given is not None:
        library = _of_key_poses(given, options.library)
    else:
        config = BuildConfig(seed=options.seed)
        library, _ = cached_library(config, out / "res.gait", options.workers)
    backend = MujocoBackend(library.robot)
    schedule = parse_schedule(PAPER_WALK)
    record = run_schedule(Walker(library), backend, schedule)
    return {
        8: lambda: figure_8(out, record, library.robot),
        9: lambda: figure_9(out, record, library.robot, find_looks(library)),
        10: lambda: figure_10(out, library, two_cycles(record)[0].gait),
        11: lambda: figure_11(out, record, library),
    }


def _of_key_poses(library: GaitLibrary, word: str | None) -> GaitLibrary:
    """Return a library that can be compared with the paper's walk.

    Raises:
        LibraryError: its steps are no key poses.
    """
    try:
        library.poses_as(KeyPoses)
    except LibraryError as error:
        raise LibraryError(
            f"{word}: {error}, or give no library, and one of RES is built; "
            "--only 6,7 needs none"
        ) from None
    return library


def _claim(result: dict[str, Any]) -> tuple[str, str]:
    return str(result["ours"]), str(result["paper"]["text"])
