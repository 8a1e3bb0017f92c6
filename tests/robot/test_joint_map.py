"""Any order, signs and further joints of a robot: the same walk."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planned_library import planned_library

from gaitchain.backends.mock import MockBackend
from gaitchain.errors import CommandError
from gaitchain.messages import Command
from gaitchain.robot.box_robot import JOINT_NAMES, box_legs, load_box_robot
from gaitchain.robot.joint_map import JointMap
from gaitchain.walker.walker import Walker

HELD = {"neck": 0.2, "left_elbow": -0.7, "right_elbow": 0.7}
LEGS = box_legs(load_box_robot("res").reduced)
FULL = replace(LEGS, held=HELD)
TICKS = 150


@pytest.fixture(scope="module")
def planned():
    """A library of a full robot with joints that are held still."""
    return planned_library(replace(load_box_robot("res"), legs=FULL))


@pytest.fixture(scope="module")
def walked(planned):
    return walk(Walker(planned))[0]


def walk(walker):
    """Walk on perfect servos; return all targets in the walker's own order."""
    backend = MockBackend(0.01)
    backend.connect(walker.stand)
    walker.command(Command(0.3))
    rows, names = [], ()
    for _ in range(TICKS):
        targets = walker.step(backend.read())
        rows.append(targets.position)
        names = targets.joint_names
        backend.write(targets.position)
    return np.array(rows), names


orders = st.sets(st.sampled_from(sorted(HELD))).flatmap(
    lambda held: st.permutations([*JOINT_NAMES, *sorted(held)])
)


@settings(max_examples=15)
@given(orders, st.data())
def test_order_signs_and_further_joints_change_nothing(planned, walked, names, data):
    signs = {n: data.draw(st.sampled_from([1, -1])) for n in names}
    found, told = walk(Walker(planned, joint_names=names, signs=signs))
    assert told == tuple(names)
    for column, name in enumerate(names):
        own = signs[name] * found[:, column]
        if name in HELD:
            assert np.all(own == HELD[name])
        else:
            assert np.array_equal(own, walked[:, JOINT_NAMES.index(name)])


def test_without_a_map_nothing_is_copied(planned):
    walker = Walker(planned)
    assert walker.standing_targets.joint_names == JOINT_NAMES
    assert np.array_equal(walker.stand, walker.gait.stand)
    held = walker.standing_targets.position
    assert np.array_equal(held, walker.gait.stand_targets)


def test_signs_alone_keep_the_librarys_order(planned):
    walker = Walker(planned, signs={"left_knee": -1})
    targets = walker.standing_targets
    assert targets.joint_names == JOINT_NAMES
    knee = JOINT_NAMES.index("left_knee")
    assert targets.position[knee] == -Walker(planned).gait.stand_targets[knee]
    assert walker.stand[knee] == -Walker(planned).stand[knee]


def test_a_robot_of_boxes_maps_as_well(library):
    names = JOINT_NAMES[::-1]
    targets = Walker(library, joint_names=names).standing_targets
    assert np.array_equal(targets.position[::-1], Walker(library).stand)


def test_a_bad_measurement_is_replaced_in_the_robots_order(planned):
    names = [*JOINT_NAMES[::-1], "neck"]
    walker, backend = Walker(planned, joint_names=names), MockBackend(0.01)
    backend.connect(walker.stand)
    good = walker.step(backend.read()).position
    bad = replace(backend.read(), joint_position=np.full(13, np.nan))
    targets = walker.step(bad)
    assert "joint_position" in targets.status
    assert np.allclose(targets.position, good, atol=1e-6)


def test_a_held_joint_without_a_sensor_does_not_matter(planned):
    names = ["neck", *JOINT_NAMES]
    walker, backend = Walker(planned, joint_names=names), MockBackend(0.01)
    backend.connect(walker.stand)
    sensors = backend.read()
    sensors.joint_position[0] = np.nan
    assert walker.step(sensors).status == ""


@pytest.mark.parametrize(
    ("names", "signs", "message"),
    [
        (["left_kne", *JOINT_NAMES[1:]], {}, "'left_kne' is no joint.*near: left_knee"),
        ([*JOINT_NAMES, "neck", "neck"], {}, "neck twice; give each once"),
        (JOINT_NAMES[:-2], {}, "right_ankle_pitch, right_ankle_roll missing; all 12"),
        ([], {}, "missing; all 12"),
        (None, {"neck": -1}, "signs: 'neck' is not among the joints"),
        (JOINT_NAMES, {"left_knee": 0}, "signs: left_knee = 0; give 1 or -1"),
        (JOINT_NAMES, {"left_knee": 2}, "give 1 or -1"),
        (5, None, r"joint_names 5: give a list of names, such as \['left_knee'\]"),
        ("left_knee", None, "joint_names 'left_knee': give a list of names"),
        ([1, 2], None, "joint_names: 1 is no joint of the library's robot; near: left"),
        (None, "a", r"signs 'a': give a dict by name, such as \{'left_knee': -1\}"),
        (None, 5, "signs 5: give a dict"),
        (None, np.ones(12), r"signs array\(.*give a dict"),
        (None, {5: 1}, "signs: 5 is not among the joints"),
    ],
)
def test_names_and_signs_that_cannot_be(planned, names, signs, message):
    with pytest.raises(CommandError, match=message):
        JointMap(FULL, names, signs)
    with pytest.raises(CommandError, match=message):
        Walker(planned, joint_names=names, signs=signs)
