"""What the verbs print: tables and progress bars."""

import json
import os
import signal
import threading
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from rich.console import Console, JustifyMethod
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from gaitchain.errors import CommandError

_T = TypeVar("_T")


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    words: Container[int] = (0,),
) -> None:
    """Print a table; numbers come as text with their units in the headings.

    Args:
        title: above it.
        columns: headings.
        rows: cells.
        words: columns of words; the others hold numbers, and stand to the right.
    """
    table = Table(title=Text(title), title_justify="left")
    for i, column in enumerate(columns):
        side: JustifyMethod = "left" if i in words else "right"
        # As Text, units in brackets are no markup; a narrow window folds words only.
        head, first = Text(column), i == 0
        table.add_column(head, justify=side, overflow="fold", no_wrap=first)
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)


def say(text: str) -> None:
    """Print a line."""
    Console().print(text, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _interrupts_kept(interrupted: threading.Event) -> Iterator[None]:
    """Note an interrupt, which is lost where a destructor or a C callback gets it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def note(signum: int, frame: Any) -> None:
        interrupted.set()
        signal.default_int_handler(signum, frame)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def progress() -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar for each stage of the work on standard error.

    Yields:
        A function to call with (stage, done, total).
    """
    bars = Progress(
        TextColumn("{task.description:<28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=Console(stderr=True),
    )
    tasks: dict[str, Any] = {}
    interrupted = threading.Event()

    def tell(stage: str, done: int, total: int) -> None:
        if interrupted.is_set():
            raise KeyboardInterrupt
        if stage not in tasks:
            bars.start()
            tasks[stage] = bars.add_task(stage, total=total)
        bars.update(tasks[stage], completed=done)

    try:
        with _interrupts_kept(interrupted):
            yield tell
    finally:
        if tasks:  # a bar that never began would still leave an empty line
            bars.stop()


def watched(items: Iterable[_T], stage: str, total: int) -> Iterator[_T]:
    """Go through items with a progress bar."""
    with progress() as tell:
        tell(stage, 0, total)
        for done, item in enumerate(items, start=1):
            tell(stage, done, total)
            yield item


def write_json(path: Path, value: Any) -> None:
    """Write JSON for machines to read.

    Raises:
        CommandError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", "utf-8")
    except OSError as error:
        raise CommandError(f"{path}: cannot be written: {error.strerror}") from None


def check_writable(path: Path) -> None:
    """Make sure that a file can be written, before any work is done for it.

    Raises:
        CommandError: it cannot.
    """
    make_folder(path.parent)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise CommandError(f"{path}: cannot be written; name a file in your own folder")


def make_folder(path: Path) -> Path:
    """Make sure that a folder can be written to, before any work is done.

    Raises:
        CommandError: it cannot.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(
            f"{path}: no such folder can be made: {error.strerror}"
        ) from None
    if not os.access(path, os.W_OK):
        raise CommandError(f"{path}: cannot be written to; name a folder of your own")
    return path
