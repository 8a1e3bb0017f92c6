"""Feasible edges, against the motion of each edge sampled densely."""

import numpy as np
import pytest

from gaitchain.gait.keypose import feasibility
from gaitchain.gait.keypose.feasibility import feasible_edges
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import StepMotion, Timing
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.robot.kinematics import points

RES = load_box_robot("res")
BIPED = RES.reduced
SWING_ANKLE = 6
DENSE = 12 * 25 + 1  # every sample of the module is among these


def edge(poses, timing, layer, start, end):
    """Joint angles, their speeds and the sole's height, densely along one edge."""
    times = timing.key_times[layer : layer + 2]
    q = np.stack([poses.q[layer][start], poses.q[layer + 1][end]])
    dq = np.stack([poses.dq[layer][start], poses.dq[layer + 1][end]])
    moment = np.linspace(*times, DENSE)
    path = StepMotion(times, q, dq).at(moment).q
    angles = joint_angles(path, left_support=True)
    speeds = np.gradient(angles, moment, axis=0)
    height = (
        points(poses.robot.reduced, path)[:, SWING_ANKLE, 2]
        - poses.robot.reduced.ankle_height
    )
    return np.abs(angles).max(), np.abs(speeds).max(), height.min()


def violations(poses, timing, layer, start, end, *, slack):
    """How far beyond its tolerance each rule is broken; `slack` of it is forgiven."""
    robot = poses.robot
    angle, speed, lowest = edge(poses, timing, layer, start, end)
    needed = -feasibility._SCRAPE
    if layer == 1:
        needed = feasibility._CLEARANCE * robot.reduced.leg_length
    broken = {
        "angle": angle / (feasibility._ANGLE_HEADROOM * robot.reduced.joint_angle_limit)
        - 1,
        "speed": speed / (feasibility._SPEED_HEADROOM * robot.reduced.joint_speed_limit)
        - 1,
        "height": (needed - lowest) / robot.reduced.leg_length,
    }
    if layer == 2:
        feet = poses.foot_x
        travel = abs(feet[2][start] - feet[3][end]) / robot.reduced.leg_length
        broken["drag"] = travel - feasibility._DRAG
    # Heights vary less between the samples than angles do, the drag not at all.
    share = {"angle": 1.0, "speed": 1.0, "height": 0.05, "drag": 0.0}
    return {name: by for name, by in broken.items() if by > slack * share[name]}


def wild(seed):
    """Candidates with some that no robot should walk: fast, low, far from landing."""
    rng = np.random.default_rng(seed)
    poses = draw_candidates(RES, "default", rng, counts=(4, 6, 8, 4))
    parameters = [p.copy() for p in poses.parameters]
    rates = [r.copy() for r in poses.rates]
    parameters[1][0, 3] = 0.004  # foot_z: hardly lifted
    parameters[1][1, 1] *= 0.72  # hip_height: a deep crouch
    parameters[1][2, 4] = 1.2  # sway far over
    rates[1][3, 2] = -2.5  # foot_x: backward, fast
    rates[2][0, 3] = -0.6  # foot_z: into the ground
    parameters[2][1, 2] -= 0.06  # foot_x: lands far from every kp_4
    return KeyPoses(RES, tuple(parameters), tuple(rates), closed=True)


@pytest.mark.parametrize("timing", [Timing(), Timing(0.6, 0.12, 0.36)])
@pytest.mark.parametrize("seed", [0, 1])
def test_masks_agree_with_dense_sampling(seed, timing):
    poses = wild(seed)
    masks = feasible_edges(poses, timing)
    sizes = poses.counts
    seen = set()
    for layer, mask in enumerate(masks):
        assert mask.shape == (sizes[layer], sizes[layer + 1])
        assert mask.dtype == np.bool_
        for start, end in np.ndindex(mask.shape):
            if mask[start, end]:
                # Between the module's samples a little more may happen.
                assert not violations(poses, timing, layer, start, end, slack=0.03)
            else:
                broken = violations(poses, timing, layer, start, end, slack=-1e-9)
                assert broken
                seen |= set(broken)
    assert any(mask.any() for mask in masks)
    assert not all(mask.all() for mask in masks)
    assert {"height", "drag"} <= seen


@pytest.mark.parametrize("seed", [0, 1])
def test_allowed_edges_keep_the_robots_own_limits(seed):
    """Row 20: the headroom covers what the samples miss."""
    poses, timing = wild(seed), Timing()
    for layer, mask in enumerate(feasible_edges(poses, timing)):
        for start, end in np.argwhere(mask):
            angle, speed, lowest = edge(poses, timing, layer, start, end)
            assert angle <= BIPED.joint_angle_limit
            assert speed <= BIPED.joint_speed_limit
            assert lowest > -0.005


def test_extremes_are_those_of_the_motion():
    poses, timing = wild(0), Timing()
    for layer in range(3):
        sampled = feasibility._sampled_angles(poses, timing, layer, joint_angles)
        angles, speeds = (np.abs(of).max(axis=(-1, -2)) for of in sampled)
        for start, end in ((0, 0), (1, 2), (3, 1)):
            angle, speed, _ = edge(poses, timing, layer, start, end)
            assert angles[start, end] == pytest.approx(angle, rel=0.02)
            assert angles[start, end] <= angle + 1e-12
            assert 0.75 * speed <= speeds[start, end] <= speed * 1.01


def test_what_is_too_fast_is_walked_more_slowly():
    """Standing to the fastest swing: T decides."""
    poses = draw_candidates(
        RES, "default", np.random.default_rng(0), counts=(4, 6, 8, 4)
    )
    allowed = [
        sum(mask.sum() for mask in feasible_edges(poses, Timing(t, 0.2 * t, 0.6 * t)))
        for t in (0.15, 0.5, 3.0)
    ]
    assert allowed[0] < allowed[1] <= allowed[2]


def test_a_landing_foot_may_not_be_dragged():
    poses, timing = wild(0), Timing()
    mask = feasible_edges(poses, timing)[2]
    travel = np.abs(poses.foot_x[2][:, None] - poses.foot_x[3])
    limit = feasibility._DRAG * BIPED.leg_length
    assert not mask[travel > limit].any()
    own = travel[np.arange(2, 8), np.arange(2, 8) % 4]
    assert np.all(own <= limit)  # a kp_3 belongs to one step length
