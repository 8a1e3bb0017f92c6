"""A process that logs rows of no walk, on a clock of its own, for tests that kill it.

Arguments: FILE, LIBRARY, seconds, bytes that a file may have (0: no limit).
"""

import resource
import sys
from pathlib import Path

import numpy as np
from telemetry_factory import told

from gaitchain.gait.library_file import load_library
from gaitchain.live.logs.logger import AGAIN_S, Logger

RATE_HZ = 100


class Walk:
    """Rows at a steady rate, whatever becomes of the log."""

    def __init__(self, path, library, limit):
        self.now_s, self.steps, self._limit = 0.0, 0, limit
        self._robot, self._rng = library.robot, np.random.default_rng(0)
        self.logger = Logger(path, library, self.tell, lambda: self.now_s)

    def tell(self, text):
        """Say what the logger says; from then on the disk is full for any file."""
        print(text, flush=True)
        if "cannot be written" in text:
            allow(1000)

    def on(self, seconds):
        """Log so many seconds, 200 kB each, which cannot be compressed."""
        for _ in range(round(seconds * RATE_HZ)):
            text = self._rng.bytes(1500).hex() if self._limit else ""
            counts = {"steps": self.steps, "number": self.steps + 1}
            self.logger.write(told(self._robot, self.now_s, **counts, reason=text))
            self.steps += 1
            self.now_s = self.steps / RATE_HZ


def allow(most):
    """Let no file grow beyond so many bytes."""
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (most or hard, hard))


def main(path, library, seconds, limit):
    """Log, say so, and wait for the end; with a limit, go on without it as well."""
    allow(limit)
    walk = Walk(path, load_library(library), limit)
    walk.on(seconds)
    if limit:
        print(f"walked on to {walk.now_s} s", flush=True)
        allow(0)
        walk.on(1.5 * AGAIN_S)
        walk.logger.close()
    print("done", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))
