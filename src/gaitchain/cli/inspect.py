"""`gaitchain inspect`: what a robot's file or a gait library holds."""

from pathlib import Path

import numpy as np

from gaitchain.cli.building import command_rows, shape_rows
from gaitchain.cli.console import print_table, say
from gaitchain.cli.findings import show_full_robot, show_legs, show_zmp_error
from gaitchain.cli.options import Inspect
from gaitchain.errors import CommandError
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.presets import CROUCH, geometric_sway
from gaitchain.gait.keypose.table1_closure import closure_report
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.messages import Array
from gaitchain.robot.reduced_biped import Biped, is_boxes, load_biped, quantity_units

_PEEK = 4096  # bytes of a file that tell what it is


def run(options: Inspect) -> int:
    """Show it."""
    what = options.what
    library = _is_library(what)
    if library or is_boxes(what):
        for name in ("profile", "out"):
            if getattr(options, name) is not None:
                kind = "a gait library" if library else "a robot of boxes"
                raise CommandError(
                    f"--{name}: {what} is {kind}; this is for a robot's MJCF or URDF"
                )
    if library:
        _show_library(Path(what))
    elif is_boxes(what):
        _show_boxes(load_biped(what))
    else:
        show_full_robot(what, options.profile, options.out)
    return 0


def _is_library(what: str) -> bool:
    """Whether a file is to be read as a gait library, by its name or its content.

    Raises:
        CommandError: it is neither a library nor a robot's file.
    """
    if is_boxes(what):
        return False
    path = Path(what)
    if path.suffix == ".gait":
        return True
    try:
        with path.open("rb") as file:
            head = file.read(_PEEK)
    except (OSError, ValueError):
        return False  # a robot's name; or no file, which loading the robot tells
    if head[8:9] == b"{" and int.from_bytes(head[:8], "little") < 2**32:
        return True  # the header of a safetensors file
    if head.strip() and b"<" not in head:
        raise CommandError(
            f"{what}: neither a gait library nor a robot; give a .gait file that "
            "`gaitchain build` wrote, or a robot's TOML, MJCF or URDF file"
        )
    return False


def _show_boxes(biped: Biped) -> None:
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
    show_zmp_error(biped)
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
        *shape_rows(library),
        ("steps walked in physics", f"{int(library.pair_runs.sum())}"),
        ("pairs of poses that hold", f"{int(allowed.sum())} of {allowed.size - 1}"),
        ("landing impact", _range(impact)),
        ("qualified", "yes" if library.qualified else "NO"),
        *((key, f"{value}") for key, value in vars(tested).items()),
    ]
    print_table(f"Gait library {path}", ("", ""), rows)
    if library.biped.anatomy is not None:
        show_legs(library.biped.anatomy)
    config = ", ".join(f"{k}={v}" for k, v in vars(library.config).items())
    say(f"config: {config}")


def _range(impact: Array) -> str:
    return f"{impact.min():.2f} to {impact.max():.2f} rad/s" if impact.size else "-"


def _landing_impacts(library: GaitLibrary) -> Array:
    """Jump of the joint velocities at heel contact of each gait that holds [rad/s]."""
    gaits = library.gait_of[library.allowed_pairs]
    if library.family is not KEY_POSES:
        return np.zeros(0)
    impact = PlannedCost(library.poses_as(KeyPoses), library.timing).impact
    return np.asarray(impact[gaits[:, 2], gaits[:, 3]])
