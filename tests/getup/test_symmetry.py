"""Mirrored joints: what one moves is the mirror image of what the other moves."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gaitchain.getup.symmetry import mirrored_pairs

MIRROR = np.array([1.0, -1.0, 1.0])
HEIGHT = 1.0
numbers = st.floats(-1.0, 1.0)


@st.composite
def robots(draw):
    """Joints of a left side, their mirror images, and the order they come in."""
    count = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    at = rng.uniform([-0.5, 0.05, 0.0], [0.5, 0.5, 1.0], (count, 3))
    at[:, 2] = np.linspace(0.0, 2.0, count)  # none near another one
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    signs = rng.choice([-1.0, 1.0], (count, 1))
    order = rng.permutation(2 * count)
    both = np.vstack([at, at * MIRROR]), np.vstack([axes, -signs * axes * MIRROR])
    return both[0][order], both[1][order], count


@given(robots(), st.floats(-2.0, 2.0), st.tuples(numbers, numbers, numbers))
def test_pairs_move_as_mirror_images(robot, angle, point):
    at, axes, count = robot
    pairs = mirrored_pairs(at, axes, HEIGHT)
    assert len(pairs) == count
    assert len({joint for pair in pairs for joint in pair[:2]}) == 2 * count
    for left, right, sign in pairs:
        assert at[left, 1] > 0.0 > at[right, 1]
        moved = Rotation.from_rotvec(angle * axes[left]).apply(point)
        seen = Rotation.from_rotvec(sign * angle * axes[right]).apply(
            np.array(point) * MIRROR
        )
        np.testing.assert_allclose(seen, moved * MIRROR, atol=1e-9)


def test_in_the_middle_only_what_pitches_is_its_own_image():
    at = np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.6], [0.0, 0.0, 0.7]])
    assert mirrored_pairs(at, np.eye(3), HEIGHT) == ((1, 1, 1.0),)


def test_a_joint_on_one_side_alone_is_left_out():
    at = np.array([[0.0, 0.1, 0.5], [0.0, -0.1, 0.8]])
    assert mirrored_pairs(at, np.eye(3)[[1, 1]], HEIGHT) == ()
