"""Output of the verbs: tables, notes, progress, and the results as JSON."""

import json
import math
import sys
import threading
import time
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from rich.console import Console, JustifyMethod
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bars
from rich.table import Table
from rich.text import Text

from gaitchain.build.progress import Progress
from gaitchain.cli.endings import interrupts_kept
from gaitchain.cli.files import STDOUT, check_files, check_replaced
from gaitchain.cli.options import ReportOptions
from gaitchain.cli.streams import say_aside, written_to
from gaitchain.errors import CommandError, UnfinishedError, file_errors

_T = TypeVar("_T")
_TENTHS = 10  # progress lines per stage if standard error is no terminal


class _Output(NamedTuple):
    """What is printed beside the results of a verb, and where."""

    notes: bool = True
    """Whether tables and notes are."""
    progress: bool = True
    """Whether progress is, which goes to standard error always."""
    aside: bool = False
    """Whether all of it goes there, as the results have standard output."""


_EVERYTHING = _Output()
_output: ContextVar[_Output] = ContextVar("output", default=_EVERYTHING)


@dataclass
class Report:
    """The results of a verb, for `--json`."""

    results: Any = None


_report: ContextVar[Report | None] = ContextVar("report", default=None)


@contextmanager
def reporting(
    options: ReportOptions, *, talks: bool = False, named: Iterable[Path] = ()
) -> Iterator[Report]:
    """Set how much is printed in a context, and write the results at its end.

    Args:
        options: where the results go, and whether the rest is printed.
        talks: whether a person needs the rest in order to answer.
        named: what else the command reads or writes; the results are no such file.

    Raises:
        CommandError: the results cannot be written; raised before any work.
    """
    path, report = options.json, Report()
    check_files([path], named)
    check_replaced(path, "the results")
    told, alone = not options.quiet, path == STDOUT
    output = _Output(told and (talks or not alone), told, aside=alone)
    token, kept = _output.set(output), _report.set(report)
    try:
        yield report
    except BaseException:
        if path is not None and report.results is not None:
            write_json(path, report.results)
        raise
    finally:
        _output.reset(token)
        _report.reset(kept)
    if path is not None:
        write_json(path, report.results)


def results_so_far(results: Any) -> None:
    """Set what is written as the results if the command ends before it is done."""
    if report := _report.get():
        report.results = results


@contextmanager
def resumable(path: Path) -> Iterator[None]:
    """Say where finished work is kept, where the rest of it ends before it is done."""
    try:
        yield
    except (KeyboardInterrupt, UnfinishedError):
        if _has_pieces(path):  # else not even the first one could be kept
            say(f"{path}: what is finished; the same command goes on from there")
        raise


def _has_pieces(journal: Path) -> bool:
    """Return whether anything finished is in a journal, below its first line."""
    with suppress(OSError), journal.open("rb") as file:
        return sum(1 for _ in islice(file, 2)) > 1
    return False


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    words: Container[int] = (0,),
) -> None:
    """Print a table; numbers are given as text, with their units in the headings.

    Args:
        title: title above the table.
        columns: headings.
        rows: cells.
        words: indices of text columns; the others hold numbers and are right-aligned.
    """
    if not _output.get().notes:
        return
    named = any(columns)
    table = Table(title=Text(title), title_justify="left", show_header=named)
    for i, column in enumerate(columns):
        side: JustifyMethod = "left" if i in words else "right"
        # Text keeps units in brackets from being read as markup. In a narrow window the
        # first column is not wrapped.
        head, first = Text(column), i == 0
        table.add_column(head, justify=side, overflow="fold", no_wrap=first)
    for row in rows:
        table.add_row(*map(Text, row))
    _print(table)


def say(text: str) -> None:
    """Print a line, unless output is muted."""
    if _output.get().notes:
        print_line(text)


def print_line(text: str) -> None:
    """Print a line that needs an answer, even if output is muted."""
    _print(text, highlight=False, markup=False, soft_wrap=True)


def _print(what: Table | str, **how: Any) -> None:
    aside = _output.get().aside
    with written_to(sys.stderr if aside else sys.stdout):
        _Console(stderr=aside).print(what, **how)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to `written_to`: Rich itself would end the command."""
        raise BrokenPipeError


@contextmanager
def progress() -> Iterator[Progress]:
    """Show the progress of each stage on standard error.

    On a terminal each stage has a bar, else it prints a line for each tenth.

    Yields:
        A function to call with (stage, done, total).
    """
    interrupted = threading.Event()
    with interrupts_kept(interrupted), _shown() as show:

        def tell(stage: str, done: int, total: int) -> None:
            if interrupted.is_set():
                raise KeyboardInterrupt
            show(stage, done, total)

        yield tell


@contextmanager
def _shown() -> Iterator[Progress]:
    """Yield the function that shows progress: none, lines or bars."""
    if not _output.get().progress:
        yield lambda stage, done, total: None
    elif not sys.stderr.isatty():
        yield _lines()
    else:
        bars = Bars(
            TextColumn("{task.description:<28}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(elapsed_when_finished=True),
            console=_Console(stderr=True),
        )
        tasks: dict[str, Any] = {}

        def show(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                bars.start()
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done, total=total)  # a total may grow

        try:
            yield show
        finally:
            if tasks:  # without a bar the display would leave an empty line
                bars.stop()


def _lines() -> Progress:
    """Return a function that prints a line for each tenth of a stage, with the time."""
    tenths, began_s = dict[str, int](), time.monotonic()

    def show(stage: str, done: int, total: int) -> None:
        tenth = _TENTHS * done // max(total, 1)
        if tenths.get(stage, -1) < tenth:
            tenths[stage] = tenth
            minutes, seconds = divmod(int(time.monotonic() - began_s), 60)
            since = f"{minutes:3d}:{seconds:02d}"
            say_aside(f"{since} {stage}: {done} of {total}")

    return show


def watched(items: Iterable[_T], stage: str, total: int) -> Iterator[_T]:
    """Yield the items and show progress."""
    with progress() as tell:
        tell(stage, 0, total)
        for done, item in enumerate(items, start=1):
            tell(stage, done, total)
            yield item


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON.

    Raises:
        CommandError: the file cannot be written.
    """
    text = json.dumps(plain_json(value), indent=2, allow_nan=False)
    if path == STDOUT:
        with written_to(sys.stdout):
            print(text)
        return
    with file_errors(path, "written", CommandError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n", "utf-8")


def plain_json(value: Any) -> Any:
    """Convert a value for JSON: tuples to lists, infinity to "inf", NaN to null."""
    if isinstance(value, Mapping):
        return {name: plain_json(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else f"{value}"
    return value
