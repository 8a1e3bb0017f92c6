"""A proof's report says what was walked, by the numbers of a made-up proof."""

import hashlib
import json
import math
from dataclasses import asdict, replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from page_browser import Watched, chromium

from gaitchain.analysis.rules import MEANINGS, Rule
from gaitchain.build.grid import GridJob, grid_world
from gaitchain.build.push import PushTest
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import CommandError
from gaitchain.figures.proof_report import write_report
from gaitchain.gait.command_range import SHARED
from gaitchain.gait.library_file import load_library
from gaitchain.gait.qualification import (
    ChosenWalks,
    EarlierCriterion,
    OwnReport,
    ProofReport,
    StepStrata,
    Stratum,
)
from gaitchain.messages import Command
from gaitchain.proof import measures as proof_measures
from gaitchain.proof.falls import UNKNOWN, FallsReport, potential_drop
from gaitchain.proof.measures import Measures
from gaitchain.proof.proof_walks import CHOSEN, Criterion, mild_cells
from gaitchain.proof.push_limit import Impulse, push_limits
from gaitchain.proof.stops import Stop, judge_stops
from gaitchain.proof.tally import kind_label
from gaitchain.robot.identified import Identified, unsure_numbers
from gaitchain.sim.world import DISTURBANCES, World

BOUND, SCALE_NS = 1e-3, 50.0
SHIPPED = load_library(shipped_library())
WALKED = Stratum("all", 25, 300, 0, 0.0, 1e-3)
STEPS = StepStrata(9, 9, (), (), (), (1e-4, 2e-4, 3e-4))
PROOF = ProofReport(
    BOUND, 0.95, "below", 60.0, WALKED, (WALKED,), (WALKED,), (WALKED,), STEPS
)
HELD = 8.0, 16.0, 32.0


def measures_of(*sides, stops=None, falls=()):
    """What would be measured, by the critical impulses of each side."""
    tests = [
        PushTest(i, 90.0 * side, 4.0, ns)
        for side, impulses in enumerate(sides)
        for i, ns in enumerate(impulses)
    ]
    limits = push_limits(tests, SCALE_NS)
    return Measures(0.3, SCALE_NS, limits, stops, falls, potential_drop(SHIPPED))


def in_worlds(**changes):
    """Return a proof with a walk of each mild world, kind and contact model."""

    def of(names):
        return tuple(Stratum(name, 1, 12, 0, 0.0, 1.0) for name in names)

    cells = mild_cells(SHIPPED)
    kinds = of(dict.fromkeys(kind_label(cell.kind) for cell in cells))
    contacts = of(["pyramidal friction", "elliptic friction"])
    worlds = of(cell.name for cell in cells)
    rows = {"worlds": worlds, "kinds": kinds, "contacts": contacts}
    return replace(PROOF, **rows, **changes)


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


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    """What the report of the numbers above says, and its own numbers."""
    return report(tmp_path_factory.mktemp("usual"))


def test_other_criteria_by_which_walks_were_judged_are_said(usual, tmp_path):
    words, _ = usual
    assert "Criterion, fixed before the first walk" in words
    assert "other criteria" not in words
    before = EarlierCriterion(1e-4, 0.9, 60.0), EarlierCriterion(1e-2, 0.95, 60.0)
    words, numbers = report(tmp_path, proof=replace(PROOF, before=before))
    assert "Criterion, not the only one by which walks were judged" in words
    assert "Criterion, fixed before the first walk" not in words
    assert "Walks were judged by other criteria as well. " in words
    for each in ("0.0001 with 90 % confidence", "0.01 with 95 % confidence"):
        assert each in words
    assert numbers["before"] == [*map(asdict, before)]


def test_who_falls_without_a_push_is_counted_and_moves_no_limit(usual, tmp_path):
    """One such walk made J5 of this side 0.1 N s."""
    words, numbers = report(tmp_path, measures=measures_of((0.0, *HELD), HELD))
    ahead, left = numbers["measures"]["pushes"]
    assert (ahead["fell_alone"], left["fell_alone"]) == (1, 0)
    assert ahead["j5"] == left["j5"]
    assert ahead["j50"]["ns"] == pytest.approx(16.0)
    assert "1 of 7 walks fell without a push" in words
    assert "without a push" not in usual[0]


def test_sides_without_two_walks_that_hold_have_no_limit(tmp_path):
    words, numbers = report(tmp_path, measures=measures_of((0.0, 0.0, 9.0), HELD))
    ahead, left = numbers["measures"]["pushes"]
    assert ahead["j50"] is ahead["j5"] is None
    assert left["j50"]["ns"] == pytest.approx(16.0)
    assert "ahead 3 not known not known not known" in words
    assert "2 of 6 walks fell without a push" in words


def test_walks_that_were_no_draws_are_told_apart(usual, tmp_path):
    chosen = ChosenWalks(("friction 0.6", "pyramidal friction"), 21, 1)
    words, numbers = report(tmp_path, proof=in_worlds(chosen=chosen))
    for said in (
        "No walk was drawn for 1 world and 1 contact model; each was walked",
        "21 steps in all, and 1 of these walks fell",
        "fell 0 times. 1 world and 1 contact model came up in none of these walks: ",
        "each was walked once in addition, and of these walks 1 fell. ",
        f"walk {CHOSEN} + i is in world i of the list above",
    ):
        assert said in words
    assert numbers["chosen"]["falls"] == 1
    assert numbers["total"]["falls"] == 0
    plain, numbers = usual
    assert "No walk was drawn" not in plain
    assert numbers["chosen"] is None


def test_heads_of_stops_are_of_those_that_stood(tmp_path):
    stops = judge_stops(
        [Stop(1.25, 0.5, stood=True, fell=False)] * 3
        + [Stop(math.inf, math.inf, stood=False, fell=True)] * 2
        + [Stop(6.0, 1.5, stood=False, fell=False)]
    )
    words, numbers = report(tmp_path, measures=measures_of(HELD, stops=stops))
    assert "in 6 walks" in words
    assert "3 of them came to a stand, 2 fell, 1 never stood still" in words
    stops = numbers["measures"]["stops"]
    assert (stops["walks"], stops["stood"], stops["fell"]) == (6, 3, 2)
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


def test_lowered_hips_are_among_what_was_not_tested(usual):
    """Random schedules command none, though the library's range has some."""
    words, numbers = usual
    deepest = SHIPPED.command_range.crouch[0]
    lowered = "Walks with lowered hips, which commands may ask for, up to "
    lowered += "0.006 m."
    assert 0.0065 < deepest < 0.007, "to the nearest it were 7 mm, which is refused"
    assert lowered in numbers["not_tested"]
    assert lowered in words
    assert set(numbers["commands"]) == {"vx", "vy", "yaw_rate"}


def test_ranges_are_told_so_that_their_ends_are_accepted(usual):
    """As `inspect` and refusals tell them; the fastest walk is 0.5756 m/s."""
    words, _ = usual
    span = SHIPPED.command_range
    assert span.vx[1] > 0.5755
    assert "speed ahead, back if negative -0.526 to 0.575 m/s" in words
    assert dict(SHIPPED.describe())["speed ahead"] == "0.000 to 0.575 m/s"
    with pytest.raises(CommandError, match=r"-0\.526 to 0\.575 m/s"):
        span.check(Command(1.0))


def test_that_a_simplified_robot_walked_is_said_where_it_is_looked_for(usual):
    words, numbers = usual
    simple = "a simplified robot: legs as in its file, all else one rigid body, arms"
    assert words.count(simple) == 2
    assert words.index(simple) < words.index("Declared use")
    assert words.rindex(simple) > words.index("What was not tested")
    assert any(simple in said for said in numbers["not_tested"])
    assert numbers["origin"]["what walked"].startswith(simple)


def test_disturbances_were_there_one_at_a_time_as_the_page_says(tmp_path):
    """It listed friction, slope, blocks and masses side by side, as if all together."""
    for cell in mild_cells(SHIPPED):
        alone = [DISTURBANCES[cell.kind].needs] if cell.kind in DISTURBANCES else []
        assert {kind for kind, _ in cell.numbers} <= {cell.kind, *alone}
        world = grid_world(SHIPPED, GridJob((3, 0), cell, "", ()), 0, SCALE_NS)
        assert world.model_error == dict(cell.numbers).get("model_error", 0.0)
    words, numbers = report(tmp_path, proof=in_worlds())
    verdict = words.index("Each walk had one disturbance at a time. No real robot was")
    assert verdict < words.index("What was tested")
    assert "One of them at a time was other than nominal in a walk, never two" in words
    assert "Together with dry friction 2 %." in words
    assert numbers["not_tested"][1].startswith("Disturbances together")


def test_what_has_only_one_side_or_one_kind_is_among_what_was_not_tested(tmp_path):
    """Slopes were ahead alone; some faults of servos were walked, not all."""
    assert World(slope_deg=1.0).up[1] == 0.0
    _, numbers = report(tmp_path)
    said = " ".join(numbers["not_tested"])
    assert "Slopes to the side as the walk starts" in said
    assert "Faults of servos, sensors, bus and cables other than those" in said
    assert "walks lasted 60 s" in said
    assert "Any one world: the verdict is of walks in all worlds" in said


def test_key_poses_have_no_slope_and_no_motion_beside_another(library, tmp_path):
    words, numbers = report(tmp_path, library)
    assert "Slopes to the side" not in words
    assert SHARED not in words
    assert numbers["commands_together"] == ""


def test_the_map_says_what_came_of_all_mild_levels_at_once(tmp_path):
    grid = SHIPPED.qualification.grid
    words, numbers = report(tmp_path)
    first, last = (cell for cell in grid.cells if cell.kind == "corner")
    for cell in first, last:
        held = f"{cell.name}: {cell.passes} of {cell.runs} walks of commands held"
        assert held in words
    runs, passes = last.groups["every step"]
    assert f"held, and {passes} of {runs} that visit every step." in words
    assert any('The rows "all mild" under' in said for said in numbers["not_tested"])
    harder = [cell for cell in grid.cells if not cell.required]
    assert (len(harder) > 2) == ("and show where it ends" in words)


@pytest.mark.parametrize("quick", [True, False])
def test_only_harder_worlds_show_where_it_ends(quick, tmp_path):
    cells = SHIPPED.qualification.grid.cells
    hard = replace(cells[1], name="friction 0.2", required=False)
    kept = tuple(cell for cell in cells if cell.required or cell.kind == "corner")
    grid = replace(SHIPPED.qualification.grid, cells=kept if quick else (*kept, hard))
    tests = replace(SHIPPED.qualification, grid=grid)
    words, _ = report(tmp_path, replace(SHIPPED, qualification=tests))
    assert ("No world was harder than the mild ones" in words) == quick
    assert ("and show where it ends" in words) == (not quick)


def test_that_commands_share_their_range_is_said_beside_it(tmp_path):
    words, numbers = report(tmp_path)
    assert words.index("turning to the left") < words.index(SHARED)
    assert words.index(SHARED) < words.index("friction 0.6")
    assert numbers["commands_together"] in words


def test_each_world_is_explained_and_pushes_are_in_newton_seconds(tmp_path):
    words, numbers = report(tmp_path, proof=in_worlds())
    meant = numbers["world_meanings"]
    for cell in mild_cells(SHIPPED):
        name = cell.name if cell.kind != "push" else f"{cell.name} (2.5 N s)"
        assert f"{name} {meant[cell.name]}" in words
    assert not any("[" in said or "default" in said for said in meant.values())
    assert "0.02 rad/s for the gyro and 0.3 m/s^2" in meant["sensor noise 1"]
    assert "is 50.0 N s for this robot" in words


def test_causes_of_falls_are_explained_where_they_are_counted(tmp_path):
    assert MEANINGS.keys() == set(Rule)
    causes = ((Rule.ZMP.value, 2), (UNKNOWN, 1))
    falls = FallsReport("walks", 4, 3, 3, causes, (1.0, 2.0), (1.0, 2.0))
    words, numbers = report(tmp_path, measures=measures_of(HELD, falls=(falls,)))
    assert f"{Rule.ZMP.value} 2 {MEANINGS[Rule.ZMP]}" in words
    assert "zero moment point" in words
    assert numbers["causes"][Rule.SLIP.value] == MEANINGS[Rule.SLIP]


def test_no_two_rows_have_one_name_and_chosen_walks_are_told_apart(tmp_path):
    proof = in_worlds(chosen=ChosenWalks(("nominal", "slope +1 deg"), 2, 0))
    words, _ = report(tmp_path, proof=proof)
    table = words[words.index("one fall in") : words.index("Steps of the chain")]
    assert table.count(" nominal ") == 1
    assert " nominal 0 + 1 12 0 0 to 1 not known" in table
    assert " friction, all levels 1 12 " in table
    assert " sensor noise 1 1 12 " in table
    assert "sensor noise, all levels" not in table
    assert "contact model: pyramidal friction 1 12 " in table


def test_steps_of_which_nothing_is_known_are_not_told_in_numbers(tmp_path):
    """They read "below 1 for half of the steps, below 1 for the best"."""
    steps = replace(STEPS, high=(1.0, 1.0, 1.0))
    words, _ = report(tmp_path / "none", proof=replace(PROOF, steps=steps))
    assert "Each was walked too seldom to tell how often it falls in it." in words
    steps = replace(STEPS, high=(1e-3, 1.0, 1.0))
    words, _ = report(tmp_path / "one", proof=replace(PROOF, steps=steps))
    assert "0.001 for the best known step, below an unknown rate for the" in words


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("below", "less often than once in 33 steps"),
        ("above", "more often than once in 34 steps"),
    ],
)
def test_one_fall_in_so_many_steps_is_no_more_than_what_is_sure(
    verdict, said, tmp_path
):
    """Of at most 0.0197 falls per step it said one in more than 51 steps."""
    total = replace(WALKED, high=0.0197)
    proof = replace(PROOF, bound=0.03, verdict=verdict, total=total)
    words, _ = report(tmp_path, proof=proof)
    assert f"{said}." in words
    assert "all 25 300 0 0 to 0.02 more than 50 steps" in words


def test_the_report_has_its_date_and_what_it_was_walked_by(tmp_path):
    before = datetime.now(UTC).replace(second=0, microsecond=0)
    words, numbers = report(tmp_path)
    made = numbers["origin"]["report made"]
    assert f"report made {made}" in words
    at = datetime.strptime(made, "%Y-%m-%d %H:%M UTC").replace(tzinfo=UTC)
    assert before <= at <= datetime.now(UTC)
    for package in ("mujoco", "numpy", "Python"):
        assert f"{package} " in numbers["origin"]["walked and reported by"]


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (None, "is no model for a simulator"),
        (OwnReport(False, fault="no actuator"), "could not be walked: no actuator."),
        (OwnReport(True, 2, 20, 19), "19 of 20 schedules without a fall"),
    ],
)
def test_the_numbers_have_what_the_page_says_of_use_and_of_the_own_model(
    own, said, tmp_path
):
    tests = replace(SHIPPED.qualification, own=own)
    words, numbers = report(tmp_path, replace(SHIPPED, qualification=tests))
    verdict = numbers["own_model"]["verdict"]
    assert said in verdict
    assert verdict in words
    found = numbers["own_model"]["found"]
    assert (found or {}).get("survived") == (own and own.survived)
    friction = numbers["conditions"]["friction coefficient of soles and floor"]
    assert friction.startswith("friction 0.6, ")
    for name, value in numbers["conditions"].items():
        assert f"{name} {value}" in words


def test_without_a_grid_the_page_says_that_there_is_none(usual, tmp_path):
    assert "Bold rows are the world nominal and mild worlds" in usual[0]
    words, _ = report(tmp_path, SHIPPED.as_built())
    assert "Bold rows are the world nominal and mild worlds" not in words
    assert "all mild" not in words
    assert "Map of worlds There is none" in words


def test_seeds_of_what_is_measured_draw_its_walks(usual, monkeypatch):
    """Pushes, stops and falls that are provoked, each by the seeds that are written."""
    words, numbers = usual
    seeds = numbers["measure_seeds"]
    for what, text in seeds.items():
        assert f"{what} {text}" in words
    number = 5

    def ours(word):
        (text,) = (t for what, t in seeds.items() if word in what)
        parts = text.strip("()").replace("n", f"{number}").split(", ")
        return tuple(sum(map(int, part.split(" + "))) for part in parts)

    plain = SHIPPED.proven(None)
    course = proof_measures._Course(plain, Criterion(BOUND))
    drawn, cells = course.short(number), mild_cells(plain)
    rng = np.random.default_rng(ours("which world"))
    picked = int(rng.integers(len(cells))), int(rng.integers(2))
    assert picked == (drawn.world, drawn.cone)
    assert drawn.schedule == plain.family.random_schedule(rng, plain.command_range, 6.0)
    job = GridJob(
        ours("numbers of its world")[1:], cells[drawn.world], "", drawn.schedule
    )
    world = grid_world(plain, job, ours("numbers of its world")[0], course.scale_ns)
    assert replace(world, cone=drawn.in_world.cone) == drawn.in_world
    push = course.pushed(number, 90.0, Impulse(8.0, 7.0, 9.0)).in_world.push[-1]
    assert push.at_s == np.random.default_rng(ours("its moment")).uniform(3.0, 5.0)
    asked = []

    def pushes(*job, **_):
        asked.append(job)
        return iter(())

    monkeypatch.setattr(proof_measures, "run_pushes", pushes)
    proof_measures._push(plain, 0.3, 7, Crew(1, lambda *news: None))
    assert ours("from each side") == (asked[0][2], number)


def test_the_command_has_all_that_the_report_depends_on(usual):
    words, _ = usual
    assert "--report DIR -o FILE --report-walks 3" in words


def test_walks_of_strides_last_seconds_in_worlds_of_strides(usual):
    words, _ = usual
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


@pytest.mark.browser
def test_a_phone_shows_all_of_it_without_scrolling_sideways(tmp_path):
    """Hashes and seeds are broken; wide tables and pictures scroll in themselves."""
    robot = SHIPPED.robot
    plain = Identified.of_file(len(robot.legs.joint_names))
    sd = np.zeros(unsure_numbers(len(robot.legs.joint_names)))
    found = robot.as_identified(replace(plain, unknown=np.diag(sd)))
    mine = replace(SHIPPED, poses=replace(SHIPPED.poses, robot=found))
    report(tmp_path, mine)
    with chromium() as browser:
        size = {"width": 375, "height": 667}
        address = (tmp_path / "report.html").as_uri()
        page = Watched(browser, address, viewport=size, is_mobile=True).open()
        assert page.evaluate("document.documentElement.scrollWidth") == 375
        wide = "[...document.querySelectorAll('.wide')]"
        inner, outer = (
            page.evaluate(f"{wide}.map(e => e.{width})")
            for width in ("scrollWidth", "clientWidth")
        )
        drawn = page.evaluate("[...document.images].map(e => e.width)")
        pixels = page.evaluate("[...document.images].map(e => e.naturalWidth)")
    assert any(all_of_it > seen for all_of_it, seen in zip(inner, outer, strict=True))
    for width, of in zip(drawn, pixels, strict=True):
        assert width > 0.4 * of, "its letters cannot be read"
