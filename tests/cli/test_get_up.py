"""`gaitchain get-up`: OP3 falls and gets up; searching is resumed; bad input."""

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from full_disk import full_disk
from planned_library import planned_library
from toy_file import toy

from gaitchain.build import journal
from gaitchain.cli import get_up, run
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.get_up import TimedPose, Way, load_get_up, save_get_up
from gaitchain.gait.library_file import save_library
from gaitchain.getup import exploration, search
from gaitchain.getup.fallen_robot import Subject
from gaitchain.getup.rise_trial import RiseResult
from gaitchain.getup.search import assemble

SHARED = Path(__file__).parents[3] / "shared" / "robots"
OP3 = Path(os.environ.get("MENAGERIE_ROOT") or SHARED) / "robotis_op3/op3.xml"
WAYS = Path(__file__).parents[1] / "support" / "op3.getup"


@pytest.fixture(scope="module")
def toy_gait(toy_library, tmp_path_factory):
    path = tmp_path_factory.mktemp("toy") / "toy.gait"
    save_library(toy_library, path)
    return path


@pytest.mark.slow
@pytest.mark.skipif(not OP3.is_file(), reason=f"no {OP3}; set MENAGERIE_ROOT")
def test_op3_gets_up_from_both_sides(tmp_path, capsys):
    robot = load_robot(OP3)
    save_library(planned_library(robot), tmp_path / "op3.gait")
    out, page = tmp_path / "new.getup", tmp_path / "up.html"
    words = f"get-up {tmp_path}/op3.gait {OP3} --ways {WAYS} -o {out} --runs 4 --seed 9"
    assert run(f"{words} --workers 1 --replay {page} --json -".split()) == 0
    told = json.loads(capsys.readouterr().out)
    for side in ("front", "back"):
        assert told["sides"][side]["stood"] == 4
        assert len(told["sides"][side]["each"]) == 4
    found = load_get_up(out, robot)
    assert found.ways["front"].starts == 4
    assert found.ways["front"].poses == load_get_up(WAYS, robot).ways["front"].poses
    assert "robotis_op3: gaitchain get-up" in page.read_text("utf-8")


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(exploration, "_STEPS", 6)
    monkeypatch.setattr(search, "_CROWD", 6)


def searched(toy_gait, toy_path, out, *words):
    base = ["get-up", str(toy_gait), str(toy_path), "-o", str(out), "--runs", "2"]
    return run([*base, "--generations", "2", "--workers", "1", *words])


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_an_interrupted_search_goes_on_and_finds_the_same(
    toy_gait, toy_path, tmp_path, monkeypatch, capsys
):
    whole, again = tmp_path / "whole.getup", tmp_path / "again.getup"
    code = searched(toy_gait, toy_path, whole)
    assert code == 1  # nothing stands up after two generations
    add, added = journal.Journal.add, []

    def interrupted(self, piece):
        added.append(piece)
        if len(added) > 14:
            raise KeyboardInterrupt
        add(self, piece)

    with monkeypatch.context() as patch:
        patch.setattr(journal.Journal, "add", interrupted)
        assert searched(toy_gait, toy_path, again) == 130
    assert not again.exists()
    assert "the same command goes on from there" in capsys.readouterr().out
    assert searched(toy_gait, toy_path, again) == 1
    assert "going on after 14 finished pieces" in capsys.readouterr().out
    assert again.read_bytes() == whole.read_bytes()
    assert not list(tmp_path.glob("*.jsonl"))


@pytest.mark.usefixtures("small")
def test_an_interrupt_between_the_falls_keeps_the_search(
    toy_gait, toy_path, tmp_path, monkeypatch, capsys
):
    """The falls come after the search, which takes much longer."""
    whole, again = tmp_path / "whole.getup", tmp_path / "again.getup"
    searched(toy_gait, toy_path, whole, "--sides", "back")
    add, added = journal.Journal.add, []

    def interrupted(self, piece):
        (_, of, *_), _ = piece
        add(self, piece)
        added.append(of)
        if of == "rise":
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(journal.Journal, "add", interrupted)
        assert searched(toy_gait, toy_path, again, "--sides", "back") == 130
    assert added.count("rise") == 1
    assert not again.exists()
    assert "the same command goes on from there" in capsys.readouterr().out
    searched(toy_gait, toy_path, again, "--sides", "back")
    assert f"going on after {len(added)} finished pieces" in capsys.readouterr().out
    assert again.read_bytes() == whole.read_bytes()
    assert not list(tmp_path.glob("*.jsonl"))


def _interrupt(self, piece):
    raise KeyboardInterrupt


@pytest.mark.usefixtures("small")
def test_a_search_does_not_go_on_in_another_model_or_stand(
    toy_library, tmp_path, monkeypatch, capsys
):
    """Neither where a part of the robot's file changed, nor its library alone."""
    file, part, gait = (tmp_path / name for name in ("toy.xml", "part.xml", "toy.gait"))
    file.write_text(toy().replace("<compiler", '<include file="part.xml"/><compiler'))
    rough, smooth = (
        f'<mujoco><default><geom friction="{grip}"/></default></mujoco>'
        for grip in (1.0, 0.2)
    )
    poses = replace(toy_library.poses, hip_height=0.98 * toy_library.poses.hip_height)
    lower = replace(toy_library, poses=poses)
    works = (rough, toy_library), (smooth, toy_library), (smooth, lower)
    monkeypatch.setattr(journal.Journal, "add", _interrupt)
    for second, (text, library) in enumerate(works, start=1):
        part.write_text(text)
        os.utime(file, (second, second))  # or the model is not read again
        save_library(library, gait)
        said = []
        for _ in range(2):
            assert searched(gait, file, tmp_path / "toy.getup") == 130
            said.append(capsys.readouterr().out)
        anew = "of other work or code; starting anew"
        assert (anew in said[0]) is (second > 1)
        assert "kept here until the end" in said[1]


@pytest.mark.usefixtures("small")
def test_a_full_disk_leaves_what_is_finished(toy_gait, toy_path, tmp_path, capsys):
    with full_disk(2000):
        assert searched(toy_gait, toy_path, tmp_path / "toy.getup") == 2
    assert "toy.getup.search.jsonl: cannot be written" in capsys.readouterr().err
    assert (tmp_path / "toy.getup.search.jsonl").stat().st_size > 1000


@pytest.mark.usefixtures("small")
def test_one_side_alone(toy_gait, toy_path, tmp_path, capsys):
    out = tmp_path / "back.getup"
    searched(toy_gait, toy_path, out, "--sides", "back")
    assert list(json.loads(out.read_text())["ways"]) == ["back"]
    assert "front" not in capsys.readouterr().out


@pytest.fixture
def known(toy_library, toy_path, tmp_path):
    """Write a file of ways up from some sides; they lead nowhere."""

    def written(*sides):
        file = tmp_path / f"{'_'.join(sides)}.getup"
        way = Way((TimedPose(0.1, (0.0,) * 14),), 0, 1)
        subject = Subject(toy_path, toy_library)
        save_get_up(assemble(subject, dict.fromkeys(sides, way)), file)
        return file

    return written


def tried(toy_gait, toy_path, ways, out, *words):
    base = ["get-up", str(toy_gait), str(toy_path), "--ways", str(ways), "-o", str(out)]
    return run([*base, "--runs", "1", "--workers", "1", *words])


def test_known_ways_are_tried_from_the_sides_asked_for(
    toy_gait, toy_path, known, tmp_path, capsys
):
    out, ways = tmp_path / "out.getup", known("front", "back")
    tried(toy_gait, toy_path, ways, out, "--sides", "back", "--json", "-")
    assert list(json.loads(capsys.readouterr().out)["sides"]) == ["back"]
    assert list(json.loads(out.read_text())["ways"]) == ["back"]
    before = ways.read_bytes()
    assert tried(toy_gait, toy_path, ways, ways, "--sides", "back") == 2
    assert "would lose its way from the front" in capsys.readouterr().err
    assert ways.read_bytes() == before


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("ways", ["", "front", "front_too"])
def test_no_side_of_an_existing_output_is_lost(
    ways, toy_gait, toy_path, known, tmp_path, capsys
):
    """It was, after a search of hours."""
    out = known("front", "back")
    before = out.read_bytes()
    if ways:
        front = known("front")
        sides = ("--sides", "front") if ways == "front" else ()
        assert tried(toy_gait, toy_path, front, out, *sides) == 2
    else:
        assert searched(toy_gait, toy_path, out, "--sides", "front") == 2
    assert "would lose its way from the back" in capsys.readouterr().err
    assert out.read_bytes() == before
    assert not list(tmp_path.glob("*.search.jsonl"))


def test_a_full_disk_keeps_the_ways_of_before(
    toy_gait, toy_path, known, tmp_path, capsys
):
    out, ways = tmp_path / "out.getup", known("front")
    assert tried(toy_gait, toy_path, ways, out, "--sides", "front") in (0, 1)
    before = out.read_bytes()
    capsys.readouterr()
    with full_disk(100):
        assert tried(toy_gait, toy_path, ways, out, "--sides", "front") == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == f"gaitchain: {out}: cannot be written: File too large"
    assert out.read_bytes() == before
    assert not list(tmp_path.glob(".*"))


def test_a_side_without_a_known_way_does_not_pass(
    toy_gait, toy_path, known, tmp_path, capsys, monkeypatch
):
    stands = RiseResult(stood=True, tries=1, seconds=1.0)
    monkeypatch.setattr(get_up, "try_rising", lambda *of: iter([stands]))
    out, front, both = tmp_path / "out.getup", known("front"), known("front", "back")
    assert tried(toy_gait, toy_path, both, tmp_path / "both.getup") == 0
    assert tried(toy_gait, toy_path, front, out, "--sides", "front") == 0
    assert "no way from" not in capsys.readouterr().out
    assert tried(toy_gait, toy_path, front, out) == 1
    assert f"{front}: has no way from the back\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("sides", "asked", "lacks"),
    [((), "both", "front or back"), (("front",), "back", "back")],
)
def test_ways_of_none_of_the_sides_are_refused(
    sides, asked, lacks, toy_gait, toy_path, known, tmp_path, capsys
):
    words = "--sides", asked, "--replay", str(tmp_path / "up.html")
    ways, out = known(*sides), tmp_path / "out.getup"
    assert tried(toy_gait, toy_path, ways, out, *words) == 2
    assert (
        capsys.readouterr().err == f"gaitchain: {ways}: has no way from the {lacks}\n"
    )
    assert not out.exists()


def test_bad_input_is_one_line(toy_gait, toy_path, tmp_path, capsys):
    def said(*words, library=str(toy_gait)):
        out = str(tmp_path / "x.getup")
        assert run(["get-up", library, *words, "-o", out]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    nothing = tmp_path / "nothing.xml"
    assert "nothing.xml: no such file; give a" in said(str(nothing))
    assert "without arms" in said(str(toy_path), library="res")
    assert "without arms" in said("res", library="res")
    assert "another robot (robotis_op3)" in said(str(toy_path), "--ways", str(WAYS))
    assert "--generations 0" in said(str(toy_path), "--generations", "0")
    for text in ("<mujoco/>", "no xml"):
        nothing.write_text(text)
        assert "nothing.xml" in said(str(nothing))
