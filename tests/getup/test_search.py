"""The search of a way up, small, on a robot that nobody tuned."""

import os
import pickle
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from lying_robot import keeps_its_limits
from planned_library import planned_library

from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import CommandError, RobotFileError
from gaitchain.gait.get_up import TimedPose, Way
from gaitchain.getup import exploration, fallen_robot, search
from gaitchain.getup.exploration import Exploration
from gaitchain.getup.fallen_robot import BodyState, FallenRobot, Subject
from gaitchain.getup.reached import Reached, go_on, lying, rises_on
from gaitchain.getup.search import Effort, WaySearch, assemble, search_ways
from gaitchain.getup.ways import TAIL, Tried, judge, squatting, way_of

UP = BodyState(up=1.0, ahead=0.0, high=1.0, off=0.0, lifted=0.0, speed=0.0, flat=1.0)
DOWN = BodyState(up=0.0, ahead=-1.0, high=0.2, off=1.0, lifted=0.0, speed=0.0, flat=0.0)


@pytest.fixture(scope="module")
def subject(toy_path, toy_library):
    return Subject(toy_path, toy_library)


@pytest.fixture(scope="module")
def robot(subject):
    return fallen_robot.fallen_robot(subject)


def test_a_robot_is_known_by_its_library_and_its_file(toy_path, toy_library, tmp_path):
    """A library that stands lower, and a file that was changed, have models anew."""
    file = tmp_path / "toy.xml"
    file.write_bytes(toy_path.read_bytes())
    subject = Subject(file, toy_library)
    again = Subject(file, replace(toy_library))
    assert subject == again and hash(subject) == hash(again)
    assert pickle.loads(pickle.dumps(subject)) == subject, "as workers get it"
    high = toy_library.poses
    poses = replace(high, hip_height=0.95 * high.hip_height)
    lower = Subject(file, replace(toy_library, poses=poses))
    assert lower != subject
    stands = [fallen_robot.fallen_robot(one).stand for one in (subject, lower)]
    assert np.abs(stands[0] - stands[1]).max() > 0.05
    os.utime(file, ns=(0, 1))
    assert Subject(file, toy_library) != subject


def test_a_file_that_is_gone_is_told_by_its_model(toy_library, tmp_path):
    subject = Subject(tmp_path / "gone.xml", toy_library)
    with pytest.raises(RobotFileError, match=r"gone\.xml: no such file"):
        fallen_robot.fallen_robot(subject)


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(exploration, "_STEPS", 8)
    monkeypatch.setattr(search, "_CROWD", 6)


def untold(*_):
    """Nobody looks at the progress."""


def still(robot):
    """A way of four poses that stays as it lies."""
    return np.zeros(4 * (len(robot.pairs) + 1) + TAIL)


@pytest.mark.parametrize(("side", "ahead"), [("front", -1.0), ("back", 1.0)])
def test_it_lies_on_the_side_that_was_asked_for(robot, side, ahead):
    lain = set()
    for start in range(4):
        robot.lie(side, (5, start))
        felt = robot.backend.read().acceleration
        assert ahead * felt[0] > 0.8 * 9.81
        look = robot.look()
        assert ahead * look.ahead > 0.8
        assert not look.stands
        assert look.high < 0.5
        assert look.speed < 0.1
        lain.add(tuple(robot.backend.data.qpos.round(6)))
    assert len(lain) == 4  # each start lies otherwise


def test_the_same_start_is_the_same_world(robot):
    seen = []
    for _ in range(2):
        robot.lie("front", (5, 1))
        seen.append((robot.backend.data.qpos.copy(), robot.backend.model.body_mass[1]))
        robot.lie("back", (5, 2))
    np.testing.assert_array_equal(seen[0][0], seen[1][0])
    assert seen[0][1] == seen[1][1] != robot.backend.model.body_mass[1]


def test_the_floors_friction_is_drawn_for_contact_pairs_too(toy_path, tmp_path):
    """MuJoCo takes the friction of a pair from the pair alone."""
    text = toy_path.read_text()
    for side in ("left", "right"):
        at = text.index('<geom type="box" size="0.09', text.index(f'name="{side}6"'))
        text = f'{text[:at]}<geom name="{side}_sole"{text[at + len("<geom") :]}'
    grip = 'friction="0.9 0.9 0.01 0.001 0.001"'
    pairs = "".join(
        f'<pair geom1="{side}_sole" geom2="ground" {grip}/>'
        for side in ("left", "right")
    )
    floor = '<geom name="ground" type="plane" size="0 0 1"/>'
    text = text.replace("<worldbody>", f"<worldbody>{floor}", 1)
    text = text.replace("<actuator>", f"<contact>{pairs}</contact><actuator>", 1)
    (tmp_path / "pairs.xml").write_text(text)
    library = planned_library(load_robot(tmp_path / "pairs.xml"))
    robot = FallenRobot(tmp_path / "pairs.xml", library)
    model, grips = robot.backend.model, []
    assert model.npair == 2
    plain = model.geom_friction[:, 0].max()
    for start in ((1, 0), (1, 1), (1, 0)):
        robot.lie("back", start)
        grips.append(float(model.geom_friction[:, 0].max() / plain))
        np.testing.assert_allclose(model.pair_friction[:, :2], 0.9 * grips[-1])
    assert grips[0] == grips[2] != grips[1]
    assert 0.6 <= min(grips) < 1.0


@pytest.mark.parametrize(("length", "help_"), [(0.1, False), (0.2, True)])
def test_legs_pitch_and_arms_help_that_are_long(
    toy_path, toy_library, tmp_path, length, help_
):
    text = toy_path.read_text().replace('-0.2" size="0.02"', f'-{length}" size="0.02"')
    (tmp_path / "arms.xml").write_text(text)
    robot = FallenRobot(tmp_path / "arms.xml", toy_library)
    names = robot.backend.joint_names
    moved = {names[pair.left] for pair in robot.pairs}
    assert {"left_pitch", "left_knee", "left_ankle"} == moved - {"left_shoulder"}
    assert ("left_shoulder" in moved) == help_


@pytest.mark.parametrize(("forearm", "helps"), [(0.1, False), (0.2, True)])
def test_an_elbow_helps_and_a_wrist_does_not(toy_path, tmp_path, forearm, helps):
    """By what it carries of the arm, however long the whole arm is."""
    text = toy_path.read_text()
    for side in ("left", "right"):
        hand = f'''<body pos="0 0 -0.2"><joint name="{side}_elbow" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -{forearm}" size="0.02" mass="0.2"/>
          </body></body>'''
        at = text.index("</body>", text.index(f"{side}_shoulder"))
        text = text[:at] + hand + text[at + len("</body>") :]
        motor = f'<position name="{side}_elbow" joint="{side}_elbow" kp="40"/>'
        text = text.replace("</actuator>", f"{motor}</actuator>")
    (tmp_path / "arms.xml").write_text(text)
    library = planned_library(load_robot(tmp_path / "arms.xml"))
    robot = FallenRobot(tmp_path / "arms.xml", library)
    names = robot.backend.joint_names
    moved = {names[pair.left] for pair in robot.pairs}
    assert "left_elbow" in names
    assert "left_shoulder" in moved
    assert ("left_elbow" in moved) == helps


def test_a_way_keeps_the_limits_of_the_joints(robot):
    rng = np.random.default_rng(3)
    for _ in range(20):
        way = way_of(robot, rng.normal(0.0, 3.0, len(still(robot))))
        assert keeps_its_limits(robot, way.poses)


def test_who_stands_is_worth_more_than_who_lies_or_falls_again():
    stands, lies = judge([DOWN] * 40 + [UP] * 40), judge([DOWN] * 80)
    falls = judge([DOWN] * 20 + [UP] * 30 + [DOWN] * 30)
    assert stands.stood
    assert not lies.stood
    assert not falls.stood
    assert stands.value > falls.value > lies.value
    # Feet in the air and a CoM beside them are worth less at the same height.
    for worse in (UP._replace(off=0.5), UP._replace(lifted=0.5), UP._replace(up=0.5)):
        assert judge([worse] * 80).value < stands.value


@pytest.mark.usefixtures("small")
def test_a_search_is_the_same_with_any_number_of_workers(subject, robot):
    told, found = [], []
    for workers in (1, 2):
        effort = Effort(2, 4, workers)
        found.append(
            search_ways(subject, ("front",), effort, lambda *words: told.append(words))
        )
    assert found[0] == found[1]
    half = len(told) // 2
    assert told[:half] == told[half:]
    assert told[0] == ("up from the front", 0, 2)
    assert told[half - 1] == ("up from the front", 2, 2)
    whole = assemble(subject, found[0])
    assert whole.joint_names == robot.backend.joint_names
    assert whole.fingerprint == subject.library.robot.fingerprint


def test_going_on_from_what_was_kept_is_going_the_whole_way(subject, robot):
    starts = (1, 0), (1, 3)
    rows = np.random.default_rng(5).normal(0.0, 0.7, (2, len(robot.pairs) + 1))
    begin = lying(robot, "back", starts)
    reached = go_on(subject, "back", starts, (rows[0],), begin.states)
    robot.lie("front", (1, 1))  # somebody else has the robot in between
    reached = go_on(subject, "back", starts, tuple(rows), reached.states)
    whole = way_of(robot, np.append(rows, np.zeros(TAIL)))
    poses = msgspec.structs.replace(whole, poses=whole.poses[:2])
    for start, state, look in zip(starts, *reached, strict=True):
        robot.lie("back", start)
        robot.move(poses, hold_s=0.0)
        np.testing.assert_array_equal(state, robot.state)
        assert look == robot.look()


def test_what_differs_from_one_lying_to_another_is_not_alike():
    assert Reached((), (UP, UP, UP)).alike
    for other in (DOWN, UP._replace(off=0.5), UP._replace(flat=0.0)):
        assert not Reached((), (UP, UP, other)).alike
    # A tilt of half a turn either way is the same.
    over = [UP._replace(up=-1.0, ahead=ahead) for ahead in (-0.1, 0.1)]
    assert Reached((), tuple(over)).alike
    assert Reached((), (UP, DOWN)).worth == Reached((), (DOWN,)).worth
    assert not Reached((), (UP, DOWN)).near_its_feet


def test_who_squats_rises_and_who_lies_does_not(subject, robot):
    starts = (1, 0), (1, 1)
    still = np.zeros(len(robot.pairs) + 1)
    squat = squatting(robot, still, 0.6)
    tail = np.array([0.0, 0.6])
    assert not rises_on(
        subject, "back", starts, (tail,), lying(robot, "back", starts).states
    )
    robot.backend.connect(robot.squats.at(0.6))
    states = (robot.state, robot.state)
    assert rises_on(subject, "back", starts, (squat, tail), states)


@pytest.mark.slow
def test_exploring_goes_up_and_keeps_what_it_does_not_like(subject, monkeypatch):
    monkeypatch.setattr(exploration, "_STEPS", 24)
    starts = (1, 0), (1, 1)
    explored = Exploration(subject, "back", starts, np.random.default_rng(1), 1)
    (begin,) = explored._known.values()
    for _, ways in zip(range(4), explored.rounds(), strict=False):
        assert ways == []  # a toy without hands stays down
    reached = [known.reached for known in explored._known.values()]
    heights = [one.worth for one in reached]
    assert max(heights) > begin.reached.worth + 0.1
    assert len(heights) > 8
    assert min(heights) < begin.reached.worth
    assert max(len(known.numbers) for known in explored._known.values()) > 1
    assert all(one.alike and len(one.states) == len(starts) for one in reached)


def test_a_way_that_stands_from_other_starts_is_taken(subject, robot, monkeypatch):
    def came(ways, starts):
        assert len(starts) > 3  # more than it was found from
        return [[Tried(float(way[0] == 2.0), stood=False)] for way in ways]

    search_ = WaySearch(subject, "back", Effort(1, 1, 1), untold)
    monkeypatch.setattr(search_, "_try", came)
    ways = [np.full(4, number) for number in (1.0, 2.0, 3.0)]
    np.testing.assert_array_equal(search_._best_of(ways), ways[1])


def test_a_robot_without_mirrored_joints_is_refused(subject, monkeypatch):
    monkeypatch.setattr(fallen_robot.fallen_robot(subject), "pairs", ())
    with pytest.raises(CommandError, match="no joint has a mirror image"):
        WaySearch(subject, "front", Effort(1, 1, 1), untold)


STANDS, LIES = (Way((TimedPose(1.0, (0.0,)),), stood, 24) for stood in (24, 3))
OVER = Way((TimedPose(2.0, (0.0,)),), 23, 24)


def test_who_gets_up_from_one_side_only_rolls_over_to_it(subject, monkeypatch):
    """And searches on where that does not help either, to the end."""
    gone_on = []

    def go_on(one):
        one.left -= 1
        gone_on.append(one._side)
        return STANDS if one._side == "back" else LIES

    rolls = {"over": OVER}
    monkeypatch.setattr(WaySearch, "go_on", go_on)
    monkeypatch.setattr(search.RollSearch, "run", lambda *_: rolls["over"])
    sides, effort = ("front", "back"), Effort(2, 1, 1)
    found = search_ways(subject, sides, effort, untold)
    assert found == {"front": OVER, "back": STANDS}
    assert gone_on == ["front", "back"]
    rolls["over"] = LIES
    assert search_ways(subject, sides, effort, untold)["front"] == LIES
    assert gone_on[2:] == ["front", "back", "front"]
    assert search_ways(subject, ("front",), effort, untold) == {"front": LIES}


def test_each_turn_rolls_otherwise(subject, monkeypatch):
    drawn = []

    def go_on(one):
        one.left -= 1
        return STANDS if one._side == "back" else LIES

    def rolls(one):
        drawn.append(one._rng.random())
        return []

    monkeypatch.setattr(WaySearch, "go_on", go_on)
    monkeypatch.setattr(search.RollSearch, "_rolls", rolls)
    search_ways(subject, ("front", "back"), Effort(3, 1, 1), untold)
    assert len(drawn) == 3 * 12
    assert len({*drawn}) == len(drawn)
