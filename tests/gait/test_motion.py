"""Motion between key poses: Hermite segments, and why they are not a natural spline."""

import numpy as np
import pytest
import scipy

from gaitchain.errors import CommandError
from gaitchain.gait.keypose.presets import PRESETS, draw_candidates
from gaitchain.gait.motion import (
    SplineSegment,
    State,
    StepMotion,
    Timing,
    end_accelerations,
)
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
TIMING = Timing()
KEYS = np.array(TIMING.key_times)
BOTH_PRESETS = pytest.mark.parametrize("preset", PRESETS)


def random_keys(batch=()):
    rng = np.random.default_rng(7)
    return rng.uniform(-1, 1, (*batch, 4, 7)), rng.uniform(-2, 2, (*batch, 4, 7))


def gaits_of(preset, number=40):
    """Key poses and velocities of random gaits, each (number, 4, 7)."""
    rng = np.random.default_rng(8)
    poses = draw_candidates(RES, preset, rng)
    chosen = [rng.integers(n, size=number) for n in poses.counts]
    q = np.stack([p[c] for p, c in zip(poses.q, chosen, strict=True)], axis=1)
    dq = np.stack([p[c] for p, c in zip(poses.dq, chosen, strict=True)], axis=1)
    return q, dq


def test_the_papers_timing():
    assert (TIMING.step, TIMING.rise, TIMING.fall) == (3.0, 0.6, 1.8)
    assert TIMING.double_support == pytest.approx(0.6)
    assert TIMING.double_support / TIMING.step == pytest.approx(0.2)
    assert TIMING.key_times == pytest.approx((0.0, 0.6, 2.4, 3.0))
    assert TIMING.segments == pytest.approx((0.6, 1.8, 0.6))


@pytest.mark.parametrize(
    "times",
    [
        (3.0, 0.0, 1.8),
        (3.0, 0.6, -1.0),
        (2.4, 0.6, 1.8),
        (1.0, 0.6, 1.8),
        (-3.0, 0.6, 1.8),
        (3.0, np.nan, 1.8),
        (np.nan, 0.6, 1.8),
    ],
)
def test_impossible_timing_is_refused(times):
    with pytest.raises(CommandError, match="T_a \\+ T_b less than T"):
        Timing(*times)


def test_step_passes_its_key_poses_with_their_velocities():
    q, dq = random_keys()
    state = StepMotion(KEYS, q, dq).at(KEYS)
    np.testing.assert_allclose(state.q, q, atol=1e-12)
    np.testing.assert_allclose(state.dq, dq, atol=1e-12)


def test_derivatives_match_finite_differences():
    motion = StepMotion(KEYS, *random_keys())
    time, h = np.array([0.2, 0.5, 1.1, 2.0, 2.7]), 1e-4
    before, middle, after = (motion.at(time + s) for s in (-h, 0.0, h))
    np.testing.assert_allclose(middle.dq, (after.q - before.q) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(middle.ddq, (after.dq - before.dq) / (2 * h), atol=1e-6)


def test_batch_of_steps():
    q, dq = random_keys((2, 3))
    time = np.linspace(0.0, 3.0, 5)
    state = StepMotion(KEYS, q, dq).at(time)
    assert state.q.shape == state.dq.shape == state.ddq.shape == (2, 3, 5, 7)
    one = StepMotion(KEYS, q[1, 2], dq[1, 2]).at(time)
    np.testing.assert_allclose(state.ddq[1, 2], one.ddq, atol=1e-12)


def test_a_step_is_scipys_spline():
    """Also beyond its ends; libraries built with SciPy's are built again with ours."""
    q, dq = random_keys((3,))
    time = np.sort(np.append(np.linspace(-0.1, 3.1, 65), KEYS))
    spline = scipy.interpolate.CubicHermiteSpline(KEYS, q, dq, axis=-2)
    for order, found in enumerate(StepMotion(KEYS, q, dq).at(time)):
        expected = spline.derivative(order)(time)
        np.testing.assert_array_max_ulp(found, expected, 0)


@BOTH_PRESETS
def test_frontal_joints_rest_at_key_moments(preset):
    state = StepMotion(KEYS, *gaits_of(preset)).at(KEYS)
    np.testing.assert_allclose(state.dq[..., 5:], 0.0, atol=1e-12)


def test_segment_is_the_step_between_two_key_poses():
    q, dq = random_keys()
    motion = StepMotion(KEYS, q, dq)
    unused = np.full(7, np.nan)  # a segment depends on q and dq alone
    for i, duration in enumerate(TIMING.segments):
        ends = (State(q[k], dq[k], unused) for k in (i, i + 1))
        segment = SplineSegment(duration, *ends)
        for time in np.linspace(0.0, duration, 7):
            expected = motion.at(np.array([KEYS[i] + time])).q[0]
            np.testing.assert_allclose(segment.q(time), expected, atol=1e-12)
        np.testing.assert_allclose(segment.q(-1.0), q[i], atol=1e-12)
        np.testing.assert_allclose(segment.q(duration + 9.0), q[i + 1], atol=1e-12)


def test_a_segment_depends_on_its_two_ends_only():
    q, dq = random_keys()
    other_q, other_dq = q.copy(), dq.copy()
    other_q[[0, 3]], other_dq[[0, 3]] = 0.3, -0.1
    within = np.linspace(0.6, 2.4, 9)
    first, second = StepMotion(KEYS, q, dq), StepMotion(KEYS, other_q, other_dq)
    np.testing.assert_allclose(first.at(within).q, second.at(within).q, atol=1e-12)


def test_end_accelerations_are_the_splines():
    q, dq = random_keys((3,))
    motion = StepMotion(KEYS, q, dq)
    found = end_accelerations(np.array(TIMING.segments), q, dq)
    assert found.shape == (3, 3, 2, 7)
    for i, duration in enumerate(TIMING.segments):
        # Linear in time within a segment, so two inner values give both ends.
        inner = motion.at(KEYS[i] + duration * np.array([1.0, 2.0]) / 3.0).ddq
        start = 2.0 * inner[:, 0] - inner[:, 1]
        end = 2.0 * inner[:, 1] - inner[:, 0]
        np.testing.assert_allclose(found[:, i], np.stack([start, end], 1), atol=1e-9)


def overshoot(sway, keys):
    """How far a motion leaves the values at both ends of each of its segments."""
    low = np.minimum(keys[:, :-1], keys[:, 1:])[:, :, None]
    high = np.maximum(keys[:, :-1], keys[:, 1:])[:, :, None]
    return np.maximum(low - sway, sway - high).max()


@BOTH_PRESETS
def test_sway_does_not_overshoot_but_a_natural_spline_does(preset):
    q, dq = gaits_of(preset)
    keys = q[..., 5]
    inner = np.linspace(0.0, 1.0, 21)
    times = KEYS[:-1, None] + np.array(TIMING.segments)[:, None] * inner
    motion = StepMotion(KEYS, q, dq)
    ours = np.stack([motion.at(t).q[..., 5] for t in times], axis=1)
    assert overshoot(ours, keys) < 1e-12
    spline = scipy.interpolate.CubicSpline(KEYS, keys, axis=1, bc_type="natural")
    natural = np.stack([spline(t) for t in times], axis=1)
    assert overshoot(natural, keys) > np.radians(1.0)
