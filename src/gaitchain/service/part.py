"""Run one part of the service as its own process: `python -m ... NAME FOLDER`.

A part ends at SIGTERM, or when its standard input closes, which happens when its parent
process ends, even if that was killed. Ctrl-C is handled by the parent.
"""

import logging
import os
import signal
import sys
import threading
from importlib import import_module
from pathlib import Path

from gaitchain.errors import GaitchainError, needed_by
from gaitchain.service.api_limits import Allowance

MODULES = {
    "loop": "gaitchain.service.loop_part",
    "log": "gaitchain.service.log_part",
    "viewer": "gaitchain.service.viewer_part",
    "api": "gaitchain.service.api",
    "ros": "gaitchain.service.ros_part",
    "player": "gaitchain.service.player_part",
}
_LOGGED_PER_S, _LOGGED_AT_ONCE = 0.1, 20  # so that no client can fill a disk with them
_PATIENT = 5  # niceness of all parts but those that must keep up with the loop
_PROMPT = ("loop", "log")
REFUSED = 2
"""Exit code of a part that cannot do what it was asked to; it is not started again."""
SERVED = "served"
"""File in the folder of the service, there as soon as the API has its address."""


def main() -> int:
    """Run the part that the command line names.

    Returns:
        The exit code: 0 ended as asked, 2 bad input.
    """
    name, folder = sys.argv[1], Path(sys.argv[2])
    logging.basicConfig(format=f"gaitchain {name}: %(message)s", handlers=[_log()])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = threading.Event()
    # An exception out of a handler could get lost in whatever runs just then.
    signal.signal(signal.SIGTERM, lambda _signal, _frame: ended.set())
    if name not in _PROMPT and hasattr(os, "nice"):  # not on Windows
        os.nice(_PATIENT)
    threading.Thread(target=_end_with_parent, args=[ended], daemon=True).start()
    try:
        with needed_by(f"the {name} part of the service"):
            import_module(MODULES[name]).run(folder, ended)
    except GaitchainError as error:
        print(f"gaitchain: {error}", file=sys.stderr)
        return REFUSED
    return 0


def _log() -> logging.Handler:
    """Return what writes errors to the terminal, and leaves out what is too many."""
    handler = logging.StreamHandler()
    allowance = Allowance(_LOGGED_PER_S, _LOGGED_AT_ONCE)
    handler.addFilter(lambda _: allowance.take())
    return handler


def _end_with_parent(ended: threading.Event) -> None:
    """Wait until standard input closes, then end as if asked to."""
    while os.read(0, 1024):  # of sys.stdin the interpreter's own end would trip
        pass
    ended.set()


if __name__ == "__main__":
    sys.exit(main())
