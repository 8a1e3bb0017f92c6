"""What was proven of a library, for somebody who knows none of the code: HTML, JSON."""

import hashlib
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from gaitchain.analysis.rules import MEANINGS
from gaitchain.build.journal import PACKAGES
from gaitchain.errors import CommandError, LibraryError, file_errors
from gaitchain.figures.page import add, bullets, picture, table
from gaitchain.figures.proof_measures import (
    MAPS,
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
from gaitchain.figures.proof_scope import (
    SIMPLIFIED,
    conditions,
    lone_kinds,
    meanings,
    not_tested,
    shares,
    shown_names,
    uses_section,
)
from gaitchain.figures.style import FEET, PLANNED, drawing, write_json
from gaitchain.gait.command_range import AXES
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import ProofReport, StepStrata, StepStratum, Stratum
from gaitchain.proof.fall_rate import (
    describe_before,
    describe_chosen,
    describe_unmet,
)
from gaitchain.proof.measures import Measures, measure_seeds
from gaitchain.proof.proof_walks import BANK, CHOSEN, Criterion, seed_of
from gaitchain.proof.rate_text import interval_text, upper_text
from gaitchain.proof.step_strata import SELDOM
from gaitchain.sim.truth import FALL_HEIGHT, FALL_TILT

PAGE, NUMBERS, PICTURE = "report.html", "report.json", "rates.png"
REPORT_FILES = (PAGE, NUMBERS, PICTURE, *MAPS)
"""All that a report may have."""
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
    "below": "In simulation, over {worlds} worlds mixed in equal parts: it falls in "
    "fewer than {bound} of its steps, with {sure} confidence: less often than once in "
    "{often} steps.",
    "above": "In simulation, over {worlds} worlds mixed in equal parts: it falls in "
    "more than {bound} of its steps, with {sure} confidence: more often than once in "
    "{often} steps.",
    "open": "Whether it falls, in simulation, in fewer than {bound} of its steps is "
    "not known: the walks that were allowed did not suffice.",
}
_CHAIN = (
    "The library has the poses in which a step may begin or end, each of them a way "
    "that the foot ahead is from the other one; they have numbers, from 0 on. A step "
    "leads from one pose to another. What the robot walks is a chain of such steps."
)
_OWN_ROWS = 'They are in the rows of their own world or model alone, as "+ 1".'
_SEEDED = (
    "Seeds follow from the library: the same one gives the same walks. They are those "
    "of NumPy's default_rng."
)
_FIXED = "Criterion, fixed before the first walk"
_ONE_OF_SEVERAL = "Criterion, not the only one by which walks were judged"
_STRATA = (
    "The criterion is of all walks. Rows below the first divide them by the model of "
    "the contact, by disturbances that have several levels, and by world; they are for "
    "information. Their intervals are true all at once with that confidence, and so "
    "wider than each would be alone. Each end of the first row's holds with that "
    'confidence by itself, as the verdict does. "not known" means that there are too '
    "few walks to tell."
)


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
    _draw(named_strata(library, proof, measures.scale_ns), proof.bound, rates)
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
        "commands_together": shares(library.command_range),
        "conditions": dict(conditions(library)),
        "world_meanings": meanings(library),
        "own_model": _own_model(library),
        "only_in_simulation": True,
        "not_tested": list(not_tested(library, proof)),
        **asdict(proof),
        "most_steps": criterion.limit,
        "seeds": _seeds(library),
        "measure_seeds": measure_seeds(library.proven(None)),
        "measures": asdict(measures),
        "causes": {rule.value: meaning for rule, meaning in MEANINGS.items()},
    }


def _origin(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what was tested, and by what, as (name, value)."""
    unproven = hashlib.sha256(library_bytes(library.proven(None))).hexdigest()
    file, digest = file_origin(library)
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return [
        ("robot", library.robot.name),
        ("what walked", SIMPLIFIED),
        ("robot's numbers", robot_origin(library.robot)),
        ("robot's numbers, hash", library.robot.fingerprint),
        ("robot's file", file),
        ("robot's file, SHA-256", digest),
        ("library of its gaits, without this proof, SHA-256", unproven),
        ("built by", f"gaitchain {library.version}"),
        ("walked and reported by", f"{packages}, Python {platform.python_version()}"),
        ("report made", f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
    ]


def _draw(rows: Sequence[tuple[str, Stratum]], bound: float, path: Path) -> None:
    """Draw the interval of each stratum's rate, on a logarithmic axis."""
    names, strata = zip(*rows, strict=True)
    low = np.array([max(s.low, _floor(strata)) for s in strata])
    high = np.array([s.high for s in strata])
    places = np.arange(len(strata))
    with drawing(path, 7.0, 1.2 + 0.22 * len(strata)) as figure:
        axes = figure.add_subplot()
        axes.hlines(places, low, high, color=FEET[0], linewidth=3.0)
        axes.plot(high, places, "|", color=FEET[0], markersize=9.0)
        axes.axvline(bound, color=PLANNED, linestyle="--", linewidth=1.0)
        axes.set_xscale("log")
        axes.set_yticks(places, names)
        axes.set_ylim(len(strata) - 0.5, -0.5)
        axes.set_xlabel(
            "falls per step that the walks leave possible,\n"
            "dashed: the bound; those below the first row are true all at once"
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
        uses_section(body, self.library, self.proof, self.measures.scale_ns)
        before = self.proof.before
        add(body, "h2", _ONE_OF_SEVERAL if before else _FIXED)
        add(body, "p", _criterion(self.criterion))
        if before:
            add(body, "p", describe_before(before))

    def _result(self, body: Any) -> None:
        proof = self.proof
        add(body, "h2", "What came")
        add(body, "p", _STRATA)
        if proof.chosen:
            add(body, "p", f"{describe_chosen(proof.chosen, proof)} {_OWN_ROWS}")
        named = named_strata(self.library, proof, self.measures.scale_ns)
        table(body, _HEADS, (_row(name, s, proof) for name, s in named))
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
        worlds_section(body, self.library.qualification.grid, self.pictures)

    def _repeat(self, body: Any) -> None:
        proof = self.proof
        add(body, "h2", "How to repeat it")
        last = proof.total.walks - 1
        add(body, "p", f"{_SEEDED} Walk n, from 0 to {last}, has these:")
        table(body, (), self.facts["seeds"].items())
        if proof.chosen:
            add(body, "p", _chosen_numbers(proof))
        add(body, "p", "Walks that are measured beside it have these, n from 0 on:")
        table(body, (), self.facts["measure_seeds"].items())
        words = f"gaitchain qualify LIBRARY --bound {proof.bound:g}"
        words += f" --confidence {proof.confidence:g} --seconds {proof.seconds:g}"
        words += f" --most-steps {self.criterion.limit}"
        said = "The command, with the library that has the hash above as LIBRARY:"
        add(body, "p", said)
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
    # Whole steps, rounded so that no more is said than what is sure.
    rounded = math.floor if proof.verdict == "below" else math.ceil
    words = _VERDICTS[proof.verdict].format(
        bound=f"{proof.bound:g}",
        sure=f"{100.0 * proof.confidence:g} %",
        often=_spaced(rounded(round(1.0 / proof.bound, 6))),
        worlds=len(proof.worlds),
    )
    total, more = proof.total, proof.chosen
    words += f" It walked {total.steps} steps in {total.walks} walks, and fell "
    words += f"{total.falls} times."
    if more:
        words += f" {describe_unmet(more, proof)} came up in none of these walks: each "
        words += f"was walked once in addition, and of these walks {more.falls} fell."
    words += " Each walk had one disturbance at a time."
    if proof.before:
        words += " Walks were judged by other criteria as well."
    return f"{words} No real robot was tested."


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


def named_strata(
    library: GaitLibrary, proof: ProofReport, scale_ns: float
) -> list[tuple[str, Stratum]]:
    """Return the strata that are shown, by names of which none is like another.

    A kind of disturbance with one level is in the row of its world, and in no other.

    Args:
        library: with the proof.
        proof: of the library.
        scale_ns: m sqrt(g h) [N s].
    """
    alone, impulses = lone_kinds(library), shown_names(library, scale_ns)
    kinds = (s for s in proof.kinds if s.name not in alone)
    return [
        (proof.total.name, proof.total),
        *((f"contact model: {s.name}", s) for s in proof.contacts),
        *((f"{s.name}, all levels", s) for s in kinds),
        *((impulses.get(s.name, s.name), s) for s in proof.worlds),
    ]


def _steps(body: Any, proof: ProofReport) -> None:
    steps, few = proof.steps, len(proof.steps.seldom)
    add(body, "h3", "Steps of the chain")
    add(
        body,
        "p",
        f"{_CHAIN} Of the {steps.allowed} steps that it may make, {steps.walked} were "
        f"walked, {few} of them less than {SELDOM} times. {_known(steps)}",
    )
    if steps.fell_on:
        heads = "step from", "to", "walked", "falls", "falls per visit"
        add(body, "p", "Steps in which it fell:")
        table(body, heads, map(_step_row, steps.fell_on))
    if steps.never:
        folded = ElementTree.SubElement(body, "details")
        said = f"{len(steps.never)} steps that these walks never made"
        add(folded, "summary", said)
        add(folded, "p", ", ".join(f"{a} to {b}" for a, b in steps.never))


def _known(steps: StepStrata) -> str:
    """Say how often it falls in a step, of the best known one to the worst."""
    if not steps.high or steps.high[0] > _UNKNOWN:
        return "Each was walked too seldom to tell how often it falls in it."
    best, middle, worst = (
        "an unknown rate" if rate > _UNKNOWN else upper_text(rate)
        for rate in steps.high
    )
    return (
        "Falls per visit are, with that confidence for all steps together, below "
        f"{best} for the best known step, below {middle} for the middle one, and below "
        f"{worst} for the one that is known worst."
    )


def _step_row(step: StepStratum) -> tuple[str, ...]:
    numbers = map(str, (step.first, step.last, step.walked, step.falls))
    return *numbers, interval_text(step.low, step.high)


def _spaced(number: int) -> str:
    """Return a whole number with its thousands apart."""
    return f"{number:,}".replace(",", " ")


def walk_count(stratum: Stratum, proof: ProofReport) -> str:
    """Return the number of a stratum's walks, with the one that was no draw apart."""
    chosen = proof.chosen is not None and stratum.name in proof.chosen.names
    return f"{stratum.walks - 1} + 1" if chosen else f"{stratum.walks}"


def _row(name: str, stratum: Stratum, proof: ProofReport) -> tuple[str, ...]:
    """Return a row of the table, by the name that is shown for its stratum."""
    often = f"more than {_spaced(math.floor(1.0 / stratum.high))} steps"
    if stratum.high > _UNKNOWN:
        often = "not known"
    return (
        name,
        walk_count(stratum, proof),
        f"{stratum.steps}",
        f"{stratum.falls}",
        interval_text(stratum.low, stratum.high),
        often,
    )


def _second_model(body: Any, library: GaitLibrary, proof: ProofReport) -> None:
    add(body, "h2", "Second model")
    cones = "; ".join(
        f"{s.name}: {s.falls} falls in {s.steps} steps" for s in proof.contacts
    )
    said = "The friction between soles and ground was computed in two ways"
    add(body, "p", f"{said}, see above. {cones}.")
    add(body, "p", _own_model(library)["verdict"])


def _own_model(library: GaitLibrary) -> dict[str, Any]:
    """Return what the robot's own model did: a sentence, and the numbers."""
    own = library.qualification.own
    if own is None:
        said = "The robot's file is no model for a simulator, to be walked as well."
    elif own.fault:
        said = f"The robot's own model could not be walked: {own.fault}."
    else:
        said = (
            f"The robot's own model, as its file has it: {own.survived} of "
            f"{own.schedules} schedules without a fall, at the end of the build."
        )
    return {"verdict": said, "found": None if own is None else asdict(own)}
