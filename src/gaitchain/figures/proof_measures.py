"""Sections of a proof's report on pushes, stops and falls, and the maps. Ours."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gaitchain.build.families import build_of
from gaitchain.build.push import PushResult
from gaitchain.figures.page import add, picture, table
from gaitchain.figures.robustness import plot_pass_rates, plot_pushes
from gaitchain.gait.library import GaitLibrary
from gaitchain.proof.falls import FallsReport
from gaitchain.proof.measures import Measures
from gaitchain.proof.push_limit import Impulse, PushLimit
from gaitchain.sim.world import DISTURBANCES


class _Maps(NamedTuple):
    worlds: str = "worlds.png"
    pushes: str = "pushes.png"


MAPS = _Maps()
"""File names of the maps."""
_SIDES = {0.0: "ahead", 90.0: "to the left", 180.0: "back", 270.0: "to the right"}
_PUSH_HEADS = ("pushed", "walks", "J50 [N s]", "J5 [N s]", "J50 / m sqrt(g h)")
_STOP_HEADS = (
    "of those that came to a stand",
    "half, within",
    "19 in 20, within",
    "all, within",
)
_MAP = (
    "Commands in the grid of worlds by which the library was qualified before; bold "
    "rows are mild worlds, in which it had to hold. Other rows show where it ends."
)
_NO_MAP = (
    "There is none: the library was not walked in a grid of worlds, so that nothing "
    "shows where it ends. `gaitchain qualify LIBRARY`, without --bound, walks one."
)
_UNKNOWN = "not known"
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
        plot_pass_rates(grid.cells, library.robot.name, files[MAPS.worlds])
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
        f"One push of 0.1 s on the trunk while it walks {measures.speed_mps:.2f} m/s "
        "ahead, at a random moment of the step, in a world drawn for each walk: "
        f"{_drawn(library)}. J50 is the impulse after which half of the walks fall, J5 "
        "that after which one in twenty does; in brackets 95 % intervals. The impulses "
        "that fell each walk are taken for log-normal, which J5 depends on.",
    )
    scale = measures.scale_ns
    table(body, _PUSH_HEADS, (_push_row(p, scale) for p in measures.pushes))
    for said in _apart(measures.pushes):
        add(body, "p", said)
    alt = "Impulse after which half of the walks fall, by direction."
    picture(body, pictures[MAPS.pushes], alt)


def worlds_section(body: Any, pictures: Mapping[str, Path]) -> None:
    """Append the map of worlds, or that there is none."""
    add(body, "h2", "Map of worlds")
    if MAPS.worlds not in pictures:
        add(body, "p", _NO_MAP)
        return
    add(body, "p", _MAP)
    alt = "Walks that held, a row for each world, a column for each command."
    picture(body, pictures[MAPS.worlds], alt)


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


def falls_section(body: Any, measures: Measures) -> None:
    """Append why it falls, and with what energy."""
    drop = measures.drop
    add(body, "h2", "What falls are like")
    add(
        body,
        "p",
        f"Standing, its {drop.mass_kg:.1f} kg have their centre {drop.com_m:.2f} m "
        f"high: m g h = {drop.potential_j:.0f} J, which a fall to the floor cannot "
        "exceed but for what the robot has by its motion and by a push. Measured until "
        "the trunk is down, while the servos hold their last targets:",
    )
    for falls in measures.falls:
        add(body, "h3", f"{falls.origin}: {falls.falls} falls in {falls.walks}")
        if falls.measured < falls.falls:
            add(body, "p", _SOME.format(falls.measured))
        if falls.measured:
            _fall_tables(body, falls)


def _fall_tables(body: Any, falls: FallsReport) -> None:
    causes = ((cause, f"{count}") for cause, count in falls.causes)
    table(body, ("the rule that broke first", "falls"), causes)
    rows = []
    for name, unit, pair in (
        ("kinetic energy before the impact", "J", falls.kinetic_j),
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
