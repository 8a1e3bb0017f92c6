"""What the walks of a proof had, and what they leave out, for strangers. Ours."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from gaitchain.build.grid import Cell
from gaitchain.figures.page import add, table
from gaitchain.gait.command_range import SHARED, CommandRange, ends_text, inward
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import CellReport, ProofReport
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.proof.fall_rate import walk_length
from gaitchain.proof.proof_walks import mild_cells
from gaitchain.proof.tally import kind_label
from gaitchain.sim.push import Push
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.sim.world_draws import NOISE_BIAS, NOISE_SD

SIMPLIFIED = (
    "a simplified robot: legs as in its file, all else one rigid body, arms still, "
    "soles as boxes, or by their corners where they taper"
)
"""What walked."""
CORNER = "corner"
"""Kind of the grid's worlds that have all mild levels at once."""
_ASKED = {
    "friction": "friction coefficient of soles and floor",
    "slope_deg": "slope",
    "blocks_m": "blocks on the ground",
    "contact_s": "softness of the ground",
    "payload": "payload on the trunk, part of the robot's mass",
    "mass": "mass of the links, times",
}
_IMPULSES = "push", "punches"
_ONLY = "nominal only: "
_LEVELS = (
    "Surroundings and loads. One of them at a time was other than nominal in a walk, "
    "never two together:"
)
_ALONE = (
    "Each walk was in one of these worlds, drawn with equal chances, and so had one "
    "disturbance at a time; all else was as in the world nominal."
)
_TOGETHER_WITH = ' Two were there only where it says "together with".'
_DOUBTED = (
    " Besides, each walk had errors of the robot as its log leaves them possible, see "
    "above."
)
_AT_MOST = (
    'Errors "at most" are drawn for each walk and each link, joint or axis, uniformly. '
)
_TERMS = (
    "The CoM is the centre of mass; the IMU has the gyro and the accelerometer; the "
    "bus carries targets to the servos and angles back. m sqrt(g h), of the robot's "
    "mass m and the height h of its CoM where it stands, is {:.1f} N s for this robot."
)
_WORLD_HEADS = "world", "what its walks had"
_NOMINAL = (
    "The robot as described above, without further errors, on a level and even floor "
    f"of friction {World.friction:g}."
)
# Where the help of an option speaks of how it is written, or leaves a unit open.
_MEANT = {
    "noise": (
        "Noise of the sensors, at level 1 with standard deviations of {:g} rad for "
        "angles and {:g} rad/s for speeds of joints, {:g} rad/s for the gyro and {:g} "
        "m/s^2 for the accelerometer; and a bias of the gyro of {:g} rad/s."
    ).format(*NOISE_SD, NOISE_BIAS),
    "push": (
        f"Pushes of {Push.duration_s:g} s on the trunk, level, from random sides, "
        "about every 2 s, or two steps if these take longer; each of this impulse."
    ),
    "no_load": (
        "Speed at which servos have no torque left, over their speed limit; in other "
        "worlds the torque limit is the same at any speed."
    ),
    "target_step_deg": "Servos round the angles that they are told to steps of this.",
    "bus_hz": (
        "Rate at which joints are read and targets are sent; in other worlds that of "
        f"the control, {1.0 / CONTROL_PERIOD_S:g} Hz."
    ),
    "slope_deg": (
        "The floor rises (+) or falls (-) by this in the direction that the robot "
        "faces as the walk starts."
    ),
}
_TOGETHER = (
    "Disturbances together, such as a slope with little friction, or worn servos and a "
    "push: each walk had one at a time."
)
_CORNERS = (
    ' The rows "all mild" under "Map of worlds" are of all at once, and no part of the '
    "verdict."
)
_SIDEWAYS = (
    "Slopes to the side as the walk starts: the floor rises or falls ahead, and the "
    "robot has it aside only as far as commands turn it."
)
_NOT_TESTED = (
    "Any real robot: all of this is simulation, and what it leaves out may make a "
    "robot fall.",
    f"The whole robot: what walked is {SIMPLIFIED}. What its own model did, if it "
    'has one, is under "Second model", and no part of the verdict.',
    "Ground, loads and levels outside the worlds of the table, such as carpets, "
    "stairs, and people in the way.",
    "Faults of servos, sensors, bus and cables other than those of the worlds above, "
    "such as one that fails.",
    "What a fall breaks, and whom it hurts: only its energy is measured, of a robot of "
    "boxes that are hard and do not break, falling on an empty floor.",
    "What a push on anything else than the trunk does, and one longer than "
    f"{Push.duration_s:g} s.",
    "Any one world: the verdict is of walks in all worlds, mixed in equal parts, and "
    "in one of them the robot may fall more often. What is known of that world alone "
    "is in its row of the table. The same holds for the steps of the chain.",
)
_TIME = (
    "What comes with time, such as heat, wear and an empty battery: walks lasted {}."
)
_LOWERED = "Walks with lowered hips, which commands may ask for, up to {:.3f} m."


def not_tested(library: GaitLibrary, proof: ProofReport) -> Iterator[str]:
    """Say what the walks of a proof leave out."""
    real, *others = _NOT_TESTED
    grid = library.qualification.grid
    corners = any(cell.kind == CORNER for cell in grid.cells) if grid else False
    yield real
    yield _TOGETHER + _CORNERS * corners
    if any(cell.kind == "slope_deg" for cell in mild_cells(library.proven(None))):
        yield _SIDEWAYS
    yield from others
    yield _TIME.format(walk_length(library, proof))
    deepest = library.command_range.crouch[0]
    if deepest > 0.0:
        yield _LOWERED.format(inward(deepest))


def uses_section(
    body: Any, library: GaitLibrary, proof: ProofReport, scale_ns: float
) -> None:
    """Append commands, surroundings and worlds that were walked.

    Args:
        body: the page's.
        library: with the proof.
        proof: of the library.
        scale_ns: m sqrt(g h) [N s].
    """
    add(body, "h2", "Declared use")
    span = library.command_range
    rows = [
        ("speed ahead, back if negative", ends_text(*span.vx, "m/s")),
        ("speed to the left", ends_text(*span.vy, "m/s")),
        ("turning to the left", ends_text(*span.yaw_rate, "rad/s")),
        ("commands", f"random over that range, walks of {walk_length(library, proof)}"),
    ]
    table(body, (), rows)
    if shares(span):
        add(body, "p", shares(span))
    add(body, "p", _LEVELS)
    table(body, (), conditions(library))
    _worlds(body, library, proof, scale_ns)


def shares(span: CommandRange) -> str:
    """Say how the components of a command share their range; "" if there is but one."""
    if sum(low < high for low, high in span.ends) < 2:
        return ""
    return (
        f"Each of these ranges is of that motion alone. {SHARED} So half of the "
        "highest speed ahead leaves half of the other motions."
    )


def conditions(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what a user asks for, from the mild worlds, as (name, value)."""
    levels: dict[str, list[float]] = {}
    for cell in mild_cells(library.proven(None)):
        for kind, level in cell.numbers:
            levels.setdefault(kind, []).append(level)
    nominal = World()
    rows = []
    for kind, name in _ASKED.items():
        plain = float(getattr(nominal, kind) or 0.0)
        found = sorted({*levels.get(kind, []), plain})
        show = DISTURBANCES[kind].show
        shown = [show(x) + " (nominal)" * (x == plain) for x in found]
        only = _ONLY + show(plain)
        rows.append((name, ", ".join(shown) if levels.get(kind) else only))
    return rows


def meanings(library: GaitLibrary) -> dict[str, str]:
    """Return what the walks of each mild world had, by its name."""
    return {cell.name: _meaning(cell) for cell in mild_cells(library.proven(None))}


def with_impulse(cell: Cell | CellReport, scale_ns: float) -> str:
    """Return a world's name, with the impulse of its pushes.

    Args:
        cell: the world.
        scale_ns: m sqrt(g h), the unit of the pushes in its name [N s].
    """
    if cell.kind not in _IMPULSES:
        return cell.name
    return f"{cell.name} ({dict(cell.numbers)[cell.kind] * scale_ns:.1f} N s)"


def shown_names(library: GaitLibrary, scale_ns: float) -> dict[str, str]:
    """Return the names of the mild worlds `with_impulse`, by their plain names."""
    cells = mild_cells(library.proven(None))
    return {cell.name: with_impulse(cell, scale_ns) for cell in cells}


def lone_kinds(library: GaitLibrary) -> set[str]:
    """Return the names of kinds of disturbance that have one mild world alone."""
    cells = mild_cells(library.proven(None))
    counts = Counter(kind_label(cell.kind) for cell in cells)
    return {name for name, count in counts.items() if count == 1}


def _worlds(
    body: Any, library: GaitLibrary, proof: ProofReport, scale_ns: float
) -> None:
    add(body, "h3", "Worlds")
    doubted = library.robot.identified is not None
    meant, names = meanings(library), shown_names(library, scale_ns)
    rows = [(names.get(w.name, w.name), meant.get(w.name, "")) for w in proof.worlds]
    said = " ".join(words for _, words in rows).lower()
    together = _TOGETHER_WITH * ("together with" in said)
    add(body, "p", _ALONE + together + _DOUBTED * doubted)
    table(body, _WORLD_HEADS, rows)
    add(body, "p", _AT_MOST * ("at most" in said) + _TERMS.format(scale_ns))
    cones = " and ".join(contact.name for contact in proof.contacts)
    add(
        body,
        "p",
        "The simulator can compute the friction between soles and ground in two ways; "
        f"each walk had one of them, drawn with equal chances: {cones}.",
    )


def _meaning(cell: Cell) -> str:
    if cell.kind not in DISTURBANCES:
        return _NOMINAL
    said = _MEANT.get(cell.kind, _sentence(DISTURBANCES[cell.kind].help))
    others = (
        DISTURBANCES[kind].show(level)
        for kind, level in cell.numbers
        if kind != cell.kind
    )
    return said + "".join(f" Together with {other}." for other in others)


def _sentence(text: str) -> str:
    """Return an option's help without its unit, as levels have another one beside."""
    return re.sub(r" \[[^]]*\]", "", text)
