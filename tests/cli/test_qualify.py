"""`gaitchain qualify`: journal, table, map, exit codes, clusters."""

import json
import sys

import pytest
from joblib.parallel import get_active_backend

import gaitchain.cli.qualify as verb
from gaitchain.build.grid import Grid, GridRun, Levels
from gaitchain.build.journal import Journal
from gaitchain.build.qualify import default_grid
from gaitchain.cli import cluster, run
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.qualification import GridReport

TINY = Grid((), corners=False)
RUNS = [
    GridRun((0, 3), [(0, 1), (1, 0)], False),
    GridRun((0, 1), [], True),
    GridRun((1, 0), [(0, 2)], True),
]


@pytest.fixture
def file(library, tmp_path):
    path = tmp_path / "res.gait"
    save_library(library, path)
    return path


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(verb, "default_grid", lambda library, **options: TINY)


def journal_of(file, library, grid=TINY):
    path = file.with_name("res.gait.qualify.jsonl")
    return Journal(path, library_bytes(library.as_built()), grid)


def test_a_verdict_does_not_make_another_library(file, library):
    """The journal of a library that is qualified already stays its own."""
    with journal_of(file, library) as journal:
        journal.add(RUNS[0])
    judged = library.judged(GridReport(False, 1, 0.9, (), ()))
    assert journal_of(file, judged).found
    other = journal_of(file, library, Grid((Levels("mass", (1.1,)),)))
    assert not other.found


def test_walks_come_back_from_a_journal_as_they_were(file, library):
    with journal_of(file, library) as journal:
        for r in [*RUNS, {"not": "a walk"}]:
            journal.add(r)
    *whole, damaged = map(verb._read_run, journal_of(file, library).found)
    assert whole == RUNS
    assert damaged is None


def test_what_follows_a_damaged_walk_is_cut_off(file, library, tiny, monkeypatch):
    """New walks behind it were dropped with it by every later run."""
    damaged = [[[0, "1"], [[0, 1]], False], {"not": "a walk"}]
    with journal_of(file, library) as begun:
        for piece in [RUNS[0], *damaged, RUNS[1]]:
            begun.add(piece)
    given = []

    def one_more(library, grid, crew, done, note):
        given.append(done)
        note(RUNS[2])
        raise KeyboardInterrupt

    monkeypatch.setattr(verb, "qualify_grid", one_more)
    assert run(["qualify", str(file), "--workers", "1"]) == 130
    assert given == [{RUNS[0].key: RUNS[0]}]
    kept = list(map(verb._read_run, journal_of(file, library).found))
    assert kept == [RUNS[0], RUNS[2]]


@pytest.mark.slow
def test_it_goes_on_after_an_interrupt(
    file, library, qualified, tiny, monkeypatch, capsys
):
    known = qualified[1][6:]  # saves time: another run found these
    with journal_of(file, library) as begun:
        for finished in known:
            begun.add(finished)
    journal = file.with_name("res.gait.qualify.jsonl")
    keep, before = Journal.add, file.read_bytes()

    def stop(self, finished):
        keep(self, finished)
        if finished.key[1] >= 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(Journal, "add", stop)
    assert run(["qualify", str(file), "--workers", "1"]) == 130
    assert "goes on from there" in capsys.readouterr().out
    assert file.read_bytes() == before
    done = len(journal.read_bytes().splitlines()) - 1
    assert done == len(known) + 5
    monkeypatch.setattr(Journal, "add", keep)
    figures, picture = file.with_name("q.json"), file.with_name("q.png")
    words = ["--json", str(figures), "--map", str(picture)]
    code = run(["qualify", str(file), "--workers", "1", *words])
    out = capsys.readouterr().out
    assert f"going on after {done} finished pieces" in out
    assert "steps taken out" in out
    assert not journal.exists()
    found = load_library(file)
    assert code == (0 if found.qualified else 1)
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    data = json.loads(figures.read_text())
    assert data["passed"] is found.qualified
    assert data["taken_out"] == list(map(list, found.qualification.grid.taken_out))
    assert library_bytes(found.as_built()) == before


def test_a_library_that_does_not_pass_exits_1(file, library, monkeypatch, capsys):
    def failing(library, *_):
        return library.judged(GridReport(False, 1, 0.9, (), ()))

    monkeypatch.setattr(verb, "qualify_grid", failing)
    out = file.with_name("judged.gait")
    assert run(["qualify", str(file), "-o", str(out)]) == 1
    assert "does not pass" in capsys.readouterr().out
    assert not load_library(out).qualified
    assert load_library(file).qualified
    assert run(["trial", str(out), "--runs", "1"]) == 2  # the walker refuses it
    assert run(["qualify", str(out)]) == 1  # but it may be tried again


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--workers", "0"], "--workers 0: give 1 to 4096"),
        (["--seeds", "0"], "--seeds 0: give 1 to 1000"),
        (["--address", "here:1"], "--address here:1: loky is this machine"),
        (["--map", "/proc/nowhere/a.png"], "/proc/nowhere"),
        (
            ["--bound", "0.1", "--report-walks", "5"],
            "--report-walks: of the report; give --report DIR as well",
        ),
        (
            ["--bound", "0.1", "--report", "/proc/nowhere"],
            "name one in your own folder",
        ),
    ],
)
def test_what_cannot_be_is_said_at_once(file, words, message, capsys):
    assert run(["qualify", str(file), *words]) == 2
    assert message in capsys.readouterr().err


def test_a_report_that_cannot_be_written_is_refused_before_any_walk(
    file, tmp_path, capsys
):
    words = ["qualify", str(file), "--bound", "0.1", "-o", str(tmp_path / "P.gait")]
    taken, folder = tmp_path / "taken", tmp_path / "pages"
    taken.write_text("mine")
    (folder / "pushes.png").mkdir(parents=True)
    for pages, why in (
        (taken, "there is a file of that name; name another folder"),
        (folder, "pushes.png: cannot be written, as it is a folder"),
    ):
        assert run([*words, "--report", str(pages)]) == 2
        told = capsys.readouterr()
        assert why in told.err
        assert not told.out
    assert taken.read_text() == "mine"


def test_only_a_library_is_replaced_by_a_library(file, tiny, tmp_path, capsys):
    other = tmp_path / "results.json"
    other.write_text('{"robot": "mine"}')
    assert run(["qualify", str(file), "-o", str(other)]) == 2
    why = f"{other}: it is there, and not a gait library that can be read; name another"
    assert why in capsys.readouterr().err
    assert other.read_text() == '{"robot": "mine"}'


def test_a_library_that_comes_with_gaitchain_stays_as_it_is(capsys):
    before = shipped_library().read_bytes()
    assert run(["qualify", "res"]) == 2
    assert "name another file for the verdict with -o" in capsys.readouterr().err
    assert shipped_library().read_bytes() == before


@pytest.mark.parametrize(
    ("backend", "module"), [("ray", "ray"), ("dask", "distributed")]
)
def test_a_missing_cluster_names_its_extra(file, backend, module, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    assert run(["qualify", str(file), "--backend", backend]) == 2
    assert f"pip install 'gaitchain[{backend}]'" in capsys.readouterr().err


def test_dask_by_name(file, library, tiny, monkeypatch, capsys):
    """The verb starts a cluster of this machine and stops it."""
    backends = []

    def look(library, grid, crew, *_):
        backends.append(type(get_active_backend()[0]).__name__)
        return library.judged(GridReport(True, 1, 0.9, (), ()))

    monkeypatch.setattr(verb, "qualify_grid", look)
    words = ["qualify", str(file), "--backend", "dask", "--workers", "1"]
    assert run(words) == 0
    assert backends == ["DaskDistributedBackend"]
    monkeypatch.setattr(cluster, "_PATIENCE_S", 1)
    assert run([*words, "--address", "127.0.0.1:9"]) == 2
    assert "--address 127.0.0.1:9: no dask scheduler" in capsys.readouterr().err


def test_the_default_grid_is_the_librarys(library, brisk):
    assert default_grid(brisk) != default_grid(library)
