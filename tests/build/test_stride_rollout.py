"""The effort of a walk of strides, measured against each joint's own limit."""

from dataclasses import replace

import numpy as np
import pytest
from other_robots import with_legs
from planned_library import planned_library

from gaitchain.build.stride_rollout import find_fall, walk_strides
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.sim.push import Push
from gaitchain.sim.world import World

RES = load_box_robot("res")
LIMITS = box_legs(RES.reduced).torque_limit
WALK = np.array([[0, 0, 0, 2], [2, 0, 0, 0]])


@pytest.fixture(scope="module")
def effort():
    """Measure the effort of two steps by the joints' torque limits."""
    library = planned_library(RES)

    def measure(limits):
        own = replace(box_legs(RES.reduced), torque_limit=limits)
        most = float(np.max(limits))
        robot = with_legs(RES, own, joint_torque_limit=most)
        poses = replace(library.poses, robot=robot)
        found = walk_strides(poses, library.timing, WALK, World())
        assert found.fell_in is None
        return found.terms[:, 2], found.advance

    return measure


def test_a_weak_joint_bears_its_own_part_of_the_effort(effort):
    """Effort is the mean of (tau / (limit / 2))^2: twice the limit, a fourth of it.

    So what two groups of joints add at their own limits, the others at twice theirs,
    makes up the whole.
    """
    all_weak, advance = effort(LIMITS)
    all_strong, _ = effort(2.0 * LIMITS)
    assert all_strong == pytest.approx(0.25 * all_weak, rel=1e-9)
    left = np.arange(12) < 6
    added = []
    for weak in (left, ~left):
        found, moved = effort(np.where(weak, 1.0, 2.0) * LIMITS)
        assert moved == pytest.approx(advance, abs=1e-9)  # no servo saturates
        added.append(found - all_strong)
    assert np.all(np.array(added) > 0.0)
    assert sum(added) == pytest.approx(0.75 * all_weak, rel=1e-6)


@pytest.mark.parametrize("impulse_ns", [0.0, 40.0])
def test_a_fall_is_found_without_measuring_steps(impulse_ns):
    library = planned_library(RES)
    world = World(push=(Push(impulse_ns, 90.0, 1.0),))
    walked = library.poses, library.timing, WALK, world
    fell_in = find_fall(*walked)
    assert fell_in == walk_strides(*walked).fell_in
    assert (fell_in is None) == (impulse_ns == 0.0)
