"""`gaitchain inspect`: show the content of a robot's file or a gait library."""

# ruff: noqa: PLC0415 - a robot's computer, which has libraries, has no simulator.

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.build.grid import EVERY_STEP
from gaitchain.cli.console import print_table, say
from gaitchain.cli.legs import show_legs
from gaitchain.cli.libraries import find_library, is_shipped
from gaitchain.cli.options import Inspect
from gaitchain.cli.reach import show_reach
from gaitchain.discover.findings import LEG_GAINS, Findings
from gaitchain.discover.origin import check_origin
from gaitchain.errors import CommandError, GaitchainError, RobotFileError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.keypose.presets import CROUCH, geometric_sway
from gaitchain.gait.keypose.table1_closure import Closure, closure_report
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.gait.qualification import CellReport
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.reduced_biped import is_boxes, quantity_units
from gaitchain.robot.robot import Robot
from gaitchain.robot.whole_file import open_file
from gaitchain.sim.world import DISTURBANCES

_PEEK = 4096  # bytes read to identify the type of a file


def run(options: Inspect) -> tuple[int, dict[str, Any]]:
    """Show a robot or a library."""
    what = options.what
    library = _is_library(what)
    if library or is_boxes(what):
        for name in ("profile", "output"):
            if getattr(options, name) is not None:
                kind = "a gait library" if library else "a robot of boxes"
                raise CommandError(
                    f"--{name}: {what} is {kind}; this is for a robot's MJCF or URDF"
                )
    if library:
        return 0, _show_library(find_library(what))
    if is_boxes(what):
        return 0, _show_boxes(load_box_robot(what), what)
    from gaitchain.cli.findings import show_full_robot

    return 0, show_full_robot(what, options.profile, options.output)


def _is_library(what: str) -> bool:
    """Return whether a file is a gait library; refuse one that is no robot either."""
    if is_boxes(what):
        return False
    path = Path(what)
    if path.suffix == ".gait":
        return True
    try:
        with open_file(path) as file:
            head = file.read(_PEEK)
    except (OSError, ValueError):
        return False  # a robot's name, or no file: loading the robot then fails
    if head[8:9] == b"{" and int.from_bytes(head[:8], "little") < 2**32:
        return True  # the header of a safetensors file
    if head.strip() and b"<" not in head:
        raise CommandError(
            f"{what}: neither a gait library nor a robot; give a .gait file that "
            "`gaitchain build` wrote, or a robot's TOML, MJCF or URDF file"
        )
    return False


def _show_boxes(robot: Robot, name: str) -> dict[str, Any]:
    from gaitchain.cli.findings import show_zmp_error

    _show_quantities(robot)
    show_zmp_error(robot)
    report = closure_report(robot, np.random.default_rng(0))
    _show_closure(report)
    if is_shipped(name):
        say(f"A library of it comes with gaitchain: gaitchain inspect {name}.gait")
    return {
        "robot": robot.name,
        "fingerprint": robot.fingerprint,
        "quantities": {
            key: value for key, (value, _) in quantity_units(robot.reduced).items()
        },
        "table_1": [asdict(row) for row in report],
    }


def _show_quantities(robot: Robot) -> None:
    """Print the numbers of a robot of boxes, and what follows from them."""
    reduced = robot.reduced
    rows = [
        (key, f"{value:g}", unit, reduced.sources.get(key, ""))
        for key, (value, unit) in quantity_units(reduced).items()
    ]
    print_table(robot.name, ("quantity", "value", "unit", "source"), rows)
    sway = np.degrees(geometric_sway(robot, CROUCH * reduced.leg_length))
    say(
        f"mass {reduced.mass:g} kg, leg {reduced.leg_length:g} m, "
        f"fingerprint {robot.fingerprint}; "
        f"CoM over the sole's centre at {sway:.1f} deg of sway"
    )


def _show_closure(report: Sequence[Closure]) -> None:
    """Print which key moments of Table I the robot can reach."""
    rows = [
        (r.key_moment, f"{r.reachable}/{r.drawn}", r.hip_range, r.verdict)
        for r in report
    ]
    print_table(
        "Table I as printed: what closes",
        ("key moment", "in reach", "hip ahead of the support ankle [m]", "verdict"),
        rows,
    )


def _show_library(path: Path) -> dict[str, Any]:
    """Print a library: robot, gait, command range, verdicts, config."""
    library = load_library(path)
    robot = library.robot
    findings = _findings(library)
    gains = _gains(library, findings)
    _show_head(library, path, gains)
    _show_gait(library)
    reach = show_reach(library.command_range)
    _show_verdicts(library)
    _show_config(library)
    if not robot.boxes:
        show_legs(robot.legs, findings)
        _show_origin(library)
    found = robot.identified
    return {
        "robot": robot.name,
        "fingerprint": robot.fingerprint,
        "identified": None if found is None else found.facts(),
        "leg_gains": gains,
        "version": library.version,
        "qualified": library.qualified,
        "gait": library.family.name,
        "step_s": library.timing.step,
        "poses_per_layer": list(library.poses.counts),
        "commands": asdict(library.command_range),
        "reach": reach,
        "qualification": library.qualification.to_json(),
        "config": asdict(library.config),
    }


def _findings(library: GaitLibrary) -> Findings | None:
    """Read again what a robot's file says of it.

    Returns:
        None where the file is not at hand, or another robot's by now, or where nothing
        reads it, on a robot's computer.
    """
    config = library.config
    if library.robot.boxes or not Path(config.robot).is_file():
        return None
    try:
        from gaitchain.discover.loaded_robot import load_with_findings

        loaded = load_with_findings(config.robot, config.profile)
    except (ImportError, GaitchainError):
        return None
    same = loaded.robot.fingerprint == library.robot.in_file.fingerprint
    return loaded.findings if same else None


def _gains(library: GaitLibrary, findings: Findings | None) -> str:
    """Say where the gains of the legs' servos come from; empty where nobody knows."""
    own = library.qualification.own
    if findings is None:
        return "" if own is None or own.model is None else own.model.gains
    servos = [findings.servos[name] for name in library.robot.legs.joint_names]
    sources = ", ".join(sorted({servo.source for servo in servos}))
    judged = [why for what, _, why in findings.evidence if what == LEG_GAINS]
    return f"{sources}; the file's are not believed: {judged[0]}" if judged else sources


def _show_head(library: GaitLibrary, path: Path, gains: str) -> None:
    """Print what a library is for, and whether it is qualified."""
    robot = library.robot
    rows = [
        ("robot", f"{robot.name} ({robot.fingerprint})"),
        *_identified(robot),
        ("mass, leg", f"{robot.reduced.mass:.4g} kg, {robot.reduced.leg_length:.4g} m"),
        *([("leg gains", gains)] if gains else []),
        ("built by", f"gaitchain {library.version}"),
        ("size", f"{len(library_bytes(library)) / 1000:.1f} kB"),
        ("qualified", library.qualification.verdict),
    ]
    print_table(f"Gait library {path}", ("", ""), rows)


def _identified(robot: Robot) -> list[tuple[str, str]]:
    """Return that a robot is not that of its file, and how well it is known."""
    if robot.identified is None:
        return []
    left = ", ".join(f"{of} {sd}" for of, sd in robot.identified.describe_unknown())
    return [("identified", f"by its own log, which leaves unknown (1 sd): {left}")]


def _show_gait(library: GaitLibrary) -> None:
    """Print how a library walks, and how many of its steps hold."""
    allowed = library.allowed_pairs
    rows = [
        ("gait", library.family.name),
        *library.describe(),
        ("poses per layer", " / ".join(map(str, library.poses.counts))),
        ("pairs of poses that hold", f"{int(allowed.sum())} of {allowed.size - 1}"),
    ]
    print_table("Gait", ("", ""), rows)


def _show_verdicts(library: GaitLibrary) -> None:
    """Print the pass rates of steps, random schedules, and each kind of world."""
    gate, grid = library.qualification.gate, library.qualification.grid
    rows = [("every step, in random worlds", f"{int(library.pair_runs.sum())} walked")]
    if gate is not None:
        rows.append(("random schedules", gate.describe()))
    own = library.qualification.own
    if own is not None:
        rows.append(("in the robot's own model", own.describe()))
    if grid is None:
        rows.append(("grid of worlds", "not walked: `gaitchain qualify`"))
    proof = library.qualification.proof
    if proof is not None:
        total = f"{proof.total.falls} falls in {proof.total.steps} steps"
        rows.append(("proof", f"{total}: {proof.describe()}"))
    print_table("Verdicts", ("", ""), rows)
    if grid is not None:
        heads = ("world", "required", "commands", "every step")
        title = "On the grid of worlds, walks that held"
        print_table(title, heads, _kinds(grid.cells))
        say(f"steps taken out by the grid: {len(grid.taken_out)}")


def _kinds(cells: Sequence[CellReport]) -> list[tuple[str, str, str, str]]:
    """Sum up the cells of each kind of disturbance."""
    kinds: dict[tuple[str, bool], list[CellReport]] = {}
    for cell in cells:
        kinds.setdefault((cell.kind, cell.required), []).append(cell)
    rows = []
    for (kind, required), same in kinds.items():
        label = DISTURBANCES[kind].label if kind in DISTURBANCES else kind
        levels = ", ".join(c.name.removeprefix(label).strip() for c in same)
        runs, passes = sum(c.runs for c in same), sum(c.passes for c in same)
        steps = np.sum([c.groups.get(EVERY_STEP, (0, 0)) for c in same], axis=0)
        name = "all mild levels at once" if kind == "corner" else f"{label} {levels}"
        held = f"{passes}/{runs}", f"{steps[1]}/{steps[0]}"
        rows.append((name.strip(), "yes" if required else "", *held))
    return rows


def _show_origin(library: GaitLibrary) -> None:
    """Say where the robot's file is missed, without which it is drawn in boxes."""
    try:
        check_origin(library.config.robot)
    except RobotFileError as missing:
        say(str(missing))


def _show_config(library: GaitLibrary) -> None:
    """Print the build config of a library, without defaults."""
    config = asdict(library.config)
    usual = asdict(BuildConfig(robot=library.config.robot))
    rows = [
        (name, f"{value}")
        for name, value in config.items()
        if name in ("robot", "preset", "seed") or value != usual.get(name)
    ]
    print_table("Built from", ("", ""), [*rows, ("all else", "by default")])
