"""`gaitchain qualify --bound`: show that a library falls less often than a bound."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from gaitchain.build.journal import Journal
from gaitchain.build.push import impulse_unit_ns
from gaitchain.cli.cluster import journaled_crew
from gaitchain.cli.console import print_table, say
from gaitchain.cli.options import Qualify
from gaitchain.cli.tried import as_kept, tried
from gaitchain.errors import LibraryError
from gaitchain.figures.proof_report import named_strata, walk_count, write_report
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.qualification import EarlierCriterion, ProofReport, Stratum
from gaitchain.proof.fall_rate import (
    check_length,
    check_most_steps,
    describe_before,
    describe_chosen,
    prove,
    usual_steps,
    walk_length,
)
from gaitchain.proof.measures import measure
from gaitchain.proof.proof_walks import Criterion
from gaitchain.proof.rate_test import steps_needed
from gaitchain.proof.rate_text import interval_text
from gaitchain.proof.step_strata import SELDOM
from gaitchain.walker.walker import Walker

_NEED = "{} steps without a fall would do, in walks of {} steps; at most {} are walked"
_APART = 'They are in the rows of their own world or model alone, as "+ 1".'


def prove_bound(
    options: Qualify, library: GaitLibrary, out: Path
) -> tuple[int, dict[str, Any]]:
    """Walk until the verdict is sure; the exit code is 1 unless it is "below"."""
    assert options.bound is not None  # whoever calls has seen it
    Walker(library)  # refuses what is not qualified, before any work
    criterion = Criterion(
        options.bound, options.confidence, options.seconds, options.most_steps
    )
    journal = _begun(library.proven(None), criterion, out)
    before = _seen(library, criterion, journal, out)
    if before:
        say(describe_before(before))
    with journaled_crew(options, journal) as crew:
        found = _remembering(prove(library, criterion, crew), before)
        measures = None
        if options.pages is not None:
            measures = measure(found, criterion, options.report_walks, crew)
    save_library(found, out)
    report = found.qualification.proof
    assert report is not None  # set by `prove`
    _show(found, report)
    say(f"{out}: {report.describe()}; what was found is in it")
    if options.pages is not None and measures is not None:
        pages = write_report(found, criterion, measures, options.pages)
        say(f"{pages[0]}: the report")
    if report.verdict == "open":
        say(f"{journal.path}: its walks; a larger --most-steps goes on from there")
    else:
        journal.remove()
    facts = {"robot": library.robot.name, "most_steps": criterion.limit}
    return int(report.verdict != "below"), facts | asdict(report)


def _begun(plain: GaitLibrary, criterion: Criterion, out: Path) -> Journal:
    """Open the journal of a library without a proof, and say how much will be walked.

    Walks depend on their length alone, so that another bound goes on from those that
    were drawn before the first chosen ones (`fall_rate`), whose turn depends on it; the
    journal remembers which were tried, also in walks of another length and by other
    code.

    Raises:
        CommandError: the walks would be too long, or too few.
    """
    check_length(plain, criterion)
    check_most_steps(criterion)
    path = out.with_name(f"{out.name}.proof.jsonl")
    own, by = library_bytes(plain), as_kept(_as_tried(criterion))
    journal = Journal(path, own, criterion.seconds, criterion=by, about=own)
    say(journal.greeting)
    usual = usual_steps(plain, criterion)
    need = steps_needed(criterion.bound, criterion.confidence, usual)
    say(_NEED.format(need, usual, criterion.limit))
    return journal


def _seen(
    library: GaitLibrary, criterion: Criterion, journal: Journal, out: Path
) -> tuple[EarlierCriterion, ...]:
    """Return the other criteria with which walks of the library were seen.

    Those of the journal, and of proofs in the library and in the file that is replaced:
    the same library gives the same walks, so that whoever saw them knows what comes.
    """
    known = tried(journal)
    for proof in _proofs(library, out):
        known += [*proof.before, proof.criterion]
    own = _as_tried(criterion)
    return tuple(each for each in dict.fromkeys(known) if each != own)


def _as_tried(criterion: Criterion) -> EarlierCriterion:
    return EarlierCriterion(criterion.bound, criterion.confidence, criterion.seconds)


def _proofs(library: GaitLibrary, out: Path) -> Iterator[ProofReport]:
    """Yield the proofs of a library that are in itself and in an existing output."""
    found, plain = [library], library_bytes(library.proven(None))
    with suppress(LibraryError):
        found.append(load_library(out))
    for each in found:
        proof = each.qualification.proof
        if proof is not None and library_bytes(each.proven(None)) == plain:
            yield proof


def _remembering(
    library: GaitLibrary, before: tuple[EarlierCriterion, ...]
) -> GaitLibrary:
    """Return a library whose proof has the criteria that were tried before."""
    proof = library.qualification.proof
    assert proof is not None  # set by `prove`
    return library.proven(replace(proof, before=before))


def _show(library: GaitLibrary, report: ProofReport) -> None:
    heads = "walks", "number", "steps", "falls", "falls per step"
    named = named_strata(library, report, impulse_unit_ns(library))
    length = walk_length(library, report)
    title = f"{library.robot.name}, random schedules of {length}"
    print_table(title, heads, (_row(name, s, report) for name, s in named))
    if report.chosen:
        say(f"{describe_chosen(report.chosen, report)} {_APART}")
    steps = report.steps
    say(
        f"steps of the chain that were walked: {steps.walked} of {steps.allowed}, "
        f"{len(steps.seldom)} of them less than {SELDOM} times"
    )
    for s in steps.fell_on:
        say(f"{s.falls} of {s.walked} steps from {s.first} to {s.last} fell")


def _row(name: str, stratum: Stratum, report: ProofReport) -> tuple[str, ...]:
    return (
        name,
        walk_count(stratum, report),
        f"{stratum.steps}",
        f"{stratum.falls}",
        interval_text(stratum.low, stratum.high),
    )
