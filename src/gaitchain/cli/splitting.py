"""`gaitchain qualify --bound --splitting`: rates below what brute force sees."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from gaitchain.build.journal import Journal
from gaitchain.cli.cluster import journaled_crew
from gaitchain.cli.console import print_table, say
from gaitchain.cli.options import Qualify
from gaitchain.cli.tried import as_kept, tried
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.qualification import EarlierCriterion
from gaitchain.proof.fall_rate import describe_before
from gaitchain.proof.rate_text import interval_text
from gaitchain.proof.split_walks import (
    SLICE_S,
    Disturbed,
    SplitReport,
    SplitSize,
    split_falls,
)
from gaitchain.proof.splitting import Chance
from gaitchain.walker.walker import Walker

_AGREES = "agree: some chance is in both intervals"
_DIFFERS = (
    "do not agree: no chance is in both intervals, so that the estimate does not "
    "count; harder pushes show more falls to both"
)


def estimate_falls(
    options: Qualify, library: GaitLibrary, out: Path
) -> tuple[int, dict[str, Any]]:
    """Split; the exit code is 1 unless the interval ends below the bound.

    Nor is it 0 where brute force does not agree.
    """
    assert options.bound is not None  # whoever calls has seen both
    assert options.splitting is not None
    Walker(library)  # refuses what is not qualified, before any work
    plain = library.proven(None)
    disturbed, size = Disturbed(plain, options.splitting), SplitSize()
    seconds = disturbed.slices * SLICE_S
    own = EarlierCriterion(options.bound, options.confidence, seconds)
    journal = _begun(disturbed, size, own, out)
    before = tried(journal)
    if before:
        say(describe_before(before))
    with journaled_crew(options, journal) as crew:
        report = split_falls(disturbed, size, options.confidence, crew)
    journal.remove()
    _show(options, library, report)
    facts = {"robot": library.robot.name, "bound": options.bound} | asdict(report)
    facts["before"] = [asdict(each) for each in before]
    # Not `high >= bound`, which NaN would pass.
    return int(not (report.agrees and report.per_step.high < options.bound)), facts


def _begun(
    disturbed: Disturbed, size: SplitSize, criterion: EarlierCriterion, out: Path
) -> Journal:
    """Open the journal; no walk depends on bound and confidence, which it remembers."""
    path = out.with_name(f"{out.name}.splitting.jsonl")
    own = library_bytes(disturbed.library)
    subject = disturbed.hardest, disturbed.slices, size
    about = own + f"{subject!r}".encode()
    journal = Journal(path, own, subject, criterion=as_kept(criterion), about=about)
    say(journal.greeting)
    return journal


def _show(options: Qualify, library: GaitLibrary, report: SplitReport) -> None:
    walks, met = report.alone
    rows = [
        (f"splitting, {report.walks} walks", *_cells(report.per_walk)),
        (f"brute force, {walks} other walks, {met} fell", *_cells(report.brute)),
        ("splitting, per step", *_cells(report.per_step)),
    ]
    title = f"{library.robot.name}, pushed each second, walks of {report.seconds:g} s"
    sure = f"{100.0 * report.confidence:g} %"
    print_table(title, ("falls", "mean", f"{sure} interval"), rows)
    say(f"splitting and brute force {_AGREES if report.agrees else _DIFFERS}")
    below = report.per_step.high < (options.bound or 0.0)
    than = "fewer than" if below else "not shown to be fewer than"
    say(
        f"pushes up to {report.hardest:g} m sqrt(g h): {than} {options.bound:g} falls "
        "per step; an estimate, which the library does not keep"
    )


def _cells(chance: Chance) -> tuple[str, str]:
    return f"{chance.mean:.3g}", interval_text(chance.low, chance.high)
