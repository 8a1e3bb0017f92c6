"""A proof's report says what was walked, by the numbers of a made-up proof."""

import hashlib
import json
import math
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import pytest

from gaitchain.build.push import PushTest
from gaitchain.cli.libraries import shipped_library
from gaitchain.figures.proof_report import write_report
from gaitchain.gait.library_file import load_library
from gaitchain.gait.qualification import (
    ChosenWalks,
    ProofReport,
    StepStrata,
    Stratum,
)
from gaitchain.proof.fall_rate import CHOSEN, Criterion
from gaitchain.proof.falls import potential_drop
from gaitchain.proof.measures import Measures
from gaitchain.proof.push_limit import push_limits
from gaitchain.proof.stops import Stop, judge_stops

BOUND, SCALE_NS = 1e-3, 50.0
SHIPPED = load_library(shipped_library())
WALKED = Stratum("all", 25, 300, 0, 0.0, 1e-3)
STEPS = StepStrata(9, 9, (), (), (), (1e-4, 2e-4, 3e-4))
PROOF = ProofReport(
    BOUND, 0.95, "below", 60.0, WALKED, (WALKED,), (WALKED,), (WALKED,), STEPS
)
HELD = 8.0, 16.0, 32.0


def measures_of(*sides, stops=None):
    """What would be measured, by the critical impulses of each side."""
    tests = [
        PushTest(i, 90.0 * side, 4.0, ns)
        for side, impulses in enumerate(sides)
        for i, ns in enumerate(impulses)
    ]
    limits = push_limits(tests, SCALE_NS)
    return Measures(0.3, SCALE_NS, limits, stops, (), potential_drop(SHIPPED))


class Words(HTMLParser):
    def __init__(self, page):
        super().__init__()
        self.words = []
        self.feed(page)

    def handle_data(self, data):
        self.words.append(data)


def report(folder, library=SHIPPED, measures=None, proof=PROOF):
    """Return what a report says, and its numbers."""
    found = library.proven(proof)
    made = measures or measures_of(HELD)
    page, numbers, *_ = write_report(found, Criterion(BOUND), made, folder)
    words = " ".join(Words(page.read_text("utf-8")).words)
    return words, json.loads(numbers.read_text("utf-8"))


def test_who_falls_without_a_push_is_counted_and_moves_no_limit(tmp_path):
    """One such walk made J5 of this side 0.1 N s."""
    words, numbers = report(tmp_path, measures=measures_of((0.0, *HELD), HELD))
    ahead, left = numbers["measures"]["pushes"]
    assert (ahead["fell_alone"], left["fell_alone"]) == (1, 0)
    assert ahead["j5"] == left["j5"]
    assert ahead["j50"]["ns"] == pytest.approx(16.0)
    assert "1 of 7 walks fell without a push" in words
    plain, _ = report(tmp_path)
    assert "without a push" not in plain


def test_sides_without_two_walks_that_hold_have_no_limit(tmp_path):
    words, numbers = report(tmp_path, measures=measures_of((0.0, 0.0, 9.0), HELD))
    ahead, left = numbers["measures"]["pushes"]
    assert ahead["j50"] is ahead["j5"] is None
    assert left["j50"]["ns"] == pytest.approx(16.0)
    assert "ahead 3 not known not known not known" in words
    assert "2 of 6 walks fell without a push" in words


def test_walks_that_were_no_draws_are_told_apart(tmp_path):
    chosen = ChosenWalks(("friction 0.6", "pyramidal friction"), 21, 1)
    words, numbers = report(tmp_path, proof=replace(PROOF, chosen=chosen))
    for said in (
        "No walk was drawn for 2 of the worlds and contact models; each was walked",
        "21 steps in all, and 1 of these walks fell",
        f"walk {CHOSEN} + i is in world i of the list above",
    ):
        assert said in words
    assert numbers["chosen"]["falls"] == 1
    assert numbers["total"]["falls"] == 0
    plain, numbers = report(tmp_path)
    assert "No walk was drawn" not in plain
    assert numbers["chosen"] is None


def test_heads_of_stops_are_of_those_that_stood(tmp_path):
    stops = judge_stops(
        [Stop(1.25, 0.5, True)] * 3 + [Stop(math.inf, math.inf, False)] * 2
    )
    words, _ = report(tmp_path, measures=measures_of(HELD, stops=stops))
    assert "in 5 walks" in words
    assert "3 of them came to a stand, 2 fell or never stood still" in words
    assert "of those that came to a stand half, within 19 in 20, within all" in words


def test_the_files_hash_is_that_of_the_file_that_is_loaded(tmp_path, monkeypatch):
    """Something else in this folder has the built-in robot's name."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "res").write_text("something else")
    _, numbers = report(tmp_path / "pages")
    file = files("gaitchain") / "data" / "res.toml"
    assert numbers["origin"]["robot's file"] == "res.toml"
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    assert numbers["origin"]["robot's file, SHA-256"] == digest


def test_a_file_that_has_changed_since_is_not_attested(toy_library, toy_path, tmp_path):
    file = tmp_path / "toy.xml"
    file.write_bytes(toy_path.read_bytes())
    library = replace(toy_library, config=replace(toy_library.config, robot=str(file)))

    def said():
        return report(tmp_path, library)[1]["origin"]["robot's file, SHA-256"]

    assert said() == hashlib.sha256(file.read_bytes()).hexdigest()
    text = file.read_text("utf-8")
    file.write_text(text.replace('mass="', 'mass="1', 1), "utf-8")
    assert said().startswith("not given: the file of that name differs")
    file.unlink()
    assert said().startswith("not at hand")


def test_lowered_hips_are_among_what_was_not_tested(tmp_path):
    """Random schedules command none, though the library's range has some."""
    words, numbers = report(tmp_path)
    deepest = SHIPPED.command_range.crouch[0]
    lowered = "Walks with lowered hips, which commands may ask for, up to "
    lowered += f"{1000.0 * deepest:.0f} mm."
    assert deepest > 0.0
    assert lowered in numbers["not_tested"]
    assert lowered in words
    assert set(numbers["commands"]) == {"vx", "vy", "yaw_rate"}


def test_the_command_has_all_that_the_report_depends_on(tmp_path):
    words, _ = report(tmp_path)
    assert "--report DIR -o FILE --report-walks 3" in words


def test_walks_of_strides_last_seconds_in_worlds_of_strides(tmp_path):
    words, _ = report(tmp_path)
    assert "random over that range, walks of 60 s" in words
    assert "friction 0.6 to 1, mass and CoM of links 10 % off at most" in words


def test_walks_of_key_poses_are_told_in_steps_and_in_worlds_of_key_poses(
    library, tmp_path
):
    """Their schedules count steps; seconds are not used."""
    words, numbers = report(tmp_path, library)
    assert "random over that range, walks of 12 steps on average" in words
    assert "walks of 60 s" not in words
    assert "friction 0.6 to 1, servo gain 0.9 to 1.1, mass 0.95 to 1.05" in words
    assert not any("lowered hips" in said for said in numbers["not_tested"])
