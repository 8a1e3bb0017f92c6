"""How long tests wait for what must come: by the pace of the machine, not by a guess.

A deadline only ends a test that would else hang. Under load the machine is slow and
nothing is wrong, so the pace is measured: by how long a Python process takes to start.
"""

import subprocess
import sys
import time

_LEAST_S = 60.0
_STARTS = 270.0  # starts of a process in one deadline; on a quiet machine one is 0.2 s
_START = [sys.executable, "-c", "import gaitchain.service.channel"]


def patience_s():
    """Return how long to wait on the machine as it is now."""
    began_s = time.monotonic()
    subprocess.run(_START, check=True)
    return max(_LEAST_S, _STARTS * (time.monotonic() - began_s))


PATIENCE_S = patience_s()
"""For what waits by itself and takes a number."""


class Deadline:
    """Passes when the machine has had time enough, at the pace that it has by then."""

    def __init__(self):
        """Begin now."""
        self._began_s, self._allowed_s = time.monotonic(), PATIENCE_S

    def passed(self):
        """Whether it is over; a machine that has become slower is given longer."""
        if time.monotonic() - self._began_s < self._allowed_s:
            return False
        self._allowed_s = max(self._allowed_s, patience_s())
        return time.monotonic() - self._began_s > self._allowed_s
