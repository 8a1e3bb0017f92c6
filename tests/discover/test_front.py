"""Which way a robot faces: forefeet and knees, then names, then the base's x axis."""

import re

import numpy as np
import pytest
from toy_file import toy
from toy_robot import Toy, built

from gaitchain.discover.find import find
from gaitchain.discover.load import load_model
from gaitchain.discover.profile import Profile
from gaitchain.errors import RobotFileError

ALIKE = (('pos="0.02 0 -0.04"', 'pos="0 0 -0.04"'), ('"0 2.2"', '"-2.2 2.2"'))
SWAPPED = {"left": "right", "right": "left"}


def found_in(folder, text, profile=None):
    path = folder / "toy.xml"
    path.write_text(text, "utf-8")
    return find(load_model(path).model, "toy", profile)


def changed(text, changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def alike(text):
    """The same with feet and knees that do not say where the front is."""
    return changed(text, ALIKE)


def renamed(text, names):
    return re.sub("|".join(names), lambda match: names[match[0]], text)


def front(found):
    return [row[1:] for row in found.evidence if row[0] == "front"]


def test_names_that_agree_with_the_base_are_no_news(tmp_path):
    for text in (toy(), alike(toy())):
        found = found_in(tmp_path, text)
        np.testing.assert_allclose(found.forward, [1, 0, 0])
        assert front(found) == []


@pytest.mark.parametrize(
    ("left", "right"),
    [("left_", "right_"), ("l_", "r_"), ("LLeg", "RLeg"), ("leg_left_", "leg_right_")],
)
def test_names_decide_where_feet_and_knees_do_not(tmp_path, left, right):
    names = {"left_": right, "right_": left, "left": right, "right": left}
    text = renamed(alike(toy()), names)
    found = found_in(tmp_path, text)
    np.testing.assert_allclose(found.forward, [-1, 0, 0], atol=1e-9)
    assert all(joint.startswith(left) for joint in found.left.joints)
    ((how, _),) = front(found)
    assert how == "by the names of left and right"


def test_names_do_not_outvote_feet_and_knees(tmp_path):
    found = found_in(tmp_path, renamed(toy(), SWAPPED))
    np.testing.assert_allclose(found.forward, [1, 0, 0])
    ((how, why),) = front(found)
    assert how == "against the names of left and right"
    assert why.startswith("forefeet +") and "forward in a profile" in why


BACKWARD = (*ALIKE[:1], ('"0 2.2"', '"-2.2 0"'), ('"-2 1"', '"-1 2"'))
"""What makes knees bend backward, under feet that do not say where the front is."""
SIDEWAYS = (("<freejoint/>", '<freejoint/><body euler="0 0 1.5707963">'),)
"""What turns the robot in the base's frame."""


@pytest.mark.parametrize("turned", [False, True])
def test_names_outvote_knees_alone(tmp_path, turned):
    text = changed(toy(), BACKWARD)
    if turned:
        text = changed(text, (*SIDEWAYS, ("</worldbody>", "</body></worldbody>")))
    found = found_in(tmp_path, text)
    forward = [0, 1, 0] if turned else [1, 0, 0]
    np.testing.assert_allclose(found.forward, forward, atol=1e-6)
    assert all(joint.startswith("left_") for joint in found.left.joints)
    ((how, why),) = front(found)
    assert how == "by the names of left and right"
    assert "knees -0.7" in why and "forward in a profile settles it" in why


ROLLS = {"left_roll": "l_hip_r", "right_roll": "r_hip_r", "left": "l", "right": "r"}
"""Names in which an r is for roll, or for right."""


def test_a_word_that_both_legs_have_names_no_side(tmp_path):
    found = found_in(tmp_path, renamed(changed(toy(), BACKWARD), ROLLS))
    np.testing.assert_allclose(found.forward, [1, 0, 0], atol=1e-6)
    assert all(joint.startswith("l_") for joint in found.left.joints)
    assert "l_hip_r" in found.left.joints
    ((how, _),) = front(found)
    assert how == "by the names of left and right"


def test_knees_count_where_names_say_nothing(tmp_path):
    text = renamed(changed(toy(), BACKWARD), {"left": "a", "right": "b"})
    with pytest.raises(RobotFileError, match="front and back look alike"):
        found_in(tmp_path, text)


@pytest.mark.parametrize("names", [{"left": "a", "right": "b"}, {"right": "left_b"}])
def test_the_base_alone_is_a_guess(tmp_path, names):
    found = found_in(tmp_path, renamed(alike(toy()), names))
    np.testing.assert_allclose(found.forward, [1, 0, 0])
    ((how, why),) = front(found)
    assert how == "a guess" and "only the base's x axis says so" in why
    told = found_in(tmp_path, toy(), Profile(forward=(1.0, 0.0, 0.0)))
    assert front(told) == []


def test_legs_in_one_plane_are_refused(tmp_path, recwarn):
    text = re.sub(r'pos="0 -?0\.07 -0\.05"', 'pos="0 0 -0.05"', toy())
    with pytest.raises(RobotFileError, match=r"^toy: both legs lie in one plane"):
        found_in(tmp_path, text)
    assert not recwarn.list


def test_a_front_that_is_not_found_may_be_a_robot_that_lies():
    alike = Toy(forefoot=0.1, heel=0.1, knee_range=(-2.0, 2.0), turn=0.5 * np.pi)
    model, _ = built(alike)
    with pytest.raises(RobotFileError, match=r"in a profile, or up if z is not up$"):
        find(model, "toy")


@pytest.mark.parametrize("turn", [0.0, -0.7])
@pytest.mark.parametrize(("aside", "up"), [(30, 0), (-40, 0), (0, 35), (150, 0)])
def test_a_front_in_the_profile_may_be_off_by_some(turn, aside, up):
    model, _ = built(Toy(turn=turn))
    given = turned(find(model, "toy").forward, aside, 0)
    found = find(model, "toy", Profile(forward=tuple(turned(given, 0, up))))
    np.testing.assert_allclose(found.forward, given, atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, -0.7])
@pytest.mark.parametrize(
    ("aside", "up"), [(60, 0), (89.4, 0), (90, 0), (-90, 0), (0, 60), (0, 90), (0, -90)]
)
def test_a_front_across_the_legs_or_up_is_refused(turn, aside, up, recwarn):
    model, _ = built(Toy(turn=turn))
    forward = find(model, "toy").forward
    given = turned(forward, aside, up)
    with pytest.raises(RobotFileError) as caught:
        find(model, "toy", Profile(forward=tuple(given)))
    said = re.findall(r"forward = \[(.*?)\]", str(caught.value))
    for text, wanted in zip(said, (given, forward), strict=True):
        np.testing.assert_allclose(np.fromstring(text, sep=","), wanted, atol=6e-3)
    off = max(abs(aside), abs(up))
    assert f"is {off:.0f} deg off" in str(caught.value)
    assert str(caught.value).endswith("in a profile, or up if z is not up")
    assert not recwarn.list


def turned(forward, aside, up):
    """A level way, turned to the left and then raised [deg]."""
    aside, up = np.radians([aside, up])
    x, y, _ = forward
    level = np.cos(aside) * np.array([x, y, 0]) + np.sin(aside) * np.array([-y, x, 0])
    return np.cos(up) * level + np.sin(up) * np.array([0, 0, 1])
