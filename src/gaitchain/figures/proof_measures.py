"""Sections of a proof's report on pushes, stops and falls, and the maps. Ours."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from gaitchain.analysis.rules import MEANINGS
from gaitchain.build.families import build_of
from gaitchain.build.grid import EVERY_STEP
from gaitchain.build.push import PushResult
from gaitchain.figures.page import add, picture, table
from gaitchain.figures.proof_scope import CORNER, with_impulse
from gaitchain.figures.robustness import plot_pass_rates, plot_pushes
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import CellReport, GridReport
from gaitchain.proof.falls import FallsReport
from gaitchain.proof.measures import Measures
from gaitchain.proof.push_limit import Impulse, PushLimit
from gaitchain.sim.push import Push
from gaitchain.sim.world import DISTURBANCES


class _Maps(NamedTuple):
    worlds: str = "worlds.png"
    pushes: str = "pushes.png"


MAPS = _Maps()
"""File names of the maps."""
_SIDES = {0.0: "ahead", 90.0: "to the left", 180.0: "back", 270.0: "to the right"}
_PUSH_HEADS = ("pushed towards", "walks", "J50 [N s]", "J5 [N s]", "J50 / m sqrt(g h)")
_STOP_HEADS = (
    "of those that came to a stand",
    "half, within",
    "19 in 20, within",
    "all, within",
)
_MAP = (
    "The grid of worlds by which the library was qualified before the proof: a column "
    "for each kind of command; in each field the walks that held, which is that the "
    "robot did not fall, of those that were made. Bold rows are the world nominal and "
    "mild worlds of one disturbance: of all walks in one {:.0f} % had to hold."
)
_HARDER = (
    "Other rows of one disturbance are beyond the mild worlds, and show where it ends."
)
_NO_HARDER = (
    "No world was harder than the mild ones, so that nothing here shows where it ends: "
    "`gaitchain qualify LIBRARY` without --quick and --bound walks such worlds."
)
_CORNERS = (
    'Rows "all mild" have the mild levels of all disturbances at once, of those with '
    "several levels the first or the last. It did not have to hold there, and they are "
    "no part of the verdict. What came: {}."
)
_NO_MAP = (
    "There is none: the library was not walked in a grid of worlds, so that nothing "
    "shows where it ends. `gaitchain qualify LIBRARY`, without --bound, walks one."
)
_UNKNOWN = "not known"
_TWENTY = 20  # walks, of which one is a twentieth
_CAUSES = (
    "What came before each of these falls: of the rules that a good walk keeps, the "
    "one that broke first."
)
_CAUSE_HEADS = "the rule that broke first", "falls", "what it means"
_SOME = "{} of these falls were walked again and measured:"
_FALL_HEADS = ("", "median", "largest")


def draw_maps(
    library: GaitLibrary, measures: Measures, folder: Path
) -> dict[str, Path]:
    """Draw what walks withstand of pushes, and of worlds if a grid was walked.

    Args:
        library: with its verdicts.
        measures: what was measured.
        folder: for the PNGs.

    Returns:
        The files by their names.
    """
    files = {MAPS.pushes: folder / MAPS.pushes}
    title = f"{library.robot.name} walking {measures.speed_mps:.2f} m/s"
    plot_pushes(
        [_result(p) for p in measures.pushes],
        title,
        measures.scale_ns,
        files[MAPS.pushes],
        "95 % interval of it",
    )
    grid = library.qualification.grid
    if grid is not None:
        files[MAPS.worlds] = folder / MAPS.worlds
        cells = [
            replace(cell, name=with_impulse(cell, measures.scale_ns))
            for cell in grid.cells
        ]
        plot_pass_rates(cells, library.robot.name, files[MAPS.worlds])
    return files


def pushes_section(
    body: Any,
    library: GaitLibrary,
    measures: Measures,
    pictures: Mapping[str, Path],
) -> None:
    """Append what walks withstand of pushes."""
    add(body, "h2", "Pushes")
    add(
        body,
        "p",
        f"One push of {Push.duration_s:g} s on the trunk while it walks "
        f"{measures.speed_mps:.2f} m/s ahead, at a random moment of the step, in a "
        "world drawn for each walk, not one of those above: "
        f"{_drawn(library)}, all of it at once. J50 is the impulse after which half of "
        "the walks fall, J5 that after which one in twenty does; in brackets 95 % "
        "intervals. The impulses that fell each walk are taken for log-normal, which "
        f"J5 depends on. m sqrt(g h), see above, is {measures.scale_ns:.1f} N s; by it "
        "robots of other sizes can be compared.",
    )
    scale = measures.scale_ns
    table(body, _PUSH_HEADS, (_push_row(p, scale) for p in measures.pushes))
    least = min(p.walks for p in measures.pushes)
    if least < _TWENTY:
        said = f"Of {least} walks from a side none is one in twenty: J5 is worked out."
        add(body, "p", said)
    for said in _apart(measures.pushes):
        add(body, "p", said)
    alt = "Impulse after which half of the walks fall, by direction."
    picture(body, pictures[MAPS.pushes], alt)


def worlds_section(
    body: Any, grid: GridReport | None, pictures: Mapping[str, Path]
) -> None:
    """Append the map of worlds, or that there is none."""
    add(body, "h2", "Map of worlds")
    if grid is None:
        add(body, "p", _NO_MAP)
        return
    add(body, "p", f"{_MAP.format(100.0 * grid.share)} {_beyond(grid)}")
    corners = [cell for cell in grid.cells if cell.kind == CORNER]
    if corners:
        add(body, "p", _CORNERS.format("; ".join(map(_held, corners))))
    alt = "Walks that held, a row for each world, a column for each command."
    picture(body, pictures[MAPS.worlds], alt)


def _beyond(grid: GridReport) -> str:
    """Say whether worlds harder than the mild ones were walked."""
    alone = (cell for cell in grid.cells if cell.kind != CORNER)
    return _NO_HARDER if all(cell.required for cell in alone) else _HARDER


def _held(cell: CellReport) -> str:
    """Say how many walks held in a world."""
    runs, passes = cell.groups.get(EVERY_STEP, (0, 0))
    said = f"{cell.name}: {cell.passes} of {cell.runs} walks of commands held"
    return f"{said}, and {passes} of {runs} that visit every step" if runs else said


def stops_section(body: Any, measures: Measures) -> None:
    """Append how it stops."""
    stops = measures.stops
    add(body, "h2", "Stopping")
    if stops is None:
        said = "Commands of this gait count steps; it stands after the last of them."
        add(body, "p", said)
        return
    add(
        body,
        "p",
        f"From the command 0 until the last step is over, in {stops.walks} walks in "
        f"the worlds above, at random commands; {stops.stood} of them came to a stand, "
        f"{stops.fell} fell, {stops.walks - stops.stood - stops.fell} never stood "
        "still. This is no emergency stop: the robot balances, and steps until it "
        "stands.",
    )
    if stops.stood:
        seconds = ("time", *(f"{x:.2f} s" for x in stops.seconds))
        metres = ("way of the trunk", *(f"{x:.2f} m" for x in stops.metres))
        table(body, _STOP_HEADS, (seconds, metres))
    if 0 < stops.stood < _TWENTY:
        said = f"Of {stops.stood} walks the slowest counts as 19 in 20."
        add(body, "p", said)


def falls_section(body: Any, measures: Measures) -> None:
    """Append why it falls, and with what energy."""
    drop = measures.drop
    add(body, "h2", "What falls are like")
    add(
        body,
        "p",
        f"Standing, its {drop.mass_kg:.1f} kg have their centre {drop.com_m:.2f} m "
        f"high: m g h = {drop.potential_j:.0f} J is what the height alone can give. A "
        "walk and a push add to it. Measured until the trunk is down, while the servos "
        "hold their last targets:",
    )
    for falls in measures.falls:
        add(body, "h3", f"{falls.origin}: {falls.falls} falls in {falls.walks}")
        if falls.measured < falls.falls:
            add(body, "p", _SOME.format(falls.measured))
        if falls.measured:
            _fall_tables(body, falls)


def _fall_tables(body: Any, falls: FallsReport) -> None:
    add(body, "p", _CAUSES)
    meant = {rule.value: meaning for rule, meaning in MEANINGS.items()}
    causes = ((c, f"{count}", meant.get(c, "")) for c, count in falls.causes)
    table(body, _CAUSE_HEADS, causes)
    rows = []
    for name, unit, pair in (
        ("kinetic energy before the trunk is down, at most", "J", falls.kinetic_j),
        ("speed of the top of the trunk", "m/s", falls.head_mps),
    ):
        rows.append((name, *(f"{x:.3g} {unit}" for x in pair or ())))
    table(body, _FALL_HEADS, rows)


def _drawn(library: GaitLibrary) -> str:
    """Say of which worlds `draw_world` draws one for each walk that is pushed."""
    worlds, shared = build_of(library.poses).trial_worlds()
    said = [
        f"{DISTURBANCES[name].label} {span[0]:g} to {span[1]:g}"
        for name, span in worlds.numbers.items()
        if isinstance(span, tuple) and span[0] < span[1]
    ]
    said += (f"{DISTURBANCES[n].show(v)} off at most" for n, v in shared.items())
    return ", ".join(said)


def _apart(limits: Sequence[PushLimit]) -> Iterator[str]:
    """Say which walks no impulse was found for."""
    walks = sum(p.walks for p in limits)
    alone, most = (
        sum(getattr(p, n) for p in limits) for n in ("fell_alone", "withstood")
    )
    if alone:
        yield (
            f"{alone} of {walks} walks fell without a push: J50 and J5 are of the "
            "others, and of none where fewer than two are left."
        )
    if most:
        yield f"{most} walks withstood the hardest push and count as if it fell them."


def _push_row(limit: PushLimit, scale_ns: float) -> tuple[str, ...]:
    side = _SIDES.get(limit.direction_deg, f"{limit.direction_deg:g} deg")
    part = _UNKNOWN if limit.j50 is None else f"{limit.j50.ns / scale_ns:.3f}"
    return side, f"{limit.walks}", _interval(limit.j50), _interval(limit.j5), part


def _interval(impulse: Impulse | None) -> str:
    if impulse is None:
        return _UNKNOWN
    return f"{impulse.ns:.1f} ({impulse.low:.1f} to {impulse.high:.1f})"


def _result(limit: PushLimit) -> PushResult:
    j50 = limit.j50 or Impulse(math.nan, math.nan, math.nan)
    ends = j50.low, j50.high
    return PushResult(limit.direction_deg, j50.ns, ends, limit.critical_ns)
