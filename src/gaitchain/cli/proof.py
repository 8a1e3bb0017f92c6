"""`gaitchain qualify --bound`: show that a library falls less often than a bound."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gaitchain.build.jobs import keeping
from gaitchain.build.journal import Journal
from gaitchain.build.workers import Crew, available_cores
from gaitchain.cli.cluster import on_backend
from gaitchain.cli.console import print_table, progress, resumable, say
from gaitchain.cli.options import Qualify
from gaitchain.errors import GaitchainError
from gaitchain.figures.proof_report import write_report
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes, save_library
from gaitchain.gait.qualification import ProofReport, Stratum
from gaitchain.proof.fall_rate import Criterion, prove
from gaitchain.proof.rate_test import steps_needed
from gaitchain.walker.walker import Walker


def prove_bound(
    options: Qualify, library: GaitLibrary, out: Path
) -> tuple[int, dict[str, Any]]:
    """Walk until the verdict is sure; the exit code is 1 unless it is "below"."""
    assert options.bound is not None  # whoever calls has seen it
    Walker(library)  # refuses what is not qualified, before any work
    criterion = Criterion(
        options.bound, options.confidence, options.seconds, options.most_steps
    )
    of = library_bytes(library.proven(None))
    journal = Journal(out.with_name(f"{out.name}.proof.jsonl"), of, criterion)
    say(journal.greeting)
    need = steps_needed(criterion.bound, criterion.confidence)
    say(f"{need} steps without a fall would do; at most {criterion.limit} are walked")
    workers = options.workers or available_cores()
    try:
        with (
            resumable(journal.path),
            on_backend(options, workers),
            keeping(journal),
            progress() as tell,
        ):
            found = prove(library, criterion, Crew(workers, tell))
    except GaitchainError:
        journal.remove()
        raise
    save_library(found, out)
    journal.remove()
    report = found.qualification.proof
    assert report is not None  # set by `prove`
    _show(found, report)
    say(f"{out}: {report.describe()}; what was found is in it")
    if options.pages is not None:
        pages = write_report(found, options.pages)
        say(f"{pages[0]}: the report")
    return int(report.verdict != "below"), {"robot": library.robot.name} | asdict(
        report
    )


def _show(library: GaitLibrary, report: ProofReport) -> None:
    heads = "walks", "number", "steps", "falls", "falls per step"
    of_all = [report.total, *report.contacts, *report.worlds]
    title = f"{library.robot.name}, random schedules of {report.seconds:g} s"
    print_table(title, heads, _rows(of_all))
    walked, allowed = report.edges
    say(f"steps of the chain that were walked: {walked} of {allowed}")
    for first, last, times, falls in report.fell_on:
        say(f"{falls} of {times} steps from {first} to {last} fell")


def _rows(strata: Iterable[Stratum]) -> list[tuple[str, ...]]:
    return [
        (
            s.name,
            f"{s.walks}",
            f"{s.steps}",
            f"{s.falls}",
            f"{s.low:.2g} to {s.high:.2g}",
        )
        for s in strata
    ]
