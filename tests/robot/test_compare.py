"""Two robots: what differs, and what of it matters to a library."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from toy_file import toy

from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import LibraryError
from gaitchain.gait.library_file import check_robot
from gaitchain.robot.compare import differences, differences_that_matter
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import DISTURBANCES


@pytest.fixture(scope="module")
def robot(toy_path):
    return load_robot(toy_path)


def changed(robot, **arrays):
    return replace(robot, legs=replace(robot.legs, **arrays))


def scaled(robot, name, part):
    return changed(robot, **{name: part * getattr(robot.legs, name)})


@pytest.mark.parametrize(
    ("name", "little", "much"),
    [
        *(("stiffness", 1.09, 1.11), ("damping", 0.91, 0.89)),
        *(("link_mass", 1.04, 1.06), ("inertia", 0.96, 0.94)),
        *(("trunk_mass", 1.04, 0.94), ("torque_limit", 1.5, 0.99)),
        *(("speed_limit", 2.0, 0.99), ("at", 1.0001, 1.01)),
    ],
)
def test_what_differs_as_in_training_does_not_matter(robot, name, little, much):
    near, far = scaled(robot, name, little), scaled(robot, name, much)
    assert differences(robot, near)
    assert not differences_that_matter(robot, near)
    assert differences_that_matter(robot, far)


@pytest.mark.parametrize(("shift_legs", "matters"), [(0.004, False), (0.006, True)])
def test_a_com_may_be_elsewhere_by_part_of_the_leg(robot, shift_legs, matters):
    com = robot.legs.com + shift_legs * robot.reduced.leg_length * np.eye(3)[2]
    assert bool(differences_that_matter(robot, changed(robot, com=com))) == matters


def test_ranges_may_be_wider_and_not_narrower(robot):
    lower, upper = robot.legs.lower, robot.legs.upper
    wider = changed(robot, lower=lower - 0.1, upper=upper + 0.1)
    assert not differences_that_matter(robot, wider)
    (told,) = differences_that_matter(wider, robot)[:1]
    assert told.startswith("lower end of left_yaw")


def test_what_matters_is_told_alone(robot):
    """A mass that is little off is not among what a library is refused for."""
    other = scaled(scaled(robot, "link_mass", 1.01), "stiffness", 1.5)
    (told,) = differences_that_matter(robot, other)
    assert told == "kp of left_yaw [N m/rad] 300 / 450 and 11 more such"


def test_limits_of_what_matters_are_levels_that_training_draws():
    """The gate's worlds have them, and no less."""
    drawn = {n: DISTURBANCES[n].strides for n in ("model_error", "gain_error")}
    assert min(drawn["model_error"].required) >= 0.05
    assert min(drawn["gain_error"].required) >= 0.1


def test_soles_joints_and_names_matter_as_they_are(robot):
    reduced = replace(robot.reduced, sole_width=1.01 * robot.reduced.sole_width)
    (told,) = differences_that_matter(robot, replace(robot, reduced=reduced))
    assert told.startswith("sole_width ")
    names = tuple(name.upper() for name in robot.legs.joint_names)
    assert differences_that_matter(robot, changed(robot, joint_names=names))


@pytest.mark.parametrize(("legs", "matters"), [(0.0009, False), (0.0011, True)])
def test_soles_may_be_thicker_by_as_little_as_joints_may_be_elsewhere(
    robot, legs, matters
):
    thicker = robot.reduced.ankle_height + legs * robot.reduced.leg_length
    other = replace(robot, reduced=replace(robot.reduced, ankle_height=thicker))
    told = differences_that_matter(robot, other)
    assert [text.split()[0] for text in told] == ["ankle_height"] * matters


def test_thicker_soles_in_a_file_matter(toy_library, tmp_path):
    """Soles of the same mass and CoM, so that nothing else of the legs differs."""
    sole = '<geom type="box" size="0.09 0.05 0.01" pos="0.02 0 {}" mass="0.3"/>'
    mass = '<inertial mass="0.3" pos="0.02 0 -0.04" diaginertia="3e-4 8e-4 1e-3"/>'
    file, thin = tmp_path / "soles.xml", sole.format("-0.04")
    pair = []
    for made in (thin, sole.format("-0.05")):
        file.write_text(toy().replace(thin, mass + made), "utf-8")
        pair.append(load_robot(file))
    own = replace(toy_library, poses=replace(toy_library.poses, robot=pair[0]))
    with pytest.raises(LibraryError, match=r"differs in ankle_height 0\.05 / 0\.06"):
        check_robot(own, pair[1])


def test_a_library_of_a_robot_that_differs_a_little_is_told(toy_library, caplog):
    robot: Robot = toy_library.robot
    with caplog.at_level(logging.WARNING):
        check_robot(toy_library, robot)
        assert not caplog.text
        check_robot(toy_library, scaled(robot, "stiffness", 1.05))
    assert "a toy that differs a little, in kp of left_yaw" in caplog.text
    with pytest.raises(LibraryError, match="differs in kp of left_yaw"):
        check_robot(toy_library, scaled(robot, "stiffness", 1.5))


def test_a_file_with_other_masses_is_the_same_robot(robot, tmp_path):
    """As where somebody weighed it: what follows from the links does not matter."""
    file = tmp_path / "weighed.xml"
    file.write_text(toy().replace('mass="0.8"', 'mass="0.82"'), "utf-8")
    weighed = load_robot(file)
    assert differences(robot, weighed)
    assert not differences_that_matter(robot, weighed)
