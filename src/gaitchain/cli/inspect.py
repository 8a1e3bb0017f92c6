"""`gaitchain inspect`: what a robot's file or a gait library holds."""

from pathlib import Path

import numpy as np

from gaitchain.biped import builtin_robots, load_biped, quantity_units
from gaitchain.cli.building import command_rows
from gaitchain.cli.console import print_table, say
from gaitchain.cli.options import Inspect
from gaitchain.closure import closure_report
from gaitchain.cost import PlannedCost
from gaitchain.kinematics import Array
from gaitchain.library import GaitLibrary
from gaitchain.library_file import library_bytes, load_library
from gaitchain.presets import CROUCH, geometric_sway


def run(options: Inspect) -> int:
    """Show it."""
    if options.what in builtin_robots() or options.what.endswith(".toml"):
        _show_robot(options.what)
    else:
        _show_library(Path(options.what))
    return 0


def _show_robot(name: str) -> None:
    biped = load_biped(name)
    rows = [
        (key, f"{value:g}", unit, biped.sources.get(key, ""))
        for key, (value, unit) in quantity_units(biped).items()
    ]
    print_table(biped.name, ("quantity", "value", "unit", "source"), rows)
    sway = np.degrees(geometric_sway(biped, CROUCH * biped.leg_length))
    say(
        f"mass {biped.mass:g} kg, leg {biped.leg_length:g} m, fingerprint "
        f"{biped.fingerprint}; CoM over the sole's centre at {sway:.1f} deg of sway"
    )
    report = closure_report(biped, np.random.default_rng(0))
    rows = [
        (r.key_moment, f"{r.reachable}/{r.drawn}", r.hip_range, r.verdict)
        for r in report
    ]
    print_table(
        "Table I as printed: what closes",
        ("key moment", "in reach", "hip ahead of the support ankle [m]", "verdict"),
        rows,
    )


def _show_library(path: Path) -> None:
    library = load_library(path)
    low, high = library.speed_range
    tested = library.qualification
    allowed = library.allowed_pairs
    impact = _landing_impacts(library)
    rows = [
        ("robot", f"{library.biped.name} ({library.biped.fingerprint})"),
        ("size", f"{len(library_bytes(library)) / 1000:.1f} kB"),
        ("poses per layer", " / ".join(map(str, library.poses.counts))),
        ("step", f"T = {library.timing.step:g} s"),
        ("speed range", f"{low:.3f} to {high:.3f} m/s"),
        *command_rows(library),
        ("steps walked in physics", f"{int(library.pair_runs.sum())}"),
        ("pairs of poses that hold", f"{int(allowed.sum())} of {allowed.size - 1}"),
        ("landing impact", _range(impact)),
        ("qualified", "yes" if library.qualified else "NO"),
        *((key, f"{value}") for key, value in sorted(tested.items())),
    ]
    print_table(f"Gait library {path}", ("", ""), rows)
    config = ", ".join(f"{k}={v}" for k, v in sorted(library.config.items()))
    say(f"config: {config}")


def _range(impact: Array) -> str:
    return f"{impact.min():.2f} to {impact.max():.2f} rad/s" if impact.size else "-"


def _landing_impacts(library: GaitLibrary) -> Array:
    """Jump of the joint velocities at heel contact of each gait that holds [rad/s]."""
    gaits = library.gait_of[library.allowed_pairs]
    if library.dynamic:
        return np.zeros(0)
    impact = PlannedCost(library.key_poses, library.timing).impact
    return np.asarray(impact[gaits[:, 2], gaits[:, 3]])
