"""What was proven of a library, for somebody who knows none of the code: HTML, JSON."""

import hashlib
import math
import platform
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from gaitchain.build.journal import PACKAGES
from gaitchain.errors import CommandError, LibraryError, file_errors
from gaitchain.figures.page import add, bullets, picture, table
from gaitchain.figures.proof_measures import (
    draw_maps,
    falls_section,
    pushes_section,
    stops_section,
    worlds_section,
)
from gaitchain.figures.proof_robot import (
    file_origin,
    robot_origin,
    robot_section,
)
from gaitchain.figures.style import FEET, PLANNED, drawing, write_json
from gaitchain.gait.command_range import AXES
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import ProofReport, StepStratum, Stratum
from gaitchain.proof.fall_rate import describe_before, describe_chosen, walk_length
from gaitchain.proof.measures import Measures, measure_seeds
from gaitchain.proof.proof_walks import BANK, CHOSEN, Criterion, mild_cells, seed_of
from gaitchain.proof.step_strata import SELDOM
from gaitchain.sim.truth import FALL_HEIGHT, FALL_TILT
from gaitchain.sim.world import DISTURBANCES, World

PAGE, NUMBERS, PICTURE = "report.html", "report.json", "rates.png"
_UNKNOWN = 0.5  # falls per step; an interval that ends higher tells nothing
_HEADS = ("walks", "number", "steps", "falls", "falls per step", "one fall in")
_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;"
    "padding:0 1rem;color:#1b1e22;background:#fff}table{border-collapse:collapse;"
    "margin:.5rem 0}td,th{padding:.2rem .8rem .2rem 0;text-align:left;border-bottom:"
    "1px solid #ccd}img{max-width:100%}.verdict{font-size:1.2rem;padding:.6rem 1rem;"
    "border-left:6px solid #1f6fb4;background:#eef3f8}code{word-break:break-all}"
    "body{overflow-wrap:break-word}.wide{overflow-x:auto}"
    ".pairs td+td{overflow-wrap:anywhere}"
)
_VERDICTS = {
    "below": "It falls in fewer than {bound} of its steps, with {sure} confidence.",
    "above": "It falls in more than {bound} of its steps, with {sure} confidence.",
    "open": "Whether it falls in fewer than {bound} of its steps is not known: the "
    "walks that were allowed did not suffice.",
}
_FIXED = "Criterion, fixed before the first walk"
_CHOSEN_LATER = "Criterion, chosen after walks had been seen"
_STRATA = (
    "The criterion is of all walks. Rows below the first divide them by the model of "
    "the contact, the kind of the disturbance and its level; they are for information, "
    "and both ends of their intervals, wider for it, hold all together with that "
    "confidence. In the first row each end holds for itself with it, as the verdict."
)
_ASKED = {
    "friction": "friction",
    "slope_deg": "slope",
    "blocks_m": "blocks on the ground",
    "contact_s": "softness of the ground",
    "payload": "payload",
    "mass": "mass of the links, times",
}
_ONLY = "nominal only: "
_SIMPLIFIED = (
    "a simplified robot: legs as in its file, all else one rigid body, arms still, "
    "soles as boxes, or by their corners where they taper"
)
_NOT_TESTED = (
    "Any real robot: all of this is simulation, and what it leaves out may make a "
    "robot fall.",
    f"The whole robot: what walked is {_SIMPLIFIED}. What its own model did, if it "
    'has one, is under "Second model", and no part of the verdict.',
    "Ground, loads and disturbances outside the worlds of the table, such as carpets, "
    "stairs, people, and faults of servos and cables.",
    "What a fall breaks, and whom it hurts: only its energy is measured, of a robot of "
    "boxes that are hard and do not break, falling on an empty floor.",
    "What a push on anything else than the trunk does, and one longer than 0.1 s.",
    "Each world for itself: the verdict is of all of them together, each as often as "
    "any other. The same holds for the steps of the chain.",
)
_LOWERED = "Walks with lowered hips, which commands may ask for, up to {:.0f} mm."


def write_report(
    library: GaitLibrary, criterion: Criterion, measures: Measures, folder: Path
) -> list[Path]:
    """Write the report of a library's proof into a folder.

    Args:
        library: with a proof.
        criterion: that of the proof.
        measures: what was measured beside it.
        folder: for report.html, which needs no other file, report.json and the PNGs.

    Returns:
        The files.

    Raises:
        LibraryError: nothing was proven of the library.
        CommandError: a file cannot be written.
    """
    proof = library.qualification.proof
    if proof is None:
        raise LibraryError(
            f"the library for {library.robot.name} has no proof: "
            "`gaitchain qualify LIBRARY --bound 1e-4` makes one"
        )
    page, numbers, rates = (folder / name for name in (PAGE, NUMBERS, PICTURE))
    _draw(proof, rates)
    maps = draw_maps(library, measures, folder)
    facts = _facts(library, proof, criterion, measures)
    write_json(numbers, facts)
    pictures = {PICTURE: rates} | maps
    report = _Report(library, proof, criterion, measures, facts, pictures)
    with file_errors(page, "written", CommandError):
        page.write_text(f"<!doctype html>\n{report.html()}\n", "utf-8")
    return [page, numbers, rates, *maps.values()]


def _facts(
    library: GaitLibrary,
    proof: ProofReport,
    criterion: Criterion,
    measures: Measures,
) -> dict[str, Any]:
    found = library.robot.identified
    return {
        "robot": library.robot.name,
        "identified": None if found is None else found.facts(),
        "origin": dict(_origin(library)),
        "commands": {axis: getattr(library.command_range, axis) for axis in AXES},
        "conditions": dict(_conditions(library)),
        "own_model": _own_model(library),
        "only_in_simulation": True,
        "not_tested": list(_not_tested(library)),
        **asdict(proof),
        "most_steps": criterion.limit,
        "seeds": _seeds(library),
        "measure_seeds": measure_seeds(library.proven(None)),
        "measures": asdict(measures),
    }


def _not_tested(library: GaitLibrary) -> Iterator[str]:
    """Say what the walks of a proof leave out."""
    yield from _NOT_TESTED
    deepest = library.command_range.crouch[0]
    if deepest > 0.0:
        yield _LOWERED.format(1000.0 * deepest)


def _origin(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what was tested, and by what, as (name, value)."""
    unproven = library_bytes(library.proven(None))
    file, digest = file_origin(library)
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return [
        ("robot", library.robot.name),
        ("what walked", _SIMPLIFIED),
        ("robot's numbers", robot_origin(library.robot)),
        ("robot's numbers, hash", library.robot.fingerprint),
        ("robot's file", file),
        ("robot's file, SHA-256", digest),
        ("library without this proof, SHA-256", hashlib.sha256(unproven).hexdigest()),
        ("built by", f"gaitchain {library.version}"),
        ("report by", f"{packages}, Python {platform.python_version()}"),
    ]


def _draw(proof: ProofReport, path: Path) -> None:
    """Draw the interval of each stratum's rate, on a logarithmic axis."""
    strata = _strata(proof)
    low = np.array([max(s.low, _floor(strata)) for s in strata])
    high = np.array([s.high for s in strata])
    rows = np.arange(len(strata))
    with drawing(path, 7.0, 1.2 + 0.22 * len(strata)) as figure:
        axes = figure.add_subplot()
        axes.hlines(rows, low, high, color=FEET[0], linewidth=3.0)
        axes.plot(high, rows, "|", color=FEET[0], markersize=9.0)
        axes.axvline(proof.bound, color=PLANNED, linestyle="--", linewidth=1.0)
        axes.set_xscale("log")
        axes.set_yticks(rows, [s.name for s in strata])
        axes.invert_yaxis()
        axes.set_xlabel(
            "falls per step that the walks leave possible,\n"
            "dashed: the bound; other rows than the first hold together"
        )


def _floor(strata: Sequence[Stratum]) -> float:
    """Return a rate below all that can be told."""
    return 0.1 / max(s.steps for s in strata)


class _Report(NamedTuple):
    """All that the page is made of."""

    library: GaitLibrary
    proof: ProofReport
    criterion: Criterion
    measures: Measures
    facts: dict[str, Any]
    pictures: dict[str, Path]

    def html(self) -> str:
        root = ElementTree.Element("html", lang="en")
        head = ElementTree.SubElement(root, "head")
        title = f"How seldom {self.library.robot.name} falls in simulation"
        ElementTree.SubElement(head, "meta", charset="utf-8")
        width = "width=device-width, initial-scale=1"
        ElementTree.SubElement(head, "meta", name="viewport", content=width)
        add(head, "title", title)
        add(head, "style", _STYLE)
        body = ElementTree.SubElement(root, "body")
        add(body, "h1", title)
        add(body, "p", _verdict(self.proof)).set("class", "verdict")
        self._before(body)
        self._result(body)
        self._measured(body)
        add(body, "h2", "What was not tested")
        bullets(body, self.facts["not_tested"])
        self._repeat(body)
        return ElementTree.tostring(root, encoding="unicode", method="html")

    def _before(self, body: Any) -> None:
        """Append what was tested, and by which criterion."""
        add(body, "h2", "What was tested")
        table(body, (), self.facts["origin"].items())
        robot_section(body, self.library.robot)
        add(body, "h2", "Declared use")
        _uses(body, self.library, self.proof)
        before = self.proof.before
        add(body, "h2", _CHOSEN_LATER if before else _FIXED)
        add(body, "p", _criterion(self.criterion))
        if before:
            add(body, "p", describe_before(before))

    def _result(self, body: Any) -> None:
        proof = self.proof
        add(body, "h2", "What came")
        add(body, "p", _STRATA)
        if proof.chosen:
            said = f"{describe_chosen(proof.chosen)} They are in the rows of their own"
            add(body, "p", f"{said} world or model alone.")
        table(body, _HEADS, map(_row, _strata(proof)))
        picture(
            body,
            self.pictures[PICTURE],
            "Interval of the falls per step in each world; the table has the numbers.",
        )
        _steps(body, proof)
        _second_model(body, self.library, proof)

    def _measured(self, body: Any) -> None:
        """Append what was measured beside the criterion."""
        pushes_section(body, self.library, self.measures, self.pictures)
        stops_section(body, self.measures)
        falls_section(body, self.measures)
        worlds_section(body, self.pictures)

    def _repeat(self, body: Any) -> None:
        proof = self.proof
        add(body, "h2", "How to repeat it")
        seeds = "Seeds follow from the library: the same one gives the same walks. "
        add(body, "p", f"{seeds}Walk n, from 0 to {proof.total.walks - 1}, has these:")
        table(body, (), self.facts["seeds"].items())
        if proof.chosen:
            add(body, "p", _chosen_numbers(proof))
        add(body, "p", "Walk n of what was measured beside it, from 0 on, has these:")
        table(body, (), self.facts["measure_seeds"].items())
        words = f"gaitchain qualify LIBRARY --bound {proof.bound:g}"
        words += f" --confidence {proof.confidence:g} --seconds {proof.seconds:g}"
        words += f" --most-steps {self.criterion.limit}"
        add(body, "p", "The command:")
        words += " --report DIR -o FILE"
        add(body, "code", f"{words} --report-walks {self.measures.pushes[0].walks}")


def _seeds(library: GaitLibrary) -> dict[str, str]:
    """Return the seeds of walk n by what is drawn with them."""
    seed = f"{seed_of(library)}, {BANK}, n"
    return {
        "numbers of its world": f"({seed})",
        "commands, and which world and contact model": f"({seed}, 1)",
    }


def _chosen_numbers(proof: ProofReport) -> str:
    """Say which numbers those walks have whose world or contact model was no draw."""
    return (
        f"Where none was drawn for it, walk {CHOSEN} + i is in world i of the list "
        f"above, from 0 on, and walk {CHOSEN + len(proof.worlds)} + j with contact "
        "model j; the rest of these walks is drawn with the seeds of their number."
    )


def _verdict(proof: ProofReport) -> str:
    words = _VERDICTS[proof.verdict].format(
        bound=f"{proof.bound:g}", sure=f"{100.0 * proof.confidence:g} %"
    )
    total, more = proof.total, proof.chosen
    words += f" It walked {total.steps} steps in {total.walks} walks, and fell "
    words += f"{total.falls} times."
    if more:
        words += f" Of {len(more.names)} more walks, where none was drawn, "
        words += f"{more.falls} fell."
    if proof.before:
        words += " Walks had been seen before this bound was chosen."
    return f"{words} In simulation only."


def _uses(body: Any, library: GaitLibrary, proof: ProofReport) -> None:
    span = library.command_range
    rows = [
        ("speed ahead", f"{span.vx[0]:.3f} to {span.vx[1]:.3f} m/s"),
        ("to the left", f"{span.vy[0]:.3f} to {span.vy[1]:.3f} m/s"),
        ("turning", f"{span.yaw_rate[0]:.2f} to {span.yaw_rate[1]:.2f} rad/s"),
        ("commands", f"random over that range, walks of {walk_length(library, proof)}"),
        *_conditions(library),
    ]
    table(body, (), rows)
    add(body, "p", "Worlds, one drawn for each walk, each as often as any other:")
    bullets(body, (world.name for world in proof.worlds))
    names = " and ".join(contact.name for contact in proof.contacts)
    add(body, "p", f"Models of the contact, one drawn for each walk: {names}.")


def _conditions(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what a user asks for, from the mild worlds, as (name, value)."""
    levels: dict[str, list[float]] = {}
    for cell in mild_cells(library.proven(None)):
        for kind, level in cell.numbers:
            levels.setdefault(kind, []).append(level)
    nominal = World()
    rows = []
    for kind, name in _ASKED.items():
        plain = getattr(nominal, kind)
        found = sorted({*levels.get(kind, []), float(plain or 0.0)})
        shown = [DISTURBANCES[kind].show(level) for level in found]
        rows.append((name, ", ".join(shown) if levels.get(kind) else _ONLY + shown[0]))
    return rows


def _criterion(criterion: Criterion) -> str:
    return (
        f"Falls per step against a bound of {criterion.bound:g}. After each walk a "
        "sequential test asks whether fewer, or more, is sure; it stops as soon as one "
        f"is, and without a verdict after {criterion.limit} steps. With a probability "
        f"of at most {1.0 - criterion.confidence:.3g} it says what is not so, however "
        "often it looks. A robot has fallen when its hips are below "
        f"{FALL_HEIGHT:g} of their height, or its trunk leans by "
        f"{math.degrees(FALL_TILT):g} deg."
    )


def _strata(proof: ProofReport) -> list[Stratum]:
    return [proof.total, *proof.contacts, *proof.kinds, *proof.worlds]


def _steps(body: Any, proof: ProofReport) -> None:
    steps, few = proof.steps, len(proof.steps.seldom)
    add(body, "h3", "Steps of the chain")
    said = (
        f"Of the {steps.allowed} steps that it may make, {steps.walked} were walked, "
    )
    said += f"{few} of them less than {SELDOM} times."
    if steps.high:
        least, middle, most = steps.high
        said += (
            " Falls per visit of a walked step are, with that confidence for all of "
            f"them together, below {middle:.2g} for half of the steps, below "
            f"{least:.2g} for the best and {most:.2g} for the worst known one."
        )
    add(body, "p", said)
    if steps.fell_on:
        heads = "step from", "to", "walked", "falls", "falls per visit"
        add(body, "p", "Steps in which it fell:")
        table(body, heads, map(_step_row, steps.fell_on))
    if steps.never:
        folded = ElementTree.SubElement(body, "details")
        add(folded, "summary", f"{len(steps.never)} steps that were never walked")
        add(folded, "p", ", ".join(f"{a} to {b}" for a, b in steps.never))


def _step_row(step: StepStratum) -> tuple[str, ...]:
    numbers = map(str, (step.first, step.last, step.walked, step.falls))
    return *numbers, f"{step.low:.2g} to {step.high:.2g}"


def _row(stratum: Stratum) -> tuple[str, ...]:
    often = f"more than {1.0 / stratum.high:,.0f} steps".replace(",", " ")
    if stratum.high > _UNKNOWN:
        often = "not known"
    return (
        stratum.name,
        f"{stratum.walks}",
        f"{stratum.steps}",
        f"{stratum.falls}",
        f"{stratum.low:.2g} to {stratum.high:.2g}",
        often,
    )


def _second_model(body: Any, library: GaitLibrary, proof: ProofReport) -> None:
    add(body, "h2", "Second model")
    cones = "; ".join(
        f"{s.name}: {s.falls} falls in {s.steps} steps" for s in proof.contacts
    )
    add(body, "p", f"Two models of the contact with the ground. {cones}.")
    add(body, "p", _own_model(library)["verdict"])


def _own_model(library: GaitLibrary) -> dict[str, Any]:
    """Return what the robot's own model did: a sentence, and the numbers."""
    own = library.qualification.own
    if own is None:
        said = "The robot's file has no model of its own that could be walked as well."
    elif own.fault:
        said = f"The robot's own model could not be walked: {own.fault}."
    else:
        said = (
            f"The robot's own model, as its file has it: {own.survived} of "
            f"{own.schedules} schedules without a fall, at the end of the build."
        )
    return {"verdict": said, "found": None if own is None else asdict(own)}
