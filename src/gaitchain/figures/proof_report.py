"""What was proven of a library, for somebody who knows none of the code: HTML, JSON."""

import base64
import hashlib
import platform
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from gaitchain.errors import CommandError, LibraryError, file_errors
from gaitchain.figures.style import FEET, PLANNED, drawing, write_json
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import ProofReport, Stratum

PAGE, NUMBERS, PICTURE = "report.html", "report.json", "rates.png"
_PACKAGES = ("gaitchain", "mujoco", "numpy", "numba")
_UNKNOWN = 0.5  # falls per step; an interval that ends higher tells nothing
_HEADS = ("walks", "number", "steps", "falls", "falls per step", "one fall in")
_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;"
    "padding:0 1rem;color:#1b1e22;background:#fff}table{border-collapse:collapse;"
    "margin:.5rem 0}td,th{padding:.2rem .8rem .2rem 0;text-align:left;border-bottom:"
    "1px solid #ccd}img{max-width:100%}.verdict{font-size:1.2rem;padding:.6rem 1rem;"
    "border-left:6px solid #1f6fb4;background:#eef3f8}code{word-break:break-all}"
)
_VERDICTS = {
    "below": "It falls in fewer than {bound} of its steps, with {sure} confidence.",
    "above": "It falls in more than {bound} of its steps, with {sure} confidence.",
    "open": "Whether it falls in fewer than {bound} of its steps is not known: the "
    "walks that were allowed did not suffice.",
}
_NOT_TESTED = (
    "Any real robot: all of this is simulation, and what it leaves out may make a "
    "robot fall.",
    "Ground, loads and disturbances outside the worlds of the table, such as carpets, "
    "stairs, people, and faults of servos and cables.",
    "What a fall does: neither its energy nor what it breaks.",
    "Each world for itself: the verdict is of all of them together, each as often as "
    "any other. The interval of one world holds for that one alone.",
)


def write_report(library: GaitLibrary, folder: Path) -> list[Path]:
    """Write the report of a library's proof into a folder.

    Args:
        library: with a proof.
        folder: for report.html, which needs no other file, report.json and rates.png.

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
    page, numbers, picture = (folder / name for name in (PAGE, NUMBERS, PICTURE))
    _draw(proof, picture)
    facts = _facts(library, proof)
    write_json(numbers, facts)
    body = _page(library, proof, facts["origin"], picture.read_bytes())
    with file_errors(page, "written", CommandError):
        page.write_text(f"<!doctype html>\n{body}\n", "utf-8")
    return [page, numbers, picture]


def _facts(library: GaitLibrary, proof: ProofReport) -> dict[str, Any]:
    return {
        "robot": library.robot.name,
        "origin": dict(_origin(library)),
        "commands": asdict(library.command_range),
        "only_in_simulation": True,
        "not_tested": list(_NOT_TESTED),
        **asdict(proof),
    }


def _origin(library: GaitLibrary) -> list[tuple[str, str]]:
    """Return what was tested, and by what, as (name, value)."""
    unproven = library_bytes(library.proven(None))
    file = Path(library.config.robot)
    read = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
    packages = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    return [
        ("robot", library.robot.name),
        ("robot's numbers, hash", library.robot.fingerprint),
        ("robot's file", file.name),
        ("robot's file, SHA-256", read or "not at hand when this was written"),
        ("library without this proof, SHA-256", hashlib.sha256(unproven).hexdigest()),
        ("built by", f"gaitchain {library.version}"),
        ("report by", f"{packages}, Python {platform.python_version()}"),
    ]


def _draw(proof: ProofReport, path: Path) -> None:
    """Draw the interval of each stratum's rate, on a logarithmic axis."""
    strata = [proof.total, *proof.contacts, *proof.worlds]
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
            f"each end with {proof.confidence:.4g} confidence; dashed: the bound"
        )


def _floor(strata: Sequence[Stratum]) -> float:
    """Return a rate below all that can be told."""
    return 0.1 / max(s.steps for s in strata)


def _page(
    library: GaitLibrary,
    proof: ProofReport,
    origin: dict[str, str],
    picture: bytes,
) -> str:
    root = ElementTree.Element("html", lang="en")
    head = ElementTree.SubElement(root, "head")
    title = f"How seldom {library.robot.name} falls in simulation"
    ElementTree.SubElement(head, "meta", charset="utf-8")
    _add(head, "title", title)
    _add(head, "style", _STYLE)
    body = ElementTree.SubElement(root, "body")
    _add(body, "h1", title)
    _add(body, "p", _verdict(proof)).set("class", "verdict")
    _add(body, "h2", "What was tested")
    _table(body, (), origin.items())
    _add(body, "h2", "Declared use")
    _uses(body, library, proof)
    _add(body, "h2", "Criterion, fixed before the first walk")
    _add(body, "p", _criterion(proof))
    _add(body, "h2", "What came")
    _table(body, _HEADS, map(_row, (proof.total, *proof.contacts, *proof.worlds)))
    data = base64.b64encode(picture).decode()
    ElementTree.SubElement(
        body,
        "img",
        src=f"data:image/png;base64,{data}",
        alt="Interval of the falls per step in each world; the table has the numbers.",
    )
    _steps(body, proof)
    _add(body, "h2", "What was not tested")
    _list(body, _NOT_TESTED)
    _add(body, "h2", "How to repeat it")
    _add(body, "p", "Seeds follow from the library: the same one gives the same walks.")
    words = f"gaitchain qualify LIBRARY --bound {proof.bound:g}"
    words += f" --confidence {proof.confidence:g} --seconds {proof.seconds:g}"
    _add(body, "code", words)
    return ElementTree.tostring(root, encoding="unicode", method="html")


def _verdict(proof: ProofReport) -> str:
    words = _VERDICTS[proof.verdict].format(
        bound=f"{proof.bound:g}", sure=f"{100.0 * proof.confidence:g} %"
    )
    total = proof.total
    return (
        f"{words} It walked {total.steps} steps in {total.walks} walks, and fell "
        f"{total.falls} times. In simulation only."
    )


def _uses(body: Any, library: GaitLibrary, proof: ProofReport) -> None:
    span = library.command_range
    rows = [
        ("speed ahead", f"{span.vx[0]:.3f} to {span.vx[1]:.3f} m/s"),
        ("to the left", f"{span.vy[0]:.3f} to {span.vy[1]:.3f} m/s"),
        ("turning", f"{span.yaw_rate[0]:.2f} to {span.yaw_rate[1]:.2f} rad/s"),
        ("commands", f"random over that range, walks of {proof.seconds:g} s"),
    ]
    _table(body, (), rows)
    _add(body, "p", "Worlds, one drawn for each walk, each as often as any other:")
    _list(body, (world.name for world in proof.worlds))
    names = " and ".join(contact.name for contact in proof.contacts)
    _add(body, "p", f"Models of the contact, one drawn for each walk: {names}.")


def _criterion(proof: ProofReport) -> str:
    return (
        f"Falls per step against a bound of {proof.bound:g}. After each walk a "
        "sequential test asks whether fewer, or more, is sure; it stops as soon as one "
        f"is. With a probability of at most {1.0 - proof.confidence:.3g} it says what "
        "is not so, however often it looks. A robot has fallen when its hips are below "
        "0.65 of their height, or its trunk leans by 45 deg."
    )


def _steps(body: Any, proof: ProofReport) -> None:
    walked, allowed = proof.edges
    _add(body, "p", f"Of the {allowed} steps that it may make, {walked} were walked.")
    if proof.fell_on:
        heads = "step", "to", "walked", "falls"
        _add(body, "p", "Steps in which it fell:")
        _table(body, heads, (tuple(map(str, row)) for row in proof.fell_on))


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


def _add(parent: Any, tag: str, text: str) -> Any:
    element = ElementTree.SubElement(parent, tag)
    element.text = text
    return element


def _list(parent: Any, items: Iterable[str]) -> None:
    own = ElementTree.SubElement(parent, "ul")
    for item in items:
        _add(own, "li", item)


def _table(parent: Any, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    own = ElementTree.SubElement(parent, "table")
    if heads:
        row = ElementTree.SubElement(own, "tr")
        for head in heads:
            _add(row, "th", head)
    for cells in rows:
        row = ElementTree.SubElement(own, "tr")
        for cell in cells:
            _add(row, "td", cell)
