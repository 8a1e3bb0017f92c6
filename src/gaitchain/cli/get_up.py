"""`gaitchain get-up`: search how a robot gets up after a fall, and try it."""

from collections.abc import Container
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from gaitchain.build.journal import Journal
from gaitchain.build.own_model import model_digest, own_model
from gaitchain.build.workers import available_cores
from gaitchain.cli.console import print_table, progress, say, watched
from gaitchain.cli.files import check_files, check_replaced
from gaitchain.cli.kept_work import kept_in
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import GetUp as Options
from gaitchain.errors import CommandError, LibraryError
from gaitchain.figures.replay import Recording, write_replay
from gaitchain.gait.get_up import SIDES, GetUp, Side, load_get_up, save_get_up
from gaitchain.gait.library_file import library_bytes
from gaitchain.getup.fallen_robot import Subject, fallen_robot
from gaitchain.getup.rise_trial import RiseResult, record_rise, try_rising
from gaitchain.getup.search import Effort, assemble, search_ways
from gaitchain.sim.world import World

_ENOUGH = 0.9  # of the falls


def run(options: Options) -> tuple[int, dict[str, Any]]:
    """Search and try; the exit code is 1 if it stays down too often."""
    written = options.output, options.replay
    check_files(written, [Path(options.library), options.model])
    check_replaced(options.output, "the ways up", "a file of ways up")
    check_replaced(options.replay, "the page")
    subject = Subject(options.model, read_library(options.library))
    journal = None if options.ways else _begun(options, subject)
    with nullcontext() if journal is None else kept_in(journal):
        found = _known(options, subject) if options.ways else _search(options, subject)
        came = {side: _try(options, subject, found, side) for side in found.ways}
    missing = [side for side in _sides(options) if side not in found.ways]
    ways = {side: _counted(found, side, came[side]) for side in came}
    found = msgspec.structs.replace(found, ways=ways)
    save_get_up(found, options.output)
    if journal is not None:
        journal.remove()
    _show(found, came)
    if options.replay is not None:
        _draw(options, subject, found, options.replay)
    say(f"{options.output}: what was found")
    for side in missing:
        say(f"{options.ways}: has no way from the {side}")
    enough = all(way.stood >= _ENOUGH * way.starts for way in ways.values())
    return int(bool(missing) or not enough), _figures(found, came)


def _sides(options: Options) -> tuple[Side, ...]:
    return SIDES if options.sides == "both" else (options.sides,)


def _known(options: Options, subject: Subject) -> GetUp:
    """Read what was found before, of the sides asked for.

    Raises:
        CommandError: the output would replace it, and has less.
        LibraryError: it is of another robot, or has nothing of these sides.
    """
    assert options.ways is not None  # whoever calls has seen it
    known = load_get_up(options.ways, subject.library.robot)
    asked = _sides(options)
    ways = {side: way for side, way in known.ways.items() if side in asked}
    if not ways:
        raise LibraryError(f"{options.ways}: has no way from the {' or '.join(asked)}")
    _refuse_loss(options, subject, ways)
    return msgspec.structs.replace(known, ways=ways)


def _refuse_loss(options: Options, subject: Subject, sides: Container[Side]) -> None:
    """Refuse to replace ways up of the robot by those of less sides.

    Raises:
        CommandError: the output has a way from another side than these.
    """
    try:
        there = load_get_up(options.output, subject.library.robot)
    except LibraryError:  # none yet, or no longer of this robot
        return
    if left := [side for side in there.ways if side not in sides]:
        raise CommandError(
            f"{options.output}: would lose its way from the {left[0]}; name another "
            "file with -o, or ask for both sides"
        )


def _begun(options: Options, subject: Subject) -> Journal:
    """Open the journal of the search and of the falls after it, and say so."""
    _refuse_loss(options, subject, _sides(options))
    out, asked = options.output, (options.generations, options.seed, options.sides)
    of = *_searched(subject), asked
    journal = Journal(out.with_name(f"{out.name}.search.jsonl"), *of)
    say(journal.greeting)
    return journal


def _search(options: Options, subject: Subject) -> GetUp:
    workers = options.workers or available_cores()
    effort = Effort(options.generations, options.seed, workers)
    with progress() as tell:
        return assemble(subject, search_ways(subject, _sides(options), effort, tell))


def _searched(subject: Subject) -> tuple[bytes, str]:
    """Return what tells a search from that of another stand or another model.

    Raises:
        CommandError: the robot cannot be searched, see `FallenRobot`.
    """
    fallen_robot(subject)  # refuses it, and says why
    library = subject.library
    # As compiled, because a file may take parts from others.
    model = own_model(subject.file, library.robot, World())
    return library_bytes(library), model_digest(model)


def _try(
    options: Options, subject: Subject, found: GetUp, side: Side
) -> list[RiseResult]:
    workers = options.workers or available_cores()
    tries = try_rising(subject, found, side, options.runs, options.seed, workers)
    return list(watched(tries, f"falling onto the {side}", options.runs))


def _counted(found: GetUp, side: Side, came: list[RiseResult]) -> Any:
    stood = sum(one.stood for one in came)
    return msgspec.structs.replace(found.ways[side], stood=stood, starts=len(came))


def _show(found: GetUp, came: dict[Side, list[RiseResult]]) -> None:
    rows = [
        (
            side,
            f"{way.seconds:.1f}",
            f"{way.stood} of {way.starts}",
            f"{sum(one.stood and one.tries == 1 for one in came[side])}",
            f"{np.mean([one.seconds for one in came[side]]):.1f}",
        )
        for side, way in found.ways.items()
    ]
    heads = "lies on", "way [s]", "stands", "at the first try", "takes [s]"
    print_table(f"{found.robot} gets up, in its own model", heads, rows)


def _draw(options: Options, subject: Subject, found: GetUp, file: Path) -> None:
    """Write the web page: one fall after the other."""
    rises = [record_rise(subject, found, side, options.seed) for side in found.ways]
    rows = np.concatenate([rise.qpos for rise in rises])
    time_s = np.arange(len(rows), dtype=float) * rises[0].time_s[1]
    recording = Recording(time_s, rows, np.full((len(rows), 2), np.nan))
    title = f"{found.robot}: gaitchain get-up"
    write_replay(rises[0].model, recording, file, title=title)
    say(f"{file}: the first fall onto each side (open it in any browser)")


def _figures(found: GetUp, came: dict[Side, list[RiseResult]]) -> dict[str, Any]:
    sides = {
        side: {
            "way_s": way.seconds,
            "stood": way.stood,
            "falls": way.starts,
            "each": [one._asdict() for one in came[side]],
        }
        for side, way in found.ways.items()
    }
    return {"robot": found.robot, "sides": sides}
