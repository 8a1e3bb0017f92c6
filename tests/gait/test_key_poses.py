"""Candidate poses: Table I recovered from the poses, and the closed default."""

import re

import numpy as np
import pytest
from other_robots import resized

from gaitchain.errors import CommandError, UnreachableError
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose import presets
from gaitchain.gait.keypose.presets import PRESETS, draw_candidates, geometric_sway
from gaitchain.gait.keypose.primitives import PARAMETERS, compose, compose_rates
from gaitchain.gait.motion import Timing
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import com, exchange_roles, points

RES = load_box_robot("res")
BIPED = RES.reduced
LEG = BIPED.leg_length
# Table I: x6, theta [deg], z6 as the printed values, q4 and q5 [deg] as ranges.
TABLE_1 = (
    {"x6": (-0.15,), "theta": (3, 8), "z6": (0.0,), "q4": (10, 15), "q5": (15, 20)},
    {"x6": (0.02, 0.04), "theta": (12,), "z6": (0.04, 0.08)},
    {
        "x6": (0.12, 0.14),
        "theta": (3, 8),
        "z6": (0.01, 0.02),
        "q4": (-20, -15),
        "q5": (-15, -10),
    },
    {"x6": (0.15,), "theta": (-1, 1), "z6": (0.0,), "q4": (-25, -20), "q5": (-20, -15)},
)
SEEDS = pytest.mark.parametrize("seed", [0, 1, 2])


def draw(preset, seed=0, **options):
    return draw_candidates(RES, preset, np.random.default_rng(seed), **options)


def is_one_of(values, allowed):
    return np.isclose(values[:, None], allowed, atol=1e-9).any(axis=1).all()


@SEEDS
def test_table1_has_the_papers_counts_and_ranges(seed):
    poses = draw("table1", seed)
    assert poses.counts == (5, 10, 10, 5)
    assert not poses.closed
    for q, printed in zip(poses.q, TABLE_1, strict=True):
        ankle = points(BIPED, q)[:, 6]
        assert is_one_of(ankle[:, 0], printed["x6"])
        assert is_one_of(ankle[:, 2] - BIPED.ankle_height, printed["z6"])
        assert is_one_of(np.degrees(q[:, 5]), printed["theta"])
        np.testing.assert_array_equal(q[:, 5], q[:, 6])
        for joint, key in ((3, "q4"), (4, "q5")):
            low, high = printed.get(key, (-80, 80))
            assert np.all(np.degrees(q[:, joint]) >= low - 1e-9)
            assert np.all(np.degrees(q[:, joint]) <= high + 1e-9)


def test_table1_uses_all_that_it_prints():
    poses = draw("table1", counts=(40, 40, 40, 40))
    for q, printed in zip(poses.q, TABLE_1, strict=True):
        ankle = points(BIPED, q)[:, 6] - [0.0, 0.0, BIPED.ankle_height]
        for found, key in ((ankle[:, 0], "x6"), (ankle[:, 2], "z6")):
            assert set(np.round(found, 9) + 0.0) == set(printed[key])
        assert set(np.round(np.degrees(q[:, 5]), 9)) == set(printed["theta"])
        for joint, key in ((3, "q4"), (4, "q5")):
            if key in printed:
                assert np.ptp(np.degrees(q[:, joint])) > 3.0
    assert all(np.all(dq == 0.0) for dq in poses.dq)


@SEEDS
def test_default_is_closed_and_holds_the_standing_pose(seed):
    poses = draw("default", seed)
    assert poses.counts == PRESETS["default"].counts == (13, 30, 26, 13)
    assert poses.closed
    np.testing.assert_allclose(exchange_roles(poses.q[3]), poses.q[0], atol=1e-12)
    np.testing.assert_allclose(exchange_roles(poses.dq[3]), poses.dq[0], atol=1e-12)
    # The hips move on as the feet change roles.
    np.testing.assert_array_equal(poses.rates[3], poses.rates[0])
    hip_x = PARAMETERS.index("hip_x")
    assert np.all(poses.rates[0][1:, hip_x] > 0.0)
    np.testing.assert_array_equal(np.delete(poses.rates[0], hip_x, axis=1), 0.0)
    for layer in range(4):  # at rest from side to side
        np.testing.assert_array_equal(poses.dq[layer][:, 5:], 0.0)
    for layer in (0, 3):
        np.testing.assert_array_equal(poses.dq[layer][STAND], 0.0)
        stand = poses.q[layer][STAND]
        where = points(BIPED, stand)
        expected = [0.0, -BIPED.hip_width, BIPED.ankle_height]
        np.testing.assert_allclose(where[6], expected, atol=1e-12)
        np.testing.assert_allclose(stand[[2, 5, 6]], 0.0, atol=1e-15)
        np.testing.assert_allclose(where[2, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("counts", [None, (3, 4, 4, 3), (7, 10, 10, 7)])
def test_default_step_lengths_grow_evenly_and_cover_the_papers_commands(counts):
    """Stand, then equal ratios: every speed is met to the same part of itself."""
    poses = draw("default", counts=counts)
    lengths = poses.step_lengths
    np.testing.assert_allclose(points(BIPED, poses.q[3])[:, 6, 0], lengths, atol=1e-12)
    np.testing.assert_allclose(poses.foot_x[0], -lengths, atol=1e-12)
    assert lengths[STAND] == pytest.approx(0.0, abs=1e-12)
    assert lengths[1] > 0.0
    np.testing.assert_allclose(np.diff(np.log(lengths[1:]), n=2), 0.0, atol=1e-9)
    assert np.all(np.diff(lengths) > 0.0)
    period = Timing().step
    assert lengths[1] <= 0.02 * period
    assert lengths[-1] >= 0.08 * period


@SEEDS
@pytest.mark.parametrize("counts", [(4, 6, 9, 4), PRESETS["default"].counts])
def test_each_kp_3_of_the_default_belongs_to_a_step_length(counts, seed):
    """The foot is nearly where it lands, and comes down."""
    poses = draw("default", seed, counts=counts)
    assert poses.counts == counts
    own = poses.step_lengths[np.arange(counts[2]) % counts[3]]
    assert np.all(poses.foot_x[2] >= 0.9 * own)
    assert np.all(poses.foot_x[2] <= own + 1e-12)
    foot_z = PARAMETERS.index("foot_z")
    assert np.all(poses.rates[2][:, foot_z] < 0.0)
    assert np.all(poses.rates[2][:, PARAMETERS.index("foot_x")] == 0.0)


@SEEDS
@pytest.mark.parametrize("counts", [(4, 6, 9, 4), PRESETS["default"].counts])
def test_each_kp_2_of_the_default_belongs_to_a_pair_of_step_lengths(counts, seed):
    poses, foot_x = draw("default", seed, counts=counts), PARAMETERS.index("foot_x")
    lengths, place, speed = poses.step_lengths, poses.foot_x[1], poses.rates[1]
    longest = lengths[-1]
    assert np.all(np.abs(place) < longest)
    assert np.all(speed[:, foot_x] > 0.0)
    # The first half passes the support foot between two steps of the same length.
    own = lengths[1 : counts[1] // 2 + 1]
    assert len(own) == min(counts[1] // 2, counts[0] - 1)
    assert np.all(np.abs(place[: len(own)]) < own)
    # A foot that is at rest at both ends of 2 own is faster than its mean in between.
    pace = speed[: len(own), foot_x] * Timing().step / (2.0 * own)
    assert np.all((pace > 1.0) & (pace < 4.0))


@pytest.mark.parametrize("count", [2, 3, 9, 30, 200])
def test_kp_2_is_made_for_steady_pairs_and_for_pairs_spread_over_all(count):
    lengths = np.array([0.0, 0.05, 0.1, 0.2, 0.4])
    rng = np.random.default_rng(count)
    pairs = presets._step_pairs(lengths, count, rng)
    assert pairs.shape == (count, 2)
    steady = min(count // 2, 4)
    expected = np.repeat(lengths[1 : steady + 1, None], 2, axis=1)
    np.testing.assert_array_equal(pairs[:steady], expected)
    others = pairs[steady:] / lengths[-1]
    assert np.all((others >= 0.0) & (others < 1.0))
    cells = np.histogram2d(*others.T, bins=3, range=[[0, 1], [0, 1]])[0]
    if count >= 30:  # no ninth of the square is left out
        assert np.all(cells > 0)
    if count >= 200:  # and each has its share
        assert np.all(np.abs(cells / cells.mean() - 1.0) <= 0.25)


@SEEDS
def test_the_key_moments_of_the_default_follow_each_other(seed):
    """The swing foot from behind to ahead, up and down; the hip over the foot."""
    poses = draw("default", seed)
    lengths, first, last = poses.step_lengths, poses.parameters[0], poses.parameters[3]
    hip_x, foot_z, sway = (PARAMETERS.index(n) for n in ("hip_x", "foot_z", "sway"))
    np.testing.assert_allclose(last[:, hip_x], lengths + first[:, hip_x], atol=1e-12)
    assert np.all(first[1:, hip_x] < 0.0)
    assert np.all(last[1:, hip_x] > 0.0)
    lift = [p[:, foot_z] for p in poses.parameters]
    assert lift[1].min() > lift[2].max() > lift[2].min() > 0.0
    np.testing.assert_allclose(lift[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(lift[3], 0.0, atol=1e-12)
    # To the support foot's side, at most over it; to the other one at the end.
    most = geometric_sway(RES, poses.parameters[0][0][PARAMETERS.index("hip_height")])
    tilts = [p[:, sway] for p in poses.parameters]
    assert 0.0 < tilts[0][1:].min() <= tilts[0].max() < tilts[1].min()
    assert 0.0 < tilts[2].min() <= tilts[2].max() < tilts[1].max() < most
    np.testing.assert_allclose(tilts[3], -tilts[0], atol=1e-12)
    heights = np.concatenate([p[:, 1] for p in poses.parameters])
    np.testing.assert_allclose(heights, heights[0], atol=1e-12)


@SEEDS
@pytest.mark.parametrize("preset", PRESETS)
def test_poses_are_composed_and_keep_the_robots_limits(preset, seed):
    poses = draw(preset, seed)
    for parameters, rates, q, dq in zip(
        poses.parameters, poses.rates, poses.q, poses.dq, strict=True
    ):
        np.testing.assert_array_equal(q, compose(RES, parameters))
        np.testing.assert_array_equal(dq, compose_rates(RES, parameters, rates))
        np.testing.assert_array_equal(dq[:, 5:], 0.0)
        angles = np.abs(joint_angles(q, left_support=True))
        assert angles.max() < BIPED.joint_angle_limit
        assert np.abs(dq).max() < BIPED.joint_speed_limit
        assert points(BIPED, q)[:, 6, 2].min() > BIPED.ankle_height - 1e-12


LENGTHS = [
    name for name in BIPED.numbers() if name.endswith(("_length", "_width", "_height"))
] + ["sole_offset", "leg_thickness", "trunk_depth"]


@pytest.mark.parametrize("scale", [0.5, 1.7])
def test_default_scales_with_the_robot(scale):
    lengths = {name: scale * BIPED.numbers()[name] for name in LENGTHS}
    other = draw_candidates(
        resized(RES, **lengths), "default", np.random.default_rng(3)
    )
    own = draw("default", seed=3)
    factor = np.array([1.0 if name == "sway" else scale for name in PARAMETERS])
    for layer in range(4):
        expected = own.parameters[layer] * factor
        np.testing.assert_allclose(other.parameters[layer], expected, atol=1e-12)
        expected = own.rates[layer] * factor
        np.testing.assert_allclose(other.rates[layer], expected, atol=1e-12)
        np.testing.assert_allclose(other.q[layer], own.q[layer], atol=1e-10)


def test_default_rates_scale_with_time():
    slow = draw("default", timing=Timing(6.0, 1.2, 3.6))
    own = draw("default")
    for layer in range(4):
        np.testing.assert_array_equal(slow.q[layer], own.q[layer])
        np.testing.assert_allclose(2.0 * slow.dq[layer], own.dq[layer], atol=1e-15)
    assert np.abs(own.dq[1]).max() > 0.0


@pytest.mark.parametrize("preset", PRESETS)
def test_same_seed_same_candidates(preset):
    first, again, other = draw(preset, 4), draw(preset, 4), draw(preset, 5)
    for layer in range(4):
        np.testing.assert_array_equal(first.q[layer], again.q[layer])
    assert not np.array_equal(first.q[1], other.q[1])


def test_unknown_preset_names_the_known_ones():
    with pytest.raises(CommandError, match=r"'table2'.*default, table1"):
        draw("table2")


@pytest.mark.parametrize("counts", [(), (5, 10, 10), (5, 10, 10, 1), (5, 0, 10, 5)])
@pytest.mark.parametrize("preset", PRESETS)
def test_impossible_counts_name_what_would_work(preset, counts):
    with pytest.raises(CommandError, match="need 4 numbers >= 2"):
        draw(preset, counts=counts)


def test_closed_preset_needs_equal_ends():
    with pytest.raises(CommandError, match=r"\(5, 10, 10, 6\).*must be equal"):
        draw("default", counts=(5, 10, 10, 6))
    assert draw("table1", counts=(5, 10, 10, 6)).counts == (5, 10, 10, 6)


def test_table1_on_a_robot_that_cannot_reach_it():
    child = resized(RES, crus_length=0.05, femur_length=0.05)
    with pytest.raises(UnreachableError, match=r"1000 draws is in reach: .*reachable"):
        draw_candidates(child, "table1", np.random.default_rng(0))


def test_arrays_are_frozen_and_keep_selects():
    poses = draw("default")
    with pytest.raises(ValueError, match="read-only"):
        poses.q[0][0, 0] = 1.0
    kept = [np.array(k) for k in ([0, 2], [1, 5, 7], [3], [0, 2])]
    fewer = poses.keep(kept)
    assert fewer.counts == (2, 3, 1, 2)
    for layer, indices in enumerate(kept):
        np.testing.assert_array_equal(fewer.q[layer], poses.q[layer][indices])
        np.testing.assert_array_equal(fewer.dq[layer], poses.dq[layer][indices])
    assert fewer.closed


@pytest.mark.parametrize("height", [0.4, 0.518, 0.58])
@pytest.mark.parametrize("trunk_mass", [4.0, 16.0])
def test_geometric_sway_brings_the_com_over_the_sole(height, trunk_mass):
    robot = resized(RES, trunk_mass=trunk_mass)
    sway = geometric_sway(robot, height)
    pose = compose(robot, np.array([0.0, height, 0.0, 0.0, sway]))
    assert com(robot.reduced, pose)[1] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < sway < 1.0


@pytest.mark.parametrize("height", [0.4, 0.518])
def test_feet_too_far_apart_are_named_with_what_is_reachable(height):
    with pytest.raises(UnreachableError, match=r"hip_width = 2 m: no sway") as refusal:
        geometric_sway(resized(RES, hip_width=2.0), height)
    reachable = float(re.search(r"less than (\S+) m", str(refusal.value))[1])
    assert BIPED.hip_width < reachable < 2.0
    near = geometric_sway(resized(RES, hip_width=reachable - 1e-3), height)
    assert near == pytest.approx(0.5 * np.pi, abs=0.2)
    with pytest.raises(UnreachableError, match=f"less than {reachable:.3f} m"):
        geometric_sway(resized(RES, hip_width=reachable + 1e-3), height)
    with pytest.raises(UnreachableError, match="no sway"):
        draw_candidates(
            resized(RES, hip_width=2.0), "default", np.random.default_rng(0)
        )


def test_geometric_sway_of_res_is_as_documented():
    assert np.degrees(geometric_sway(RES, 0.875 * LEG)) == pytest.approx(16.5, abs=0.05)
