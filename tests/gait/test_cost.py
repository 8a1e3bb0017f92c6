"""The planned cost, against a slow one written out for one gait."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.gait.keypose.cost import PlannedCost, saturate, zmp_scale
from gaitchain.gait.keypose.impact import velocity_jump
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.presets import PRESETS, draw_candidates
from gaitchain.gait.motion import State, Timing
from gaitchain.gait.zmp import zmp
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
BIPED = RES.reduced
TIMING = Timing()
PRESET = pytest.mark.parametrize("preset", PRESETS)


def cost_of(preset, **options):
    poses = draw_candidates(RES, preset, np.random.default_rng(6), TIMING)
    return PlannedCost(poses, TIMING, **options)


def moving(poses):
    """The same poses with a velocity at every key moment."""
    rng = np.random.default_rng(10)
    rates = tuple(rng.uniform(-0.1, 0.1, p.shape) for p in poses.parameters)
    return KeyPoses(poses.robot, poses.parameters, rates, poses.closed)


def random_gaits(cost, number):
    rng = np.random.default_rng(9)
    return np.stack([rng.integers(n, size=number) for n in cost.poses.counts], axis=-1)


def other_foot(value):
    """The same motion seen from the other foot: legs swapped, sways reversed."""
    q1, q2, q3, q4, q5, q6, q7 = value
    return np.array([q5, q4, q3, q2, q1, -q7, -q6])


def slow_displacement(poses, gait):
    """Eq. 3 key moment by key moment, in an endless row of the same step."""
    q = np.array([poses.q[i][n] for i, n in enumerate(gait)])
    dq = np.array([poses.dq[i][n] for i, n in enumerate(gait)])
    bending = scipy.interpolate.CubicHermiteSpline(
        (0.0, 0.6, 2.4, 3.0), q, dq
    ).derivative(2)
    tiny = 1e-9
    after = [bending(t + tiny) for t in (0.0, 0.6, 2.4)]
    before = [bending(t - tiny) for t in (0.6, 2.4, 3.0)]
    after, before = [*after, other_foot(after[0])], [other_foot(before[-1]), *before]
    rear, ahead = poses.foot_x[0][gait[0]], poses.foot_x[3][gait[3]]
    desired = [
        [0.5 * rear + BIPED.sole_offset, -0.5 * BIPED.hip_width],
        [BIPED.sole_offset, 0.0],
        [BIPED.sole_offset, 0.0],
        [0.5 * ahead + BIPED.sole_offset, -0.5 * BIPED.hip_width],
    ]
    total = 0.0
    for k in range(4):
        found = zmp(RES, State(q[k], dq[k], 0.5 * (after[k] + before[k])))
        total += (found[0] - desired[k][0]) ** 2 + (found[1] - desired[k][1]) ** 2
    return total


def slow_jump(poses, gait):
    """Velocity jump halfway through the double support."""
    q = [poses.q[i][gait[i]] for i in (2, 3)]
    dq = [poses.dq[i][gait[i]] for i in (2, 3)]
    spline = scipy.interpolate.CubicHermiteSpline((2.4, 3.0), q, dq)
    velocity = spline.derivative()(2.7)
    jump = velocity_jump(RES, State(spline(2.7), velocity, np.zeros(7)))
    return np.sqrt(np.sum(jump**2))


@PRESET
@pytest.mark.parametrize("weight", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("prepare", [lambda poses: poses, moving])
def test_cost_is_the_slow_one(preset, weight, prepare):
    poses = prepare(cost_of(preset).poses)
    cost = PlannedCost(poses, TIMING, impact_weight=weight, impact_scale=0.8)
    gaits = random_gaits(cost, 12)
    half_soles = 4.0 * 0.11**2
    expected = []
    for gait in gaits:
        total = slow_displacement(cost.poses, gait) / half_soles
        total += weight * (slow_jump(cost.poses, gait) / 0.8) ** 2
        expected.append(1.0 - np.exp(-total))
    np.testing.assert_allclose(cost(gaits), expected, rtol=1e-6, atol=1e-9)
    assert np.ptp(expected) > 1e-3


@PRESET
def test_costs_lie_in_the_unit_interval_and_differ(preset):
    cost = cost_of(preset)
    found = cost(random_gaits(cost, 700))
    assert found.shape == (700,)
    assert found.min() >= 0.0
    assert found.max() < 1.0
    assert found.std() > 0.01


def test_batches_equal_one_by_one():
    cost = cost_of("default")
    gaits = random_gaits(cost, 1100)
    together = cost(gaits)
    for i in (0, 1, 499, 500, 501, 999, 1000, 1099):
        one = cost(gaits[i])
        assert one.shape == ()
        assert one == pytest.approx(together[i], abs=1e-12)
    folded = cost(gaits.reshape(10, 11, 10, 4))
    assert folded.shape == (10, 11, 10)
    np.testing.assert_allclose(folded.ravel(), together, atol=1e-12)
    assert cost(gaits[:0]).shape == (0,)


def test_impact_weight_raises_the_cost():
    gaits = random_gaits(cost_of("default"), 50)
    costs = [cost_of("default", impact_weight=w)(gaits) for w in (0.0, 0.1, 0.5)]
    assert np.all(costs[0] < costs[1])
    assert np.all(costs[1] < costs[2])


def test_impact_is_the_jump_of_each_pair():
    cost = PlannedCost(moving(cost_of("default").poses), TIMING)
    assert cost.impact.shape == cost.poses.counts[2:]
    for third, last in ((0, 0), (3, 9), (19, 4)):
        expected = slow_jump(cost.poses, (0, 0, third, last))
        assert cost.impact[third, last] == pytest.approx(expected, rel=1e-9)


@PRESET
def test_key_states_hold_the_poses_and_repeat_over_steps(preset):
    cost = cost_of(preset)
    gaits = random_gaits(cost, 20)
    state = cost.key_states(gaits)
    for layer in range(4):
        chosen = gaits[:, layer]
        np.testing.assert_array_equal(state.q[:, layer], cost.poses.q[layer][chosen])
        np.testing.assert_array_equal(state.dq[:, layer], cost.poses.dq[layer][chosen])
    for start, end in zip(state.ddq[:, 0], state.ddq[:, 3], strict=True):
        np.testing.assert_allclose(other_foot(end), start, atol=1e-12)


POSITIVE = st.floats(1e-6, 1e3)


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6), POSITIVE)
def test_saturate_is_monotone_and_bounded(first, second, scale):
    low, high = sorted((first, second))
    below, above = saturate(low, scale), saturate(high, scale)
    assert 0.0 <= below <= above <= 1.0


@given(st.floats(0.0, 20.0), POSITIVE)
def test_saturate_is_the_documented_map(times, scale):
    found = saturate(times * scale, scale)
    assert found < 1.0
    assert found == pytest.approx(1.0 - np.exp(-times), abs=1e-12)


def test_saturate_at_its_landmarks():
    assert saturate(0.0, 2.0) == 0.0
    assert saturate(2.0, 2.0) == pytest.approx(0.632, abs=1e-3)
    assert saturate(1e-18, 1.0) == pytest.approx(1e-18), "no cancellation near zero"
    assert saturate(np.ones((2, 3)), 1.0).shape == (2, 3)


def test_scale_is_half_a_sole_at_every_key_moment():
    assert zmp_scale(RES) == pytest.approx(4.0 * 0.11**2)
