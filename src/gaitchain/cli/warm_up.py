"""`gaitchain warm-up`: compile what walks online before a robot needs it."""

import time
from concurrent.futures import Future
from pathlib import Path
from threading import Thread
from typing import Any

from gaitchain.balance.compiled import (
    COMPILED,
    cache_folder,
    cache_trouble,
    compilation,
)
from gaitchain.cli.console import progress, say
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import WarmUp
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.walker.walker import Walker

_LOOK_S = 0.5
_STAGE = "compiled functions"


def run(options: WarmUp) -> tuple[int, dict[str, Any]]:
    """Walk a few steps in thought, with feedback and without; all is compiled then.

    Raises:
        CommandError: the machine code cannot be kept.
    """
    if not COMPILED:
        say("plain Python runs here (GAITCHAIN_PLAIN): nothing to compile")
        return 0, {"folder": None, "compiled": 0}
    folder = cache_folder()
    if folder is None:
        raise CommandError(cache_trouble())
    library, since_s = read_library(options.library), time.monotonic()
    _compile(library)
    if trouble := cache_trouble():
        raise CommandError(trouble)
    made, took_s = compilation().made, time.monotonic() - since_s
    size = _bytes_in(folder)
    what = f"compiled {made} functions" if made else "all was compiled already"
    say(f"{what}, {took_s:.0f} s; machine code of {size / 2**20:.1f} MiB in {folder}")
    say("To be run again, as this user, after an update of gaitchain or Numba.")
    found = {"compiled": made, "seconds": took_s, "bytes": size, "folder": str(folder)}
    return 0, found


def _compile(library: GaitLibrary) -> None:
    """Compile in a thread, and tell meanwhile how far it is.

    Nobody waits for the thread after Ctrl-C: it may have minutes to go.
    """
    work: Future[None] = Future()
    Thread(target=_walk, args=(library, work), daemon=True).start()
    with progress() as tell:
        found = compilation()
        while not work.done():
            tell(_STAGE, found.ready, max(found.functions, 1))
            time.sleep(_LOOK_S)
            found = compilation()
        work.result()
        tell(_STAGE, found.functions, found.functions)


def _walk(library: GaitLibrary, work: Future[None]) -> None:
    try:
        for feedback in (True, False):
            Walker(library, feedback=feedback)
        work.set_result(None)
    except Exception as error:
        work.set_exception(error)


def _bytes_in(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
