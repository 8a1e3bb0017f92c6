"""`gaitchain build`: build a qualified gait library from a robot's file."""

import time
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from gaitchain.build.journal import Journal
from gaitchain.build.own_model import own_digest
from gaitchain.build.own_trials import own_fault
from gaitchain.build.pipeline import BuildReport, build_library
from gaitchain.build.workers import available_cores
from gaitchain.cli.cluster import check_address, on_backend
from gaitchain.cli.console import print_table, progress, say
from gaitchain.cli.files import check_files, check_replaced, check_writable
from gaitchain.cli.kept_work import kept_in
from gaitchain.cli.libraries import find_library
from gaitchain.cli.options import Build
from gaitchain.discover.loaded_robot import load_robot, robot_file
from gaitchain.errors import LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.robot.robot import Robot

_CONFIGURED = {field.name for field in fields(BuildConfig)}


def run(options: Build) -> tuple[int, dict[str, Any]]:
    """Build; the exit code is 1 if physics does not pass the library."""
    given = {
        name: getattr(options, name) for name in _CONFIGURED & vars(options).keys()
    }
    given["profile"] = None if options.profile is None else str(options.profile)
    identified = options.identified and find_library(str(options.identified))
    given["preset"] = options.preset or _preset_of(identified)
    config = BuildConfig(**given, speed_limit_deg_s=options.speed_limit)
    check_address(options)
    workers = options.workers or available_cores()
    with on_backend(options, workers):
        robot = identified_robot(config, identified)
        read = robot_file(config.robot), options.profile, identified
        check_files([options.output], read)
        check_replaced(options.output, "the library", "a gait library")
        built = build_and_save(config, options.output, workers, robot)
    library, report, elapsed_s = built
    if not library.qualified:
        say("not qualified: this library will be refused; see the table above")
    found = {
        "robot": library.robot.name,
        "library": str(options.output),
        "qualified": library.qualified,
        "build_s": elapsed_s,
        "report": asdict(report),
        "commands": asdict(library.command_range),
        "config": asdict(library.config),
    }
    return 0 if library.qualified else 1, found


def _preset_of(identified: Path | None) -> str | None:
    """Return how the library walks in which a robot was identified, and say so.

    By the robot alone, boxes walk as in the paper, however their library did.
    """
    if identified is None:
        return None
    preset = load_library(identified).config.preset
    say(f"--preset {preset}, that of {identified}")
    return preset


def identified_robot(config: BuildConfig, identified: Path | None) -> Robot:
    """Return the robot to build for: that of its file, or as it was identified.

    Args:
        config: of the build.
        identified: library that `gaitchain identify` wrote, if any.

    Raises:
        LibraryError: the library is of another robot, or none was identified.
    """
    robot = load_robot(config.robot, config.profile)
    if identified is None:
        return robot
    found = load_library(identified, robot).robot
    if found.identified is None:
        raise LibraryError(
            f"{identified}: of the robot in its file; give a library that `gaitchain "
            "identify` wrote"
        )
    return found


def build_and_save(
    config: BuildConfig, path: Path, workers: int | None, robot: Robot
) -> tuple[GaitLibrary, BuildReport, float]:
    """Build a library, save it, and print the report; return also the duration [s].

    Finished jobs are kept in a journal beside the library until the end, so that an
    interrupted build can be continued.
    """
    check_writable(path)
    if config.own_runs and (fault := own_fault(config.robot, robot)):
        say(fault)
    begin = time.perf_counter()
    of = config, robot.fingerprint, own_digest(config.robot, robot)
    kept = path.with_name(f"{path.name}.build.jsonl")
    interrupted = kept.exists()
    journal = Journal(kept, *of)
    if interrupted:
        say(journal.greeting)
    with kept_in(journal), progress() as tell:
        library, report = build_library(
            config, tell, workers or available_cores(), robot
        )
    elapsed_s = time.perf_counter() - begin
    size = save_library(library, path)
    journal.remove()
    print_report(library, report)
    say(f"{path}: {size / 1000:.1f} kB, built in {elapsed_s:.0f} s")
    return library, report, elapsed_s


def print_report(library: GaitLibrary, report: BuildReport) -> None:
    """Print the report of a build."""
    rows = [
        ("candidate poses per layer", _counts(report.candidates)),
        *_chosen(report),
        ("mean training cost", f"{report.mean_cost:.2f}"),
        ("training walks that fell", str(report.falls)),
        ("steps that hold in physics", f"{report.pairs}"),
        ("random schedules walked", report.gate.describe()),
        *_own(library),
        *library.describe(),
        ("qualified", library.qualification.verdict),
    ]
    print_table(f"Gait library of {library.robot.name}", ("", ""), rows)


def _chosen(report: BuildReport) -> list[tuple[str, str]]:
    """Say what pruning and looking ahead do, where poses are chosen within a step."""
    if max(report.candidates[1:-1]) == 1:
        return []
    regret, choice = report.regret, report.choice
    return [
        ("kept, eps independent", _counts(report.kept)),
        ("zeta independent gaits", str(report.independent_gaits)),
        (
            "regret on planned cost, greedy / look-ahead",
            f"{regret.greedy:.1%} / {regret.look_ahead:.1%}" if regret else "-",
        ),
        (
            "expected cost, all poses / pruned / pruned and greedy",
            f"{choice.all_poses:.3f} / {choice.kept_poses:.3f} / "
            f"{choice.kept_greedy:.3f}",
        ),
    ]


def _own(library: GaitLibrary) -> list[tuple[str, str]]:
    """Say how the walks in the robot's own model ended, if there were any."""
    own = library.qualification.own
    if own is None:
        return []
    return [("in its own model", own.describe())]


def _counts(counts: tuple[int, ...]) -> str:
    return " / ".join(map(str, counts))
