"""The anatomy of a robot: its shapes, its fingerprint, and taking it apart."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.errors import RobotFileError
from gaitchain.robot.box_robot import JOINT_NAMES, box_legs, load_box_robot
from gaitchain.robot.leg_model import legs_from

RES = load_box_robot("res")
BOX = replace(box_legs(RES.reduced), held={"neck": 0.1})
ARRAYS = sorted(BOX.arrays())
SOLES = 2 * (((0.1, 0.03), (-0.05, 0.0), (0.1, -0.03)),)


@pytest.mark.parametrize("name", ARRAYS)
def test_a_wrong_shape_is_refused(name):
    array = getattr(BOX, name)
    for wrong in (array[:-1], array[None], array[..., None], 1.0):
        with pytest.raises(RobotFileError, match=name):
            replace(BOX, **{name: wrong})


@pytest.mark.parametrize("name", ARRAYS)
def test_what_is_no_number_is_refused(name):
    array = np.array(getattr(BOX, name))
    array.flat[-1] = np.nan
    with pytest.raises(RobotFileError, match=f"{name} .* no number"):
        replace(BOX, **{name: array})


def test_a_joint_too_many_is_refused():
    with pytest.raises(RobotFileError, match="shape"):
        replace(BOX, joint_names=(*JOINT_NAMES, "left_toe", "right_toe"))


@pytest.mark.parametrize(
    ("name", "number", "told"),
    [
        ("upper", np.inf, r"range is -1.4 to inf rad, must be finite"),
        ("upper", -2.0, r"range is -1.4 to -2 rad, must rise"),
        ("joint_damping", 1e6, r"own damping is 1e\+06 N m s/rad, must be .* at most"),
    ],
)
def test_the_joint_is_named_whose_numbers_cannot_be(name, number, told):
    numbers = np.array(getattr(BOX, name))
    numbers[4] = number
    with pytest.raises(RobotFileError, match=f"^leg joint {JOINT_NAMES[4]}: {told}"):
        replace(BOX, lower=np.full(12, -1.4), **{name: numbers})


@pytest.mark.parametrize("soles", [SOLES[:1], (SOLES[0], SOLES[0][:2])])
def test_soles_that_are_none_are_refused(soles):
    with pytest.raises(RobotFileError, match="corners of soles"):
        replace(BOX, soles=soles)


@pytest.mark.parametrize("name", ARRAYS)
def test_the_fingerprint_changes_with_any_number(name):
    array = getattr(BOX, name)
    for i in range(array.size):
        other = np.array(array)
        other.flat[i] += 2e-9
        assert replace(BOX, **{name: other}).fingerprint != BOX.fingerprint


def test_the_fingerprint_changes_with_any_fact():
    others = {
        "joint_names": ("other", *JOINT_NAMES[1:]),
        "knee": 2,
        "trunk_mass": BOX.trunk_mass + 1e-8,
        "held": {"neck": 0.2},
        "soles": SOLES,
    }
    assert set(others) == {f.name for f in fields(BOX)} - set(ARRAYS)
    prints = {replace(BOX, **{k: v}).fingerprint for k, v in others.items()}
    assert len(prints | {BOX.fingerprint}) == len(others) + 1


def test_last_digits_of_another_processor_do_not_change_the_fingerprint():
    """Angles of a stand that is searched differ in them, and cosines."""
    arrays = {n: getattr(BOX, n) for n in ARRAYS}
    near = {n: np.nextafter(np.nextafter(a, 1e3), 1e3) for n, a in arrays.items()}
    again = replace(BOX, trunk_mass=np.nextafter(BOX.trunk_mass, 1e3), **near)
    assert any((near[n] != arrays[n]).any() for n in ARRAYS)
    assert again.fingerprint == BOX.fingerprint


@pytest.mark.parametrize("rounded", [-0.0, -1e-17, 1e-17])
def test_the_sign_of_a_rounding_error_does_not_change_the_fingerprint(rounded):
    """A sole under its ankle, or an arm that hangs, is at 0 or at either side of it."""
    none, own = ({"neck": angle} for angle in (0.0, rounded))
    assert replace(BOX, held=own).fingerprint == replace(BOX, held=none).fingerprint
    one, other = (with_legs(RES, BOX, sole_offset=x) for x in (0.0, rounded))
    assert other.fingerprint == one.fingerprint


def test_the_same_numbers_have_the_same_fingerprint():
    again = replace(BOX, at=np.asfortranarray(BOX.at), stand=BOX.stand.tolist())
    assert again.fingerprint == BOX.fingerprint
    two = {"a": 0.1, "b": 0.2}
    other = dict(reversed(two.items()))
    assert replace(BOX, held=two).fingerprint == replace(BOX, held=other).fingerprint


def test_a_robots_fingerprint_holds_its_legs():
    whole = with_legs(RES, BOX)
    heavier = replace(BOX, trunk_mass=BOX.trunk_mass + 1e-6)
    prints = [b.fingerprint for b in (RES, whole, with_legs(RES, heavier))]
    assert len(set(prints)) == 3


@pytest.mark.parametrize("soles", [(), SOLES])
def test_what_was_taken_apart_goes_together_again(soles):
    whole = replace(BOX, soles=soles)
    again = legs_from(json.loads(json.dumps(whole.facts())), BOX.arrays())
    assert again == whole
    assert again.soles == soles
    assert again.joint_names == BOX.joint_names
    assert again.held == BOX.held
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(BOX, name))


def test_arrays_are_frozen_copies():
    mine = np.array(BOX.at)
    frozen = replace(BOX, at=mine)
    mine[0, 0, 0] = 9.0
    assert frozen.at[0, 0, 0] == BOX.at[0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        frozen.at[0, 0, 0] = 9.0


def test_a_motor_may_have_no_speed_limit():
    assert replace(BOX, speed_limit=np.full(12, np.inf)).leg_joints == 6


def test_the_boxes_weigh_what_the_numbers_say():
    assert BOX.mass == pytest.approx(RES.reduced.mass)
    assert BOX.joint_names[BOX.knee] == "left_knee"


def test_robots_with_other_servos_are_not_equal():
    """Equality sees the legs, too."""
    res = load_box_robot("res")
    same = box_legs(res.reduced)
    stiffer = replace(same, stiffness=1.1 * same.stiffness)
    assert with_legs(res, same) == with_legs(res, res.legs)
    assert hash(same) == hash(res.legs)
    assert with_legs(res, stiffer) != with_legs(res, same)
    assert with_legs(res, same) != res
