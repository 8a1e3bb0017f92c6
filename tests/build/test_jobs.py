"""Work in pieces: what is finished is kept, and an interrupted build goes on."""

import gc
import json
import math
import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from full_disk import full_disk
from joblib import parallel_config
from killed_work import killed_work
from patience import Deadline

from gaitchain.build import jobs
from gaitchain.build.jobs import keeping, run_jobs, run_once
from gaitchain.build.journal import Journal
from gaitchain.build.pipeline import build_library
from gaitchain.build.rollout import WalkResult
from gaitchain.build.trial import TrialRun
from gaitchain.build.workers import available_cores, can_stream
from gaitchain.errors import CommandError, JournalError, WorkerError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library_file import library_bytes
from gaitchain.messages import Array
from gaitchain.sim.push import Push
from gaitchain.sim.world import World

TINY = BuildConfig(
    seed=1,
    poses_per_layer=(4, 6, 8, 4),
    walks=6,
    qualification_walks=6,
    gate_runs=2,
    gate_share=0.0,
)


def journal_of(path, *subject):
    return Journal(path / "work.jsonl", *subject)


# --- the file


def test_the_journal_keeps_what_is_finished(tmp_path):
    pieces = [[1, "a"], {"b": 0.1 + 0.2}, [math.inf, -0.0]]
    with journal_of(tmp_path, 1) as journal:
        assert journal.found == []
        for piece in pieces:
            journal.add(piece)
        assert journal.path.read_bytes().count(b"\n") == 4  # nothing waits in memory
    again = journal_of(tmp_path, 1)
    assert again.found == pieces
    assert "going on after 3 finished pieces" in again.greeting
    again.remove()
    assert not again.path.exists()


def test_what_was_begun_and_has_nothing_finished_does_not_go_on(tmp_path):
    with journal_of(tmp_path, 1) as begun:
        pass
    assert begun.path.exists(), "its first line says of what it is"
    assert "kept here until the end" in journal_of(tmp_path, 1).greeting


@pytest.mark.parametrize(
    "torn", [b"[[0, 5], [[0, 1", b"[[0, 5], []]", b"\x80\n", b"[" * 100_000 + b"\n"]
)
def test_a_torn_last_line_is_dropped(tmp_path, torn):
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    whole = journal.path.read_bytes()
    journal.path.write_bytes(whole + torn)
    with journal_of(tmp_path, 1) as again:
        assert again.found == [[1]]
        again.add([2])
    assert journal.path.read_bytes() == whole + b"[2]\n"


def test_a_journal_of_something_else_is_not_used(tmp_path, monkeypatch):
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    assert journal_of(tmp_path, 1).found
    assert not journal_of(tmp_path, 2).found
    monkeypatch.setattr("gaitchain.build.journal.code_digest", lambda: "other")
    other = journal_of(tmp_path, 1)
    assert not other.found
    assert "of other work or code; starting anew" in other.greeting
    with other:
        pass
    monkeypatch.undo()
    assert not journal_of(tmp_path, 1).found
    journal.path.write_bytes(b"")
    assert not journal_of(tmp_path, 1).found


def test_results_of_another_run_are_put_aside(tmp_path):
    """As where a number was mistyped: the file that is put back goes on."""
    for number in (1, 2, 3):
        before = journal_of(tmp_path, number)
        assert ("kept in work.jsonl.old" in before.greeting) is (number > 1)
        with before as journal:
            journal.add([number])
    assert f"kept in work.jsonl.old{number - 1}" in before.greeting, "by the last one"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("work.jsonl", "work.jsonl.old1", "work.jsonl.old2")
    ]
    for number in (1, 2):
        (tmp_path / f"work.jsonl.old{number}").replace(journal.path)
        assert journal_of(tmp_path, number).found == [[number]]


def test_a_file_of_another_run_stays_until_work_begins(tmp_path):
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    kept = journal.path.read_bytes()
    journal_of(tmp_path, 2)
    assert journal.path.read_bytes() == kept
    with journal_of(tmp_path, 2):
        pass
    with journal_of(tmp_path, 3) as empty:
        assert "kept" not in empty.greeting, "a header alone is no result"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_journal_remembers_by_what_its_results_were_judged(tmp_path):
    def judged(by, pieces):
        journal = Journal(tmp_path / "work.jsonl", "of", criterion=by)
        with journal:
            for piece in pieces:
                journal.add(piece)
        return journal.criteria, journal.found

    assert judged([0.1, 0.9], []) == ([], [])
    assert judged([0.2, 0.9], [[1]]) == ([], []), "nothing had been seen"
    assert judged([0.2, 0.9], [[2]]) == ([], [[1]])
    assert judged([0.3, 0.9], []) == ([[0.2, 0.9]], [[1], [2]])
    assert judged([0.2, 0.9], [[3]]) == ([[0.3, 0.9]], [[1], [2]])
    assert judged([0.4, 0.9], []) == ([[0.3, 0.9], [0.2, 0.9]], [[1], [2], [3]])


def test_criteria_of_other_work_are_remembered_if_it_judged_the_same(
    tmp_path, monkeypatch
):
    def judged(about, of, by, pieces):
        path = tmp_path / "work.jsonl"
        with Journal(path, about, of, criterion=by, about=about) as journal:
            for piece in pieces:
                journal.add(piece)
        return journal.criteria

    assert judged(b"res", 10, [0.1], [[1]]) == []
    assert judged(b"res", 6, [0.2], []) == [[0.1]]
    assert judged(b"res", 6, [0.2], [[1]]) == [[0.1]], "though nothing was seen since"
    assert judged(b"op3", 6, [0.3], [[1]]) == [], "others' criteria are none of its own"
    assert judged(b"res", 6, [0.4], []) == [[0.1], [0.2]]
    monkeypatch.setattr("gaitchain.build.journal.code_digest", lambda: "other")
    assert judged(b"res", 6, [0.5], []) == [[0.1], [0.2]]


def test_it_is_said_what_goes_on_from_a_file_that_is_put_aside(tmp_path, monkeypatch):
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    assert "renamed back, the command that began it" in journal_of(tmp_path, 2).greeting
    monkeypatch.setattr("gaitchain.build.journal.code_digest", lambda: "other")
    assert "only the code that began it" in journal_of(tmp_path, 1).greeting


@pytest.mark.parametrize("criteria", [5, None, "a", {"b": 1}])
def test_criteria_that_are_none_are_not_remembered(tmp_path, criteria):
    def journal_of(path, of):
        return Journal(path / "work.jsonl", of, criterion=[0.1])

    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    header, piece = journal.path.read_bytes().splitlines()
    damaged = json.dumps(json.loads(header) | {"criteria": criteria}).encode()
    journal.path.write_bytes(damaged + b"\n" + piece + b"\n")
    with journal_of(tmp_path, 1) as journal:
        assert journal.criteria == []
        assert journal.found == [[1]]


def test_two_runs_at_once_do_not_share_a_journal(tmp_path):
    """The second is refused, whichever state the first is in, and changes nothing."""
    first = journal_of(tmp_path, 1)
    with pytest.raises(JournalError, match="another run writes to it"):
        journal_of(tmp_path, 1)
    with first:
        first.add([1])
        with pytest.raises(JournalError, match="give another -o"):
            journal_of(tmp_path, 2)
    assert [path.name for path in tmp_path.iterdir()] == ["work.jsonl"]
    with journal_of(tmp_path, 1) as second:
        assert second.found == [[1]]


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="a folder without files")
def test_a_folder_in_which_no_file_can_be_made_is_no_other_run():
    with pytest.raises(JournalError, match="cannot be written: no file can be made in"):
        Journal(Path("/proc/work.jsonl"), 1)


def test_who_is_refused_before_work_begins_leaves_no_lock(tmp_path):
    def refused():
        journal = journal_of(tmp_path, 1)
        assert [path.name for path in tmp_path.iterdir()] == ["work.jsonl.lock"]
        raise CommandError(f"{journal.path}: no such cluster")

    with suppress(CommandError):
        refused()
    gc.collect()
    assert not list(tmp_path.iterdir())
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
    assert [path.name for path in tmp_path.iterdir()] == ["work.jsonl"]


def test_a_journal_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(CommandError, match="cannot be written"):
        Journal(tmp_path / "nowhere" / "work.jsonl").__enter__()


def test_a_full_disk_keeps_what_was_finished(tmp_path):
    with journal_of(tmp_path, 1) as journal:
        journal.add([1])
        room = journal.path.stat().st_size
    with (
        full_disk(room + 40),
        pytest.raises(JournalError, match=r"work\.jsonl: cannot be written: \w+"),
        journal_of(tmp_path, 1) as full,
    ):
        full.add(list(range(200)))
    with journal_of(tmp_path, 1) as again:
        assert again.found == [[1]]
        again.add([2])
    assert journal_of(tmp_path, 1).found == [[1], [2]]


def test_a_full_disk_that_has_room_again_keeps_the_last_piece(tmp_path):
    journal = journal_of(tmp_path, 1)
    with journal, full_disk(100), pytest.raises(JournalError):
        journal.add(list(range(200)))
    assert journal_of(tmp_path, 1).found == [list(range(200))]


# --- results


def work(number):
    return number / 3


def test_only_what_is_missing_is_done_again(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(jobs, "delayed", lambda call: counted(call, done))
    with keeping(journal_of(tmp_path)):
        begun = run_jobs(work, [(n,) for n in range(5)], float, 1)
        first = [next(begun) for _ in range(3)]
        begun.close()
    kept = len(journal_of(tmp_path).found)
    assert 3 <= kept < 5
    done.clear()
    with keeping(journal_of(tmp_path)):
        both = [list(run_jobs(work, [(n,) for n in range(5)], float, 1)) for _ in "ab"]
    assert both[0] == both[1] == [n / 3 for n in range(5)]
    assert both[0][:3] == first
    assert done == [*range(kept, 5), *range(5)]


def counted(call, done):
    def noting(*job):
        done.append(job[0])
        return (call, job, {})

    return noting


def test_work_in_this_process_is_done_once(tmp_path):
    """Its arrays come back to the last bit, between the results of other jobs."""
    kind, done = tuple[Array, Array], []

    def fitted():
        done.append(os.getpid())
        return np.array([0.1 + 0.2, math.nan, -0.0]), np.eye(2) / 3.0

    def both():
        with keeping(journal_of(tmp_path)):
            before = list(run_jobs(work, [(1,)], float, 1))
            found = run_once("fit", fitted, kind)
            return before + list(run_jobs(work, [(2,)], float, 1)), found

    first, again = both(), both()
    assert done == [os.getpid()]
    assert first[0] == again[0] == [1 / 3, 2 / 3]
    assert [array.tobytes() for array in first[1]] == [a.tobytes() for a in again[1]]
    assert len(run_once("fit", fitted, kind)) == 2, "without a journal"
    assert len(done) == 2


def lines_in(path):
    return path.read_bytes().count(b"\n") if path.exists() else 0


def waiting_work(number, path, lines):
    """Work that is done where the journal has so many lines."""
    deadline = Deadline()
    while lines_in(path) < lines:
        assert not deadline.passed(), f"{lines_in(path)} lines"
    return work(number)


def test_what_finishes_behind_a_slow_job_is_kept_at_once(tmp_path):
    """The first job ends only where all others are in the journal."""
    journal, others = journal_of(tmp_path), 12
    jobs_of = [(n, journal.path, (1 + others) * (n == 0)) for n in range(1 + others)]
    with keeping(journal), parallel_config(backend="threading"):
        found = list(run_jobs(waiting_work, jobs_of, float, 2))
    assert found == [n / 3 for n in range(1 + others)], "in the order of the jobs"
    kept = [key[-1] for key, _ in journal_of(tmp_path).found]
    assert kept[-1] == 0
    assert sorted(kept) == list(range(1 + others))


def test_without_a_stream_no_more_than_a_part_of_the_jobs_waits(tmp_path):
    """As on Ray: the last job ends only where the first ones are in the journal."""
    journal = journal_of(tmp_path)
    count = 2 * jobs._AT_ONCE + 1
    jobs_of = [(n, journal.path, count * (n == count - 1)) for n in range(count)]
    with keeping(journal), parallel_config(backend="multiprocessing"):
        found = list(run_jobs(waiting_work, jobs_of, float, 2))
    assert found == [n / 3 for n in range(count)]


def test_a_resumed_run_does_what_is_missing_in_between(tmp_path, monkeypatch):
    """Results of any order are those of their jobs, and later calls go on."""
    done = []
    monkeypatch.setattr(jobs, "delayed", lambda call: counted(call, done))
    with journal_of(tmp_path) as journal:
        for number in (3, 1):
            journal.add([[1, "work", 5, number], number / 3])
    for missing in ([0, 2, 4], []):
        with keeping(journal_of(tmp_path)):
            both = [
                list(run_jobs(work, [(n,) for n in range(5)], float, 1)) for _ in "ab"
            ]
        assert both == [[n / 3 for n in range(5)]] * 2
        assert done == [*missing, *range(5)] * bool(missing)
        done.clear()


@pytest.mark.parametrize(
    "damaged", [[1, "work", 3, 0], [1, "work", 3, 9], [1, "work", 3, "a"], 5, []]
)
def test_a_piece_that_cannot_be_is_dropped_with_what_follows(damaged, tmp_path):
    with journal_of(tmp_path) as journal:
        for key in ([1, "work", 3, 0], damaged, [1, "work", 3, 1]):
            journal.add([key, 0.0])
    with keeping(journal_of(tmp_path)):
        assert list(run_jobs(work, [(n,) for n in range(3)], float, 1)) == [
            0.0,
            1 / 3,
            2 / 3,
        ]
    kept = journal_of(tmp_path).found
    assert [key[-1] for key, _ in kept] == [0, 1, 2]


def test_results_of_other_work_are_dropped(tmp_path):
    """As where a search that is short of time comes less far than before."""
    with keeping(journal_of(tmp_path)):
        list(run_jobs(work, [(1,)], float, 1))
        list(run_jobs(work, [(2,), (3,)], float, 1))
    with keeping(journal_of(tmp_path)) as _:
        assert list(run_jobs(work, [(1,)], float, 1)) == [1 / 3]
        assert list(run_jobs(work, [(5,)], float, 1)) == [5 / 3]
    with journal_of(tmp_path) as journal:
        assert [result for _, result in journal.found] == [1 / 3, 5 / 3]
        journal.add("damaged")
    with keeping(journal_of(tmp_path)):
        for number in (1, 5, 7):
            assert list(run_jobs(work, [(number,)], float, 1)) == [number / 3]


def test_results_of_the_same_work_on_something_else_are_dropped(tmp_path):
    """As many jobs in the same call of a function, which is chosen by what came."""
    for numbers in ((1.0, 2.0), (4.0, 9.0)):
        with keeping(journal_of(tmp_path)):
            jobs_now = [(number,) for number in numbers]
            came = list(run_jobs(math.sqrt, jobs_now, float, 1, of=f"{numbers}"))
        assert came == [math.sqrt(number) for number in numbers]


def test_results_come_back_to_the_last_bit(tmp_path):
    world = World(speed_limit_deg_s=math.inf, push=(Push(1 / 3, 30.0, 0.1),), seed=7)
    trial = TrialRun((2**32, 1), "0.1@2", True, None, 1 / 3, 2.0, (1, 2), world=world)
    walk = WalkResult(
        np.array([1 / 3, np.nan, 1e-320]),
        np.array([-0.0]),
        np.array([1 / 7]),
        np.array([1 / 9]),
        fell=True,
        pushed=False,
    )
    with keeping(journal_of(tmp_path)):
        list(run_jobs(same, [(trial,)], TrialRun, 1))
        list(run_jobs(same, [(walk,)], WalkResult, 1))
    with keeping(journal_of(tmp_path)):
        (again,) = run_jobs(same, [(None,)], TrialRun, 1)
        (walked,) = run_jobs(same, [(None,)], WalkResult, 1)
    assert again == trial
    for name in ("cost", "advance", "error", "slip"):
        assert getattr(walked, name).tobytes() == getattr(walk, name).tobytes()
    assert walked.fell


def same(value):
    return value


@pytest.mark.slow
def test_an_interrupted_build_gives_the_same_bytes(tmp_path, monkeypatch):
    """Interrupted in training, then in the walks of every step, then in the gate."""
    whole, _ = build_library(TINY)
    add = Journal.add
    for stop_at in (3, 9, 13):

        def stop(self, piece, stop_at=stop_at):
            add(self, piece)
            if len(self.path.read_bytes().splitlines()) > stop_at:
                raise KeyboardInterrupt

        monkeypatch.setattr(Journal, "add", stop)
        with pytest.raises(KeyboardInterrupt), keeping(journal_of(tmp_path, TINY)):
            build_library(TINY)
        assert len(journal_of(tmp_path, TINY).found) == stop_at
    monkeypatch.setattr(Journal, "add", add)
    with keeping(journal_of(tmp_path, TINY)):
        library, _ = build_library(TINY)
    assert len(journal_of(tmp_path, TINY).found) == 6 + 6 + 2
    assert library_bytes(library) == library_bytes(whole)


@pytest.mark.parametrize("backend", ["loky", "threading", "multiprocessing"])
def test_results_come_in_order_also_where_none_comes_before_the_last(backend):
    """Joblib's multiprocessing has no generator of results, as Ray has none."""
    numbers = [float(n) for n in range(20)]
    with parallel_config(backend=backend):
        assert can_stream() == (backend != "multiprocessing")
        found = list(run_jobs(math.sqrt, [(n,) for n in numbers], float, 2))
    assert found == [math.sqrt(n) for n in numbers]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_jobs_whose_process_is_killed_are_sent_again(tmp_path):
    (tmp_path / "kills").mkdir()
    journal = journal_of(tmp_path)
    jobs_of = [(1, number, tmp_path / "kills") for number in range(9)]
    with keeping(journal):
        found = list(run_jobs(killed_work, jobs_of, float, 2, batch_size=1))
    assert found == [n / 3 for n in range(9)], "in the order of the jobs"
    assert len(list((tmp_path / "kills").iterdir())) == 1
    kept = [key[-1] for key, _ in journal_of(tmp_path).found]
    assert sorted(kept) == list(range(9)), "each is kept once"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_job_whose_process_is_always_killed_ends_the_work(tmp_path):
    (tmp_path / "kills").mkdir()
    jobs_of = [(1000, number, tmp_path / "kills") for number in range(3)]
    with keeping(journal_of(tmp_path)), pytest.raises(WorkerError, match="memory"):
        list(run_jobs(killed_work, jobs_of, float, 2, batch_size=1))
    kept = [key[-1] for key, _ in journal_of(tmp_path).found]
    assert sorted(kept) == [0, 1], "the others are finished"


@pytest.mark.parametrize(("counted", "cores"), [(6, 6), (None, 1)])
def test_off_linux_a_process_may_use_all_cores(counted, cores, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: counted)
    assert available_cores() == cores
