"""Logs of processes that are killed, whose disk is full, or that end in good order."""

import select
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from logging_child import RATE_HZ
from mcap.reader import make_reader
from msgspec.structs import replace
from patience import PATIENCE_S, Deadline
from planned_library import planned_res
from telemetry_factory import PACE, told

from gaitchain.errors import LogError
from gaitchain.gait.library_file import save_library
from gaitchain.live.logs.logger import SYNC_S, Logger, Room
from gaitchain.live.logs.reader import read_log
from gaitchain.live.messages import Note
from gaitchain.service.channel import LoopEnd
from gaitchain.service.log_part import run
from gaitchain.service.settings import Settings, save_settings

LIBRARY = planned_res()
RES = LIBRARY.robot
CHILD = Path(__file__).parents[1] / "support" / "logging_child.py"


@pytest.fixture
def library_path(tmp_path):
    save_library(LIBRARY, tmp_path / "res.gait")
    return tmp_path / "res.gait"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "logs" / "walk.mcap"


def child(path, library_path, seconds, limit=0):
    return subprocess.Popen(
        [sys.executable, CHILD, path, library_path, str(seconds), str(limit)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def steps(path):
    log = read_log(path)
    return [row.steps for row in log.telemetries()], log


def rows_lost(path):
    """What a log that was ended says is missing, as any reader of MCAP finds it."""
    with path.open("rb") as stream:
        facts = {m.name: m.metadata for m in make_reader(stream).iter_metadata()}
    return int(facts.get("rows_lost", {"rows": 0})["rows"])


def test_a_killed_logger_loses_the_last_half_second_at_most(path, library_path):
    with child(path, library_path, 3.2) as process:
        assert process.stdout.readline() == "done\n"
        process.kill()
    assert process.returncode == -signal.SIGKILL
    found, log = steps(path)
    assert found == list(range(len(found)))
    assert len(found) > (3.2 - SYNC_S) * RATE_HZ - 2
    assert log.damage == f"the end is missing, after {len(found)} rows"


@pytest.mark.slow
def test_a_full_disk_ends_a_log_and_not_the_walk(path, library_path):
    """A limit on the size of files stands for it: a write fails in mid-chunk."""
    with child(path, library_path, 30.0, limit=1_200_000) as process:
        lines = [process.stdout.readline().strip() for _ in range(4)]
        process.stdin.close()
    assert process.returncode == 0
    assert lines[0].startswith(f"{path}: cannot be written: File too large; ")
    assert "next try in 10 s" in lines[0]
    # The tries in between failed as well: told once, and no files left.
    assert lines[1] == "walked on to 30.0 s"
    assert lines[3] == "done"
    assert len(list(path.parent.iterdir())) == 2
    first, log = steps(path)
    assert first == list(range(len(first)))
    assert 100 < len(first) < 1500
    assert log.damage
    assert path.stat().st_size <= 1_200_000
    again = path.with_name("walk-2.mcap")
    last, log = steps(again)
    assert last == list(range(last[0], 4500))
    assert last[0] <= 4000
    assert log.lost == last[0] - len(first)
    assert lines[2] == f"the log goes on in {again}; {missing(log.lost)}"
    assert rows_lost(again) == log.lost


def test_a_log_that_cannot_begin_is_told_once_and_tried_again(tmp_path):
    said, now_s = [], 0.0
    place = tmp_path / "disk"
    place.touch()  # a file where a folder should be
    logger = Logger(place / "walk.mcap", LIBRARY, said.append, lambda: now_s)
    assert logger.path is None
    for tick in range(2000):
        now_s = 0.01 * tick
        logger.write(told(RES, now_s))
    assert len(said) == 1
    assert "cannot be written" in said[0]
    place.unlink()
    for tick in range(2000, 3000):
        now_s = 0.01 * tick
        logger.write(told(RES, now_s, steps=tick))
    logger.close()
    assert said[1:] == [f"the log goes on in {place / 'walk.mcap'}"]
    found, _ = steps(place / "walk.mcap")
    assert found[-1] == 2999
    assert len(found) >= 900


def test_a_log_whose_folder_is_removed_is_told_and_goes_on(tmp_path):
    said, now_s = [], 0.0
    path = tmp_path / "logs" / "walk.mcap"
    logger = Logger(path, LIBRARY, said.append, lambda: now_s)
    for tick in range(3000):
        now_s = 0.01 * tick
        if tick == 500:
            shutil.rmtree(path.parent)
        logger.write(told(RES, now_s, steps=tick))
    logger.close()
    assert "walk.mcap: cannot be written: somebody has removed" in said[0]
    again = path.with_name("walk-2.mcap")
    assert said[1:] == [f"the log goes on in {again}"]
    assert steps(again)[0][-1] == 2999


class Disk:
    """A log on a disk that can be full, on a clock of its own."""

    def __init__(self, folder):
        self.folder, self.now_s, self.said, self.loggers = folder, 0.0, [], []
        self.begin()

    def begin(self):
        """Start a logger of the log, as after a kill of the one before."""
        path, ledger = self.folder / "walk.mcap", self.folder / "log.json"
        said, now = self.said.append, lambda: self.now_s
        self.loggers.append(Logger(path, LIBRARY, said, now, ledger=ledger))

    def write(self, numbers):
        for number in numbers:
            self.now_s += 0.01
            self.loggers[-1].write(told(RES, self.now_s, number=number))

    def sync(self):
        self.now_s += 1.0
        self.loggers[-1].sync()

    @contextmanager
    def full(self):
        """A limit on the size of files stands for it."""
        resource = pytest.importorskip("resource")
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    def ended(self):
        """Close all; return numbers of the rows of the first and last file, and it."""
        for logger in self.loggers:
            logger.close()
        last = max(self.folder.glob("walk-*.mcap"))
        log = read_log(last)
        first = read_log(self.folder / "walk.mcap").telemetries()
        return [r.number for r in first], [r.number for r in log.telemetries()], log


@pytest.fixture
def disk(tmp_path):
    return Disk(tmp_path)


def missing(count):
    return f"{count} rows of the loop are not in the log"


def test_rows_that_came_while_the_disk_was_full_are_lost(disk):
    disk.write(range(1, 501))
    with disk.full():
        disk.write(range(501, 2001))
    disk.write(range(2001, 3501))
    first, last, log = disk.ended()
    assert first == list(range(1, first[-1] + 1))
    assert last == list(range(last[0], 3501))
    assert 400 < first[-1] <= 500
    assert 2000 < last[0] <= 3100
    assert log.lost == last[0] - 1 - first[-1]
    assert log.damage.startswith(f"{missing(log.lost)}: one gap")
    assert disk.said[1:] == [f"the log goes on in {log.path}; {missing(log.lost)}"]
    assert rows_lost(log.path) == log.lost


def test_a_loop_that_began_again_while_the_disk_was_full_lost_rows_of_both(disk):
    """How far the one before came is in no row, and so in the sum alone."""
    disk.write(range(1, 501))
    with disk.full():
        disk.write(range(501, 1001))
        disk.write(range(1, 801))
    disk.write(range(801, 2401))
    first, last, log = disk.ended()
    assert log.lost == last[0] - 1
    lost = 1000 - first[-1] + log.lost
    assert disk.said[1].endswith(missing(lost))
    assert rows_lost(log.path) == lost


def test_a_loop_that_began_again_just_before_the_disk_was_full_is_told_apart(disk):
    disk.write(range(1, 501))
    disk.sync()
    disk.write(range(1, 11))
    with disk.full():
        disk.write(range(11, 801))
    disk.write(range(801, 2401))
    _, last, log = disk.ended()
    assert log.lost == last[0] - 1


def test_the_list_of_the_files_has_the_last_row_that_was_written(disk):
    """A logger is killed as soon as the log goes on."""
    disk.write(range(1, 501))
    with disk.full():
        disk.write(range(501, 1001))
    disk.now_s += 20.0
    disk.write([1001])
    disk.begin()
    disk.write(range(1011, 1101))
    first, last, log = disk.ended()
    assert last == list(range(1011, 1101))
    assert log.lost == 1010 - first[-1]


def test_a_single_row_is_told_of_in_the_singular(disk):
    disk.write(range(1, 501))
    disk.sync()
    with disk.full():
        disk.write([501])
        disk.sync()
    disk.now_s += 20.0
    disk.write([502])
    disk.ended()
    assert disk.said[1].endswith("; 1 row of the loop is not in the log")


def test_an_older_log_is_never_written_over(tmp_path):
    path, said = tmp_path / "walk.mcap", []
    for number in (1, 2, 3):
        logger = Logger(path, LIBRARY, said.append)
        logger.write(told(RES, steps=number))
        logger.close()
    names = ("walk.mcap", "walk-2.mcap", "walk-3.mcap")
    assert [steps(tmp_path / name)[0] for name in names] == [[1], [2], [3]]
    assert said == []


def test_a_full_file_is_followed_and_the_oldest_of_too_many_removed(tmp_path):
    said, now_s, room = [], 0.0, Room(file_bytes=60_000, files=3)
    path = tmp_path / "walk.mcap"
    logger = Logger(path, LIBRARY, said.append, lambda: now_s, room)
    rng = np.random.default_rng(0)
    for tick in range(1200):
        now_s = 0.01 * tick
        angles = tuple(rng.uniform(size=12).tolist())
        row = told(RES, now_s, steps=tick, number=tick + 1, joint_position=angles)
        logger.write(row)
    last = logger.path
    logger.close()
    number = int(last.stem.removeprefix("walk-"))
    assert number > 4
    kept = [tmp_path / f"walk-{n}.mcap" for n in range(number - 2, number + 1)]
    assert sorted(tmp_path.iterdir()) == sorted(kept)
    assert all(file.stat().st_size < 120_000 for file in kept)
    found = [row for file in kept for row in steps(file)[0]]
    assert found == list(range(found[0], 1200))  # none is lost from file to file
    assert said == []


def test_a_log_begins_above_what_another_run_left_and_removes_none_of_it(tmp_path):
    """Its first files had gone; the numbers tell the order."""
    left = [tmp_path / f"a-{n}.mcap" for n in (9, 10)]
    for file in left:
        file.touch()
    room = Room(file_bytes=1, files=2)
    logger = Logger(tmp_path / "a.mcap", LIBRARY, print, count().__next__, room)
    assert logger.path == tmp_path / "a-11.mcap"
    while logger.path != tmp_path / "a-14.mcap":
        logger.write(told(RES))
    logger.close()
    own = [tmp_path / f"a-{n}.mcap" for n in (13, 14)]
    assert set(tmp_path.iterdir()) == {*left, *own}


def test_a_logger_that_is_started_again_goes_on_with_the_files_of_the_log(tmp_path):
    """Older logs of that name are left alone, as they are not its own."""
    path, ledger = tmp_path / "walk.mcap", tmp_path / "log.json"
    older = Logger(path, LIBRARY, print)
    older.close()
    for _ in range(5):  # starts
        room = Room(file_bytes=1, files=3)
        logger = Logger(path, LIBRARY, print, count().__next__, room, ledger)
        for _ in range(2):
            logger.write(told(RES))
        last = logger.path
        logger.close()
    number = int(last.stem.removeprefix("walk-"))
    assert number > 6
    kept = {tmp_path / f"walk-{n}.mcap" for n in range(number - 2, number + 1)}
    assert set(tmp_path.glob("*.mcap")) == {path} | kept


def test_rows_before_the_first_one_are_lost_in_no_file_but_the_first(tmp_path):
    said, room = [], Room(file_bytes=1, files=9)
    logger = Logger(tmp_path / "a.mcap", LIBRARY, said.append, count().__next__, room)
    for number in (23, 24, 17, 18):  # of two loops
        logger.write(told(RES, number=number))
    logger.close()
    logs = [read_log(file) for file in sorted(tmp_path.glob("*.mcap"))]
    assert len(logs) > 2
    for log in logs:
        list(log.telemetries())
    assert sum(log.lost for log in logs) == 22 + 16
    assert said[0] == "22 rows of the loop are not in the log: one gap, 0.1 s at most"


def test_each_file_of_a_log_tells_the_rows_that_it_lost_itself(tmp_path):
    room = Room(file_bytes=1, files=9)
    logger = Logger(tmp_path / "a.mcap", LIBRARY, print, count().__next__, room)
    for number in (1, 5, 6, 9, 10):
        logger.write(told(RES, number=number))
    logger.close()
    files = sorted(tmp_path.glob("*.mcap"))
    logs = [read_log(file) for file in files]
    for log in logs:
        list(log.telemetries())
    assert sum(log.lost for log in logs) == 3 + 2
    assert [rows_lost(file) for file in files] == [log.lost for log in logs]


def test_rows_between_two_loggers_of_a_log_are_counted(tmp_path):
    """The first one was killed: what it had not put on the disk is lost as well."""
    path, ledger, said = tmp_path / "a.mcap", tmp_path / "log.json", []
    times = iter([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    killed = Logger(path, LIBRARY, said.append, lambda: next(times, 1.0), None, ledger)
    for number in range(1, 11):
        killed.write(told(RES, number=number))
    on_disk = [row.number for row in read_log(path).telemetries()]
    assert 0 < len(on_disk) < 10
    again = Logger(path, LIBRARY, said.append, ledger=ledger)
    again.write(told(RES, number=15))
    again.close()
    killed.close()  # which nobody did before the other one began
    log = read_log(tmp_path / "a-2.mcap")
    list(log.telemetries())
    assert log.lost == 14 - on_disk[-1]


@pytest.mark.parametrize("noted", [b"", b"{", b'{"files": 3}'])
def test_a_damaged_list_of_the_files_keeps_no_log_back(tmp_path, noted):
    ledger = tmp_path / "log.json"
    ledger.write_bytes(noted)
    logger = Logger(tmp_path / "walk.mcap", LIBRARY, print, ledger=ledger)
    assert logger.path == tmp_path / "walk.mcap"
    logger.close()


@pytest.mark.slow
def test_rows_that_are_lost_are_told_of_and_noted_in_the_log(tmp_path):
    said, now_s, pace = [], 0.0, replace(PACE, period_s=0.01)
    logger = Logger(tmp_path / "walk.mcap", LIBRARY, said.append, lambda: now_s)
    for tick in range(3000):
        now_s = 0.01 * tick
        if tick % 100 < 70:
            logger.write(told(RES, now_s, number=tick + 1, pace=pace))
    logger.close()
    assert said[0] == ("30 rows of the loop are not in the log: one gap, 0.3 s at most")
    assert 2 <= len(said) <= 4  # not one for each gap
    log = read_log(tmp_path / "walk.mcap")
    list(log.telemetries())
    assert log.lost == 29 * 30
    assert rows_lost(tmp_path / "walk.mcap") == 29 * 30


def test_a_silent_loop_does_not_keep_its_last_words_from_the_disk(tmp_path):
    now_s = 0.0
    logger = Logger(tmp_path / "walk.mcap", LIBRARY, print, lambda: now_s)
    logger.write(told(RES))
    now_s = 0.1
    logger.sync()
    assert steps(tmp_path / "walk.mcap")[0] == []
    now_s = 0.6
    logger.sync()
    assert steps(tmp_path / "walk.mcap")[0] == [0]
    logger.close()


@pytest.fixture
def folder(tmp_path, path, library_path):
    """Of a service that logs."""
    service = tmp_path / "service"
    service.mkdir()
    save_settings(Settings(library=str(library_path), log=str(path)), service)
    return service


def part(folder):
    return subprocess.Popen(
        [sys.executable, "-m", "gaitchain.service.part", "log", str(folder)],
        stdin=subprocess.PIPE,
    )


def beats():
    """Yield numbers, 500 a second, until the deadline."""
    deadline, number = Deadline(), 0
    while not deadline.passed():
        select.select([], [], [], 0.002)
        yield number
        number += 1
    raise AssertionError("nothing came of it")


def test_the_part_logs_the_loop_and_ends_its_file(folder, path):
    loop = LoopEnd(folder)
    with part(folder) as process:
        empty = None
        for number in beats():
            loop.publish(told(RES, 0.002 * number, steps=number))
            size = path.stat().st_size if path.exists() else None
            empty = empty or size
            if size and size > empty:  # rows have come, and were put on the disk
                break
        process.stdin.close()
        for more in range(number + 1, number + 51):  # these are still on the way
            loop.publish(told(RES, 0.002 * more, steps=more))
        assert process.wait(PATIENCE_S) == 0
    loop.close()
    found, log = steps(path)
    assert log.damage == ""
    assert found == list(range(found[0], found[-1] + 1))
    assert found[-1] >= number
    with path.open("rb") as stream:
        counts = make_reader(stream).get_summary().statistics.channel_message_counts
    assert counts[1] == len(found)


def test_the_part_tells_the_loop_when_it_cannot_log(folder, path):
    path.parent.touch()  # a file where a folder should be
    loop, told_of = LoopEnd(folder), []
    with part(folder) as process:
        for _ in beats():
            told_of += loop.requests()
            if told_of:
                break
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    loop.close()
    (note,) = told_of
    assert isinstance(note, Note)
    assert note.kind == "log"
    assert "walk.mcap: cannot be written: " in note.text


def test_a_part_without_a_log_to_write_says_so(tmp_path):
    save_settings(Settings(library="none.gait"), tmp_path)
    with pytest.raises(Exception, match="give --log") as caught:
        run(tmp_path, threading.Event())
    assert not isinstance(caught.value, LogError)
