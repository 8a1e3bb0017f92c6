"""`gaitchain qualify --bound`: verdict, table, exit code, and going on."""

import contextlib
import hashlib
import json
import re
import signal
import subprocess
import sys
from ast import literal_eval
from dataclasses import asdict, replace
from functools import wraps
from html.parser import HTMLParser

import msgspec
import numpy as np
import pytest
import small_proof

from gaitchain.build import push
from gaitchain.build.journal import Journal
from gaitchain.cli import run
from gaitchain.cli.tried import tried
from gaitchain.errors import LibraryError
from gaitchain.figures.proof_report import write_report
from gaitchain.gait.library_file import library_bytes, load_library
from gaitchain.gait.qualification import EarlierCriterion
from gaitchain.proof import measures, proof_walks
from gaitchain.proof.measures import Measures
from gaitchain.proof.proof_walks import (
    BANK,
    CHOSEN,
    Criterion,
    draw_walk,
    mild_cells,
    seed_of,
)
from gaitchain.proof.rate_test import fewest_steps
from gaitchain.robot.identified import Identified, unsure_numbers

WORDS = ["--bound", "0.05", "--seconds", "3", "--workers", "1"]


@pytest.fixture(scope="module", autouse=True)
def brief():
    with small_proof.few_worlds(), small_proof.few_at_once():
        yield


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    folder = tmp_path_factory.mktemp("proof")
    out, report = folder / "P.gait", folder / "p.json"
    words = ["qualify", "res", *WORDS, "-o", str(out), "--json", str(report)]
    words += ["--report", str(folder / "pages"), "--report-walks", "2"]
    with pytest.MonkeyPatch.context() as patch:  # what is withstood is not looked at
        patch.setattr(push, "RESOLUTION", 1.0 / 16.0)
        patch.setattr(push, "_RUN_IN_S", 2.0)
        patch.setattr(push, "_AFTER_S", 2.0)
        patch.setattr(measures, "_STOPS", 1)
        with (folder / "said.txt").open("w") as said, contextlib.redirect_stdout(said):
            code = run(words)
        return code, out, json.loads(report.read_text())


@pytest.mark.slow
def test_the_verdict_is_in_the_library_and_the_report(proven):
    code, out, facts = proven
    proof = load_library(out).qualification.proof
    assert code == 0
    assert (proof.verdict, facts["verdict"]) == ("below", "below")
    assert facts["total"]["falls"] == 0
    assert facts["bound"] == 0.05
    assert not list(out.parent.glob("*.jsonl")), "the journal is removed"


@pytest.mark.slow
def test_no_two_rows_of_the_table_have_one_name_and_chosen_walks_are_told_apart(proven):
    _, out, facts = proven
    said = (out.parent / "said.txt").read_text()
    rows = [line.split("│")[1:3] for line in said.splitlines() if "│" in line]
    walks = {name.strip(): number.strip() for name, number in rows}
    assert len(walks) == len(rows)
    apart = {name for name, number in walks.items() if number.endswith(" + 1")}
    assert len(apart) == len(facts["chosen"]["names"]) > 0
    assert "friction, all levels" in walks
    assert "of their own world or model alone, as" in " ".join(said.split())


class Text(HTMLParser):
    """What a page says, and what it takes from elsewhere."""

    def __init__(self, page):
        super().__init__()
        self.words, self.sources = [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.slow
def test_the_report_says_what_was_shown_and_what_was_not(proven):
    _, out, facts = proven
    folder = out.parent / "pages"
    page = Text((folder / "report.html").read_text("utf-8"))
    said = " ".join(page.words)
    total = facts["total"]
    numbers = json.loads((folder / "report.json").read_text("utf-8"))
    limit = Criterion(0.05, seconds=3.0).limit
    assert numbers["most_steps"] == facts["most_steps"] == limit
    assert numbers["identified"] is None
    command = "gaitchain qualify LIBRARY --bound 0.05 --confidence 0.95 --seconds 3"
    for words in (
        "mixed in equal parts: it falls in fewer than 0.05 of its steps, with 95 %",
        f"walked {total['steps']} steps in {total['walks']} walks, and fell 0 times",
        "No real robot was tested",
        "What was not tested",
        "with a probability of at most 0.05".capitalize(),
        load_library(out).robot.fingerprint,
        f"{command} --most-steps {limit} --report DIR -o FILE",
        f"without a verdict after {limit} steps",
        "below 0.65 of their height, or its trunk leans by 45 deg",
        "of its file; no real robot was measured",
        *(f"{what} {seeds}" for what, seeds in numbers["seeds"].items()),
    ):
        assert words.lower() in said.lower()
    measures = numbers["measures"]
    drop = measures["drop"]
    assert drop["potential_j"] == pytest.approx(9.81 * drop["mass_kg"] * drop["com_m"])
    assert f"m g h = {drop['potential_j']:.0f} J" in said
    for side in measures["pushes"]:
        assert f"{side['j5']['ns']:.1f} ({side['j5']['low']:.1f} to" in said
        assert f"{side['j50']['ns']:.1f} ({side['j50']['low']:.1f} to" in said
    assert f"{measures['stops']['seconds'][1]:.2f} s" in said
    of_proof, pushed = measures["falls"]
    assert of_proof["falls"] == 0 < pushed["falls"] <= pushed["walks"] == 8
    for cause, count in pushed["causes"]:
        assert cause in said
        assert count > 0
    for stratum in facts["worlds"] + facts["contacts"]:
        assert stratum["name"] in said
    assert all(source.startswith("data:") for source in page.sources)
    assert numbers["total"] == facts["total"]
    own = load_library(out).proven(None)
    digest = hashlib.sha256(library_bytes(own)).hexdigest()
    assert digest in numbers["origin"].values()


@pytest.mark.slow
def test_the_seeds_of_the_report_draw_its_walks(proven):
    """Those of a walk's world, and those of its commands and of which world it is."""
    _, out, _ = proven
    seeds = json.loads((out.parent / "pages" / "report.json").read_text())["seeds"]
    plain = load_library(out).proven(None)
    cells, brief = mild_cells(plain), Criterion(0.05, seconds=3.0)
    for number in range(6):
        ours = [literal_eval(s.replace("n", f"{number}")) for s in seeds.values()]
        assert ours[0] == ours[1][:-1] == (seed_of(plain), BANK, number)
        rng = np.random.default_rng(ours[1])
        drawn = draw_walk(plain, brief, cells, 1.0, (seed_of(plain), number))
        picked = int(rng.integers(len(cells))), int(rng.integers(2))
        assert picked == (drawn.world, drawn.cone)
        most = plain.command_range
        assert plain.family.random_schedule(rng, most, 3.0) == drawn.schedule


@pytest.mark.slow
def test_a_report_of_an_identified_robot_has_what_was_identified(proven, tmp_path):
    _, out, _ = proven
    library = load_library(out)
    old = json.loads((out.parent / "pages" / "report.json").read_text())
    measures = msgspec.convert(old["measures"], Measures)
    plain = Identified.of_file(len(library.robot.legs.joint_names))
    gain = plain.gain.copy()
    gain[3] = 0.777
    play = np.where(np.arange(len(gain)) == 3, 1.25, 0.5)
    count = len(gain)
    sd = np.zeros(unsure_numbers(count))
    sd[:count], sd[2 * count : 2 * count + 3] = 0.061, 0.0042
    unknown = np.diag(sd)
    found = replace(plain, gain=gain, delay_s=0.0123, unknown=unknown)
    found = replace(found, backlash_deg=play, trunk_mass=1.08, imu_delay_s=0.0071)
    poses = replace(library.poses, robot=library.robot.as_identified(found))
    mine = replace(library, poses=poses)
    page, numbers, *_ = write_report(mine, Criterion(0.05), measures, tmp_path)
    said = " ".join(Text(page.read_text("utf-8")).words)
    joint = library.robot.legs.joint_names[3]
    for words in (
        "identified of one real robot",
        "not that of its file but one robot as its own log showed it",
        f"{joint} 0.777 1.000 0.00 deg 1.25 deg 0.000",
        "mass and inertia of the trunk, times 1.080",
        "IMU late by 7.1 ms",
        "delay of the targets 12.3 ms",
        "servo gain 6.1 %",
        "CoM of the trunk 4.2 mm",
        "Not estimated from the log",
    ):
        assert words in said
    facts = json.loads(numbers.read_text("utf-8"))
    assert facts["identified"] == found.facts()


def test_nothing_to_report_is_said(tmp_path):
    library = load_library("src/gaitchain/data/res.gait")
    with pytest.raises(LibraryError, match="has no proof"):
        write_report(library, Criterion(0.03), None, tmp_path)


def test_a_report_needs_a_bound(tmp_path, capsys):
    assert run(["qualify", "res", "--report", str(tmp_path)]) == 2
    assert "--report: of a bound on falls" in capsys.readouterr().err


@pytest.mark.slow
def test_inspect_shows_it(proven, capsys):
    assert run(["inspect", str(proven[1])]) == 0
    words = capsys.readouterr().out.replace("│", " ").split()
    assert "fewer than 0.05 falls per step" in " ".join(words)


def interrupted_after(count, words, monkeypatch):
    """Run a command until so many walks are kept; return its exit code."""
    keep, kept = Journal.add, []

    def stop(self, finished):
        keep(self, finished)
        kept.append(finished)
        if len(kept) == count:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", stop)
        return run(words)


def test_a_cluster_that_is_not_there_costs_no_walk(tmp_path, monkeypatch, capsys):
    words = ["qualify", "res", *WORDS, "-o", str(tmp_path / "P.gait")]
    assert interrupted_after(3, words, monkeypatch) == 130
    journal = tmp_path / "P.gait.proof.jsonl"
    kept = journal.read_bytes()
    capsys.readouterr()
    assert run([*words, "--backend", "dask", "--address", "nowhere://1"]) == 2
    assert "going on after 3 finished pieces" in capsys.readouterr().out
    assert journal.read_bytes() == kept


@pytest.mark.slow
def test_it_goes_on_after_an_interrupt(proven, tmp_path, monkeypatch, capsys):
    out = tmp_path / "P.gait"
    words = ["qualify", "res", *WORDS, "-o", str(out)]
    assert interrupted_after(5, words, monkeypatch) == 130
    assert "goes on from there" in capsys.readouterr().out
    assert not out.exists()
    assert run(words) == 0
    assert "going on after 5 finished pieces" in capsys.readouterr().out
    assert out.read_bytes() == proven[1].read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGKILL])
def test_a_killed_proof_walks_nothing_again(signum, proven, tmp_path, capsys):
    out = tmp_path / "P.gait"
    words = ["qualify", "res", *WORDS, "-o", str(out)]
    child = subprocess.Popen([sys.executable, small_proof.__file__, *words])
    kept = tmp_path / "P.gait.proof.jsonl"
    wait_until(lambda: kept.exists() and kept.read_bytes().count(b"\n") > 4, child)
    child.send_signal(signum)
    assert child.wait(60.0) != 0
    assert not out.exists()
    done = kept.read_bytes().count(b"\n") - 1
    assert done >= 4
    assert run(words) == 0
    assert f"going on after {done} finished pieces" in capsys.readouterr().out
    assert out.read_bytes() == proven[1].read_bytes()


def wait_until(holds, child):
    """Wait for what a running child is to bring about."""
    while not holds():
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(0.05)
        assert child.returncode is None, "it ended too early"


def test_too_few_steps_for_any_verdict_are_refused_with_the_least(tmp_path, capsys):
    words = ["qualify", "res", *WORDS, "-o", str(tmp_path / "P.gait")]
    assert run([*words, "--most-steps", "10"]) == 2
    said = capsys.readouterr().err
    least = int(re.search(r"give --most-steps (\d+) or more", said)[1])
    assert least == fewest_steps(0.05)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_was_walked_without_a_verdict_is_not_walked_again(
    proven, tmp_path, monkeypatch, capsys
):
    """With more steps, and for another bound, the same walks count."""
    out, walk, numbers = tmp_path / "P.gait", proof_walks._walk, []

    @wraps(walk)
    def noted(*job):
        numbers.append(job[-1][1])
        return walk(*job)

    monkeypatch.setattr(proof_walks, "_walk", noted)
    words = ["qualify", "res", *WORDS, "-o", str(out)]
    few = [*words, "--bound", "0.04", "--most-steps", "96"]
    assert run(few) == 1
    said = capsys.readouterr().out
    assert "neither fewer nor more than 0.04 falls" in said
    assert "a larger --most-steps goes on from there" in said
    assert numbers == list(range(18))
    assert run([*words, "--json", str(tmp_path / "p.json")]) == 0
    said = capsys.readouterr().out
    assert "going on after 18 finished pieces" in said
    assert "criteria as well, for the falls per step: 0.04 with 95 % confidence" in said
    assert all(number >= CHOSEN for number in numbers[18:])
    library, earlier = load_library(out), EarlierCriterion(0.04, 0.95, 3.0)
    proof = library.qualification.proof
    assert proof.before == (earlier,)
    assert json.loads((tmp_path / "p.json").read_text())["before"] == [asdict(earlier)]
    fixed = library.proven(replace(proof, before=()))
    assert library_bytes(fixed) == proven[1].read_bytes()
    assert not list(tmp_path.glob("*.jsonl"))


def test_a_criterion_that_is_chosen_after_a_verdict_is_no_fixed_one(
    proven, tmp_path, monkeypatch, capsys
):
    """Neither where the output has it, nor where the library itself does."""
    out, own = tmp_path / "P.gait", tmp_path / "Q.gait"
    out.write_bytes(proven[1].read_bytes())
    own.write_bytes(proven[1].read_bytes())
    new = ["--bound", "0.04", "--seconds", "3", "--workers", "1"]
    for words in (["res", *new, "-o", str(out)], [str(own), *new]):
        assert interrupted_after(1, ["qualify", *words], monkeypatch) == 130
        assert "0.05 with 95 % confidence in walks of 3 s" in capsys.readouterr().out
    other = ["res", *new, "--bound", "0.05", "-o", str(tmp_path / "R.gait")]
    assert interrupted_after(1, ["qualify", *other], monkeypatch) == 130
    assert "other criteria" not in capsys.readouterr().out


def test_a_criterion_of_walks_of_another_length_is_remembered(
    tmp_path, monkeypatch, capsys
):
    """Though the walks are others: who saw some chooses the next with that in mind."""
    out = tmp_path / "P.gait"
    words = ["qualify", "res", "--workers", "1", "-o", str(out)]
    begun = [*words, "--bound", "0.04", "--seconds", "3"]
    assert interrupted_after(1, begun, monkeypatch) == 130
    assert "other criteria" not in capsys.readouterr().out
    for seconds in ("4", "5"):
        other = [*words, "--bound", "0.03", "--seconds", seconds]
        assert interrupted_after(1, other, monkeypatch) == 130
        said = capsys.readouterr().out
        assert "starting anew" in said
        assert "0.04 with 95 % confidence in walks of 3 s" in said
    assert "0.03 with 95 % confidence in walks of 4 s" in said
    monkeypatch.setattr("gaitchain.build.journal.code_digest", lambda: "other")
    assert interrupted_after(1, begun, monkeypatch) == 130
    assert "0.03 with 95 % confidence in walks of 5 s" in capsys.readouterr().out


@pytest.mark.parametrize("kept", [["a", 1, 2], [0.1], 5, None, {}])
def test_a_damaged_criterion_is_passed_over(kept, tmp_path):
    with Journal(tmp_path / "P.jsonl", criterion=[0.1, 0.9, 3.0]) as journal:
        journal.criteria = [kept, [0.2, 0.9, 3]]
        assert tried(journal) == [EarlierCriterion(0.2, 0.9, 3.0)]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--bound", "0.03", "--quick"], "--quick: of the grid of worlds"),
        (["--bound", "0.03", "--map", "m.png"], "--map: of the grid of worlds"),
        (["--bound", "0.03", "--seeds", "2"], "--seeds: of the grid of worlds"),
        (["--most-steps", "9"], "--most-steps: of a bound on falls; give --bound"),
        (["--confidence", "0.9"], "--confidence: of a bound on falls"),
        (["--splitting", "0.1"], "--splitting: of a bound on falls"),
        (
            ["--bound", "0.03", "--splitting", "0.1", "--seconds", "5"],
            "--seconds: of the test of a bound",
        ),
        (["--bound", "0.05"], "less than 1 / bound, 20 steps; give --seconds 3 or"),
        (["--bound", "0"], "bound"),
        (["--bound", "0.03", "--confidence", "1"], "confidence"),
    ],
)
def test_what_makes_no_sense_is_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["qualify", "res", *words, "-o", str(tmp_path / "P.gait")]) == 2
    out, err = capsys.readouterr()
    assert said in err
    assert out == "", "nothing is promised before it is refused"
    assert not list(tmp_path.iterdir())
