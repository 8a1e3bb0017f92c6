"""The heartbeat of a process of the service, in memory that it shares.

What must outlive that process is there as well.

Its own thread writes it, that of the loop once in each control period. Telemetry takes
a way that a busy computer can hold up while the robot walks on: a thread of ZeroMQ, a
socket, and whoever reads it. How long a silence is counts what the process could have
done in it.
"""

import mmap
import os
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

COMPILING = "compiling"
"""How the text begins of a process that makes machine code, which has no limit."""
_FILE, _TEXT_BYTES = "pulse", 200
_TEXT = struct.Struct(f"@Q{_TEXT_BYTES}s")  # bytes of a text, and the text
_DOING_AT, _KEPT_AT = 8, 8 + _TEXT.size  # after the beats
_SIZE = _KEPT_AT + _TEXT.size
_LONGEST_LOOK_S = 0.5  # a watcher that did not look for longer was held up itself
WAITS_TO_RUN, WAITS_FOR_DISK = "R", "D"
"""States of Linux in which a process cannot do anything."""


class Pulse:
    """Beats and what the process is doing, of whoever writes or reads them."""

    def __init__(self, folder: Path, name: str = _FILE) -> None:
        """Open that of a folder, or make it; by name, where there are several."""
        self._path = folder / name
        self._shared = self._opened()

    def _opened(self) -> mmap.mmap:
        file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            os.ftruncate(file, _SIZE)
            self._file = os.fstat(file)
            return mmap.mmap(file, _SIZE)
        finally:
            os.close(file)

    def put_back(self) -> None:
        """Make the file anew, with all that was in it, if somebody has removed it.

        Whoever has it open still shares the old one; a process that starts, the new.
        """
        before = self._shared[:]
        if self.look_again():
            self._shared[:] = before

    def look_again(self) -> bool:
        """Share the file that is there now; return whether it is another, or new."""
        with suppress(FileNotFoundError):
            if os.path.samestat(self._path.stat(), self._file):
                return False
        before, self._shared = self._shared, self._opened()
        before.close()
        return True

    def beat(self) -> None:
        """Say that the process is alive, and done with starting."""
        struct.pack_into("@QQ", self._shared, 0, self.beats + 1, 0)

    def say(self, doing: str) -> None:
        """Say what the process does that has no beat yet."""
        self._put(_DOING_AT, doing)
        struct.pack_into("@Q", self._shared, 0, self.beats + 1)

    def keep(self, text: str) -> None:
        """Keep a text that outlives the process; an empty one for none."""
        self._put(_KEPT_AT, text)

    @property
    def beats(self) -> int:
        """How often it beat."""
        return int(struct.unpack_from("@Q", self._shared)[0])

    @property
    def doing(self) -> str:
        """What it does before its first beat; empty from then on."""
        return self._text(_DOING_AT)

    @property
    def kept(self) -> str:
        """What `keep` kept last."""
        return self._text(_KEPT_AT)

    def _put(self, place: int, text: str) -> None:
        data = text.encode()[:_TEXT_BYTES]
        _TEXT.pack_into(self._shared, place, len(data), data)

    def _text(self, place: int) -> str:
        size, data = _TEXT.unpack_from(self._shared, place)
        return bytes(data[:size]).decode(errors="ignore")

    def close(self) -> None:
        """Let go of the memory."""
        self._shared.close()


def part_pulse(folder: Path, name: str) -> Pulse:
    """Open the pulse of a part that does not drive the robot.

    Args:
        folder: of the service.
        name: of the part.
    """
    return Pulse(folder, f"{name}.{_FILE}")


class Turn(NamedTuple):
    """What the system says of a process's main thread."""

    waits: bool
    """Whether it runs or waits for a processor, or is in another such state."""
    ran_s: float
    """For how long it has run since it began [s]."""


def turn_of(process: int, waiting: str = WAITS_TO_RUN) -> Turn | None:
    """Return what Linux says of a process's main thread; None where nothing is known.

    Args:
        process: its number.
        waiting: letters of the states in which it counts as waiting.
    """
    with suppress(OSError, ValueError, IndexError):
        of_thread = Path(f"/proc/{process}/task/{process}")
        ran_ns = int((of_thread / "schedstat").read_text().split()[0])
        state = (of_thread / "stat").read_text().rpartition(")")[2].split()[0]
        return Turn(state in waiting, 1e-9 * ran_ns)
    return None


class Vitals:
    """Tells a process that is stuck from one that is slow.

    A stuck one does not beat although it could. Time in which it waited for a processor
    is none in which it could, nor is time in which the watcher did not get one.
    """

    def __init__(
        self,
        pulse: Pulse,
        now: Callable[[], float] = time.monotonic,
        turn: Callable[[int], Turn | None] = turn_of,
    ) -> None:
        """Begin to watch.

        Args:
            pulse: what the process writes.
            now: a clock [s].
            turn: what is known of a process's main thread.
        """
        self._pulse, self._now, self._turn_of = pulse, now, turn
        self._beats, self._turn, self._looked_s = pulse.beats, Turn(False, 0.0), now()
        self.silent_s = 0.0
        """For how long it could have beaten, and did not [s]."""

    def look(self, process: int) -> float:
        """Look once, several times a second; return `silent_s`.

        Args:
            process: number of the process that beats.
        """
        beats, now_s, turn = self._pulse.beats, self._now(), self._turn_of(process)
        passed_s = min(max(now_s - self._looked_s, 0.0), _LONGEST_LOOK_S)
        if turn is not None and turn.waits:
            passed_s = min(passed_s, max(turn.ran_s - self._turn.ran_s, 0.0))
        self.silent_s = 0.0 if beats != self._beats else self.silent_s + passed_s
        self._beats, self._looked_s = beats, now_s
        self._turn = turn or self._turn
        return self.silent_s
