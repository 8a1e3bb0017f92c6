"""`gaitchain explain`: why a walk fell, and which parameters to change."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from gaitchain.analysis.fall_cause import DISTURBED_S, Explanation, explain
from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.record_file import RECORD, load_record
from gaitchain.analysis.rules import Finding
from gaitchain.cli.console import print_table, say
from gaitchain.cli.files import check_picture
from gaitchain.cli.mixtures import refuse
from gaitchain.cli.options import Explain
from gaitchain.errors import CommandError, RecordError
from gaitchain.figures.timeline import plot_timeline
from gaitchain.live.logs.names import missing
from gaitchain.live.logs.reader import SUFFIX, Log, read_log
from gaitchain.live.messages import Telemetry
from gaitchain.live.telemetry_record import before_fall, record_of

_BEFORE = (
    "the rows before its first one are in the file of that log before it, and the "
    "cause may be in them"
)


def run(options: Explain) -> tuple[int, dict[str, Any]]:
    """Explain a walk; the exit code is 0 also after a fall."""
    path = options.run / RECORD if options.run.is_dir() else options.run
    if path.suffix == ".gait" or not path.exists():
        raise CommandError(
            f"{path}: {'a gait library' if path.exists() else missing(path)}; explain "
            f"reads the folder that `gaitchain walk` wrote, such as runs/walk, its "
            f"{RECORD}, or a log of `gaitchain serve` ({SUFFIX})"
        )
    logged = path.suffix == SUFFIX
    if not logged:
        refuse(options, ("fall",), "of a log of `serve`; a walk has one fall at most")
    record, whole = (
        _record_of_log(path, options.fall) if logged else (load_record(path), True)
    )
    if record.robot is None:
        raise CommandError(f"{path}: it does not say which robot walked; walk again")
    picture = options.output or path.parent / _name(path)
    check_picture(picture)
    explanation = replace(explain(record.robot, record), whole=whole)
    say(explanation.sentence)
    _show(explanation, path)
    if np.isnan(record.foot_load).all():
        say("no timeline: this robot measured neither its feet nor where it was")
    else:
        plot_timeline(explanation, record, record.robot, picture)
        say(f"{picture}: the timeline")
    return 0, to_json(explanation)


def _record_of_log(path: Path, fall: int | None) -> tuple[WalkRecord, bool]:
    """Return the record of a log, and whether nothing is missing in it."""
    log = read_log(path)
    rows = before_fall(log.telemetries(), fall)
    if log.damage:
        say(f"{path}: {log.damage}")
    if not rows:
        raise CommandError(f"{path}: no telemetry in it")
    before = _BEFORE if _began_before(rows, log) else ""
    # Times are those of the loop, as shown by the page and by `replay`.
    gait = log.library.family.name
    try:
        record = record_of(
            log.library.robot, rows, log.library.timing, since_s=0.0, gait=gait
        )
    except RecordError as error:
        raise CommandError(f"{path}: {error}{before and f'; {before}'}") from None
    if before:
        ahead_s = rows[-1].time_s - rows[0].time_s
        say(f"{path}: it begins {ahead_s:.2f} s before the fall; {before}")
    return record, not (log.damage or before)


def _began_before(rows: Sequence[Telemetry], log: Log) -> bool:
    """Return whether what led to a fall may be in the file before this one.

    Args:
        rows: that led to the fall, of this file.
        log: the file.
    """
    begin, end = rows[0], rows[-1]
    soon = end.fell and end.time_s - begin.time_s < DISTURBED_S
    from_its_first = next(log.telemetries()).number == begin.number
    # Of a loop that was started again numbers begin anew, and nothing led to its rows.
    return soon and from_its_first and 0 < (log.row_before or 0) < begin.number


def _name(path: Path) -> str:
    """Return the picture's name; a folder has one walk, and may have many logs."""
    return f"{path.stem}.timeline.png" if path.suffix == SUFFIX else "timeline.png"


def to_json(explanation: Explanation) -> dict[str, Any]:
    """Return plain values for machines to read."""
    cause = explanation.cause
    return {
        "fell_at_s": explanation.fell_at_s,
        "sentence": explanation.sentence,
        "cause": None if cause is None else _plain(cause),
        "findings": [_plain(finding) for finding in explanation.findings],
        "events": [list(event) for event in _happened(explanation)],
    }


def _happened(explanation: Explanation) -> list[tuple[float, str]]:
    """Return (time [s], event) of all that happened to the robot, in order."""
    return sorted((*explanation.events, *explanation.notes))


def _plain(finding: Finding) -> dict[str, Any]:
    plain = asdict(finding) | {"rule": finding.rule.value, "advice": finding.advice}
    del plain["remedies"]
    return plain


def _show(explanation: Explanation, path: Path) -> None:
    lines = [
        (
            finding.time_s,
            f"{finding.what}{' (the cause)' if finding is explanation.cause else ''}",
            finding.how_much,
            finding.limit_text,
        )
        for finding in explanation.findings
    ]
    lines += [(time_s, what, "", "") for time_s, what in _happened(explanation)]
    if explanation.fell_at_s is not None:
        lines.append((explanation.fell_at_s, "the fall", "", ""))
    rows = [(f"{time_s:.2f}", *more) for time_s, *more in sorted(lines)]
    heads = ("time [s]", "what broke", "by how much", "limit")
    if rows:
        print_table(f"Rules that broke in {path}", heads, rows, (0, 1))
    # Once for each rule, which may have broken at every joint; the cause has been told.
    others = [f for f in explanation.findings if f is not explanation.cause]
    advice = dict.fromkeys((f.rule.value, f.advice) for f in others)
    if advice:
        print_table("What to try", ("what broke", "what to try"), advice, (0, 1))
