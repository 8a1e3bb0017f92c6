"""Building a library for the verbs that need one: with bars, from a cached file."""

import time
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from gaitchain.build.config import BuildConfig
from gaitchain.build.pipeline import BuildReport, build_library
from gaitchain.build.trial import available_cores
from gaitchain.cli.console import check_writable, print_table, progress, say
from gaitchain.discover.loaded_robot import load_body
from gaitchain.errors import LibraryError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.gait.stride.strides import StridePoses


def build_and_save(config: BuildConfig, path: Path) -> tuple[GaitLibrary, float]:
    """Build a library with progress bars, save it, and print what came of it.

    Returns:
        The library and the seconds that building took.
    """
    check_writable(path)
    begin = time.perf_counter()
    with progress() as tell:
        library, report = build_library(config, tell, available_cores())
    elapsed_s = time.perf_counter() - begin
    size = save_library(library, path)
    print_report(library, report)
    say(f"{path}: {size / 1000:.1f} kB, built in {elapsed_s:.0f} s")
    return library, elapsed_s


def cached_library(config: BuildConfig, path: Path) -> tuple[GaitLibrary, float]:
    """Take the library of an earlier run if it came from this very config.

    Returns:
        The library and the seconds that building took, 0 for an earlier one's.
    """
    if path.exists():
        try:
            biped = load_body(config.robot, config.profile).biped
            library = load_library(path, biped)
        except LibraryError as error:
            say(f"building again: {error}")
        else:
            same = dict(library.config) == _as_stored(config)
            if same and library.version == version("gaitchain"):
                say(f"{path}: built earlier from this config")
                return library, 0.0
    return build_and_save(config, path)


def print_report(library: GaitLibrary, report: BuildReport) -> None:
    """Print what building found."""
    low, high = library.speed_range
    regret, choice = report.regret, report.choice
    rows = [
        ("candidate poses per layer", _counts(report.candidates)),
        ("kept, eps independent", _counts(report.kept)),
        ("zeta independent gaits", str(report.independent_gaits)),
        ("mean training cost", f"{report.mean_cost:.2f}"),
        ("training walks that fell", str(report.falls)),
        (
            "regret on planned cost, greedy / look-ahead",
            f"{regret.greedy:.1%} / {regret.look_ahead:.1%}" if regret else "-",
        ),
        (
            "expected cost, all poses / pruned / pruned and greedy",
            f"{choice.all_poses:.3f} / {choice.kept_poses:.3f} / "
            f"{choice.kept_greedy:.3f}",
        ),
        ("steps that hold in physics", f"{report.pairs}"),
        ("random schedules walked", f"{report.gate_passed} of {report.gate_runs}"),
        ("rounds of schedules", f"{report.gate_rounds}"),
        ("speed range", f"{low:.3f} to {high:.3f} m/s"),
        *command_rows(library),
        *shape_rows(library),
        ("qualified", "yes" if library.qualified else "NO"),
    ]
    print_table(f"Gait library of {library.biped.name}", ("", ""), rows)


def _counts(counts: tuple[int, ...]) -> str:
    return " / ".join(map(str, counts))


def _as_stored(config: BuildConfig) -> dict[str, object]:
    """Return the config as a library's header gives it back: tuples are lists."""
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(config).items()
    }


def command_rows(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what a dynamic library can be asked for beside going forward."""
    if not library.dynamic:
        return []
    span = library.command_range
    return [
        ("backward", f"to {-span.vx[0]:.3f} m/s"),
        ("sideways", f"to {span.vy[1]:.3f} m/s"),
        ("turning", f"to {span.yaw_rate[1]:.2f} rad/s"),
    ]


def shape_rows(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return how a dynamic library steps, as far as a search may have found it."""
    poses = library.poses
    if not isinstance(poses, StridePoses):
        return []
    leg = library.biped.leg_length
    lift = float(poses.parameters[1][:, 2].mean())
    rows = [
        ("step", f"T = {library.timing.step:.3g} s, sole lifted {1000 * lift:.0f} mm"),
        ("hips", f"{poses.hip_height / leg:.3f} of the leg over the ankles"),
    ]
    factors = ", ".join(f"{name} {value:.2f}" for name, value in poses.balance.items())
    return [*rows, ("gains, of the derived ones", factors)] if factors else rows
