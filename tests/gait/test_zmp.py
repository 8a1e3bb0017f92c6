"""The multi-link ZMP against MuJoCo's inverse dynamics; polygons and margins."""

import mujoco
import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import resized
from reduced_model import mujoco_qpos

from gaitchain.gait.keypose.primitives import move
from gaitchain.gait.motion import State, Timing
from gaitchain.gait.zmp import (
    Support,
    desired_zmp,
    interpolated_zmp,
    margin,
    planned_region,
    sole_corners,
    support_at,
    support_polygon,
    to_world,
    zmp,
    zmp_of_wrench,
)
from gaitchain.messages import GRAVITY
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.kinematics import (
    com,
    link_com_accelerations,
    link_coms,
    link_masses,
)
from gaitchain.sim.model import build_model

RES = load_box_robot("res")
BIPED = RES.reduced
TIMING = Timing()
SEEDS = st.integers(0, 2**32 - 1)

# Fourth-order central differences on five points.
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
STENCIL = np.arange(-2, 3)


@pytest.fixture(scope="module")
def rigid_model():
    """RES without what the plan leaves out: contacts, joint limits, rotors."""
    model = build_model(RES)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.dof_armature[:] = 0.0
    return model


def random_motion(seed, trunk):
    """A pose that moves along sines: function of time, and its state at time 0."""
    rng = np.random.default_rng(seed)
    amplitude, pace = rng.uniform(0.1, 0.4, 7), rng.uniform(1.0, 3.0, 7)
    phase, centre = rng.uniform(0.0, 6.0, 7), rng.uniform(-0.3, 0.3, 7)
    if not trunk:
        amplitude[2] = centre[2] = 0.0

    def at(time):
        return centre + amplitude * np.sin(pace * time + phase)

    dq = amplitude * pace * np.cos(phase)
    return at, State(at(0.0), dq, -(pace**2) * amplitude * np.sin(phase))


def mujoco_zmp(model, at, left_support, h=1e-3):
    """ZMP of the wrench on MuJoCo's free base that moves the robot as planned."""
    data = mujoco.MjData(model)
    data.qpos[:] = mujoco_qpos(at(0.0), left_support)
    shifts = np.zeros((5, model.nv))
    for shift, k in zip(shifts, STENCIL, strict=True):
        ahead = mujoco_qpos(at(k * h), left_support)
        mujoco.mj_differentiatePos(model, shift, 1.0, data.qpos, ahead)
    data.qvel[:] = FIRST @ shifts / h
    data.qacc[:] = SECOND @ shifts / h**2
    mujoco.mj_inverse(model, data)
    force, torque = data.qfrc_inverse[:3], data.qfrc_inverse[3:6]
    turned = data.body("trunk").xmat.reshape(3, 3) @ torque
    moment = turned + np.cross(data.qpos[:3], force)
    return np.array([-moment[1], moment[0]]) / force[2]


@pytest.mark.parametrize("left_support", [True, False])
@pytest.mark.parametrize("trunk", [True, False])
@settings(max_examples=20)
@given(SEEDS)
def test_zmp_matches_mujocos_inverse_dynamics(rigid_model, left_support, trunk, seed):
    at, state = random_motion(seed, trunk)
    side = np.array([1.0, 1.0 if left_support else -1.0])
    expected = mujoco_zmp(rigid_model, at, left_support)
    np.testing.assert_allclose(zmp(RES, state) * side, expected, atol=1e-6)


def test_inertia_counts():
    """The oracle above would notice a robot of point masses."""
    _, (q, dq, ddq) = random_motion(3, trunk=True)
    mass = link_masses(BIPED)[:, None]
    lift = np.array([0.0, 0.0, GRAVITY])
    force = mass * (link_com_accelerations(BIPED, q, dq, ddq) + lift)
    moment = np.cross(link_coms(BIPED, q), force).sum(axis=0)
    points_only = np.array([-moment[1], moment[0]]) / force.sum(axis=0)[2]
    assert np.abs(points_only - zmp(RES, State(q, dq, ddq))).max() > 1e-4


@given(SEEDS)
def test_static_zmp_is_the_projection_of_the_com(seed):
    q = np.random.default_rng(seed).uniform(-0.7, 0.7, (2, 3, 7))
    state = State(q, np.zeros_like(q), np.zeros_like(q))
    np.testing.assert_allclose(zmp(RES, state), com(BIPED, q)[..., :2], atol=1e-12)


@pytest.mark.parametrize("acceleration", [-1.0, 0.0, 2.0])
def test_point_mass_is_the_linear_inverted_pendulum(acceleration):
    """x_zmp = x - z / g * x'' for a mass that keeps its height [Kajita91]."""
    light = dict.fromkeys(("crus_mass", "femur_mass", "foot_mass"), 0.001)
    trunk = {"trunk_length": 0.02, "trunk_depth": 0.01, "trunk_width": 0.01}
    pendulum = resized(RES, trunk_mass=500.0, **trunk, **light)
    height, h = 0.5, 1e-3
    x = 0.05 + 0.3 * h * STENCIL + 0.5 * acceleration * (h * STENCIL) ** 2
    q = move(pendulum, np.zeros(7), x, height)
    state = State(q[2], FIRST @ q / h, SECOND @ q / h**2)
    above_ground = height + pendulum.reduced.ankle_height + 0.01
    expected = x[2] - above_ground / GRAVITY * acceleration
    found = zmp(pendulum, state)
    assert found[0] == pytest.approx(expected, abs=2e-5)
    assert found[1] == pytest.approx(-0.5 * pendulum.reduced.hip_width, abs=1e-5)


def test_zmp_batches():
    states = [random_motion(seed, trunk=True)[1] for seed in range(6)]
    batch = State(*(np.array(x).reshape(2, 3, 7) for x in zip(*states, strict=True)))
    expected = np.array([zmp(RES, state) for state in states]).reshape(2, 3, 2)
    np.testing.assert_allclose(zmp(RES, batch), expected, atol=1e-12)


def level_hull(ankles):
    return support_polygon([sole_corners(RES, ankle) for ankle in ankles])


def area(polygon):
    x, y = polygon.T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


def test_sole_and_its_area():
    corners = sole_corners(RES, [0.1, -0.2])
    np.testing.assert_allclose(corners.min(axis=0), [0.1 - 0.09, -0.2 - 0.065])
    np.testing.assert_allclose(corners.max(axis=0), [0.1 + 0.13, -0.2 + 0.065])
    assert area(corners) == pytest.approx(0.22 * 0.13), "counter-clockwise"
    single = level_hull([[0.1, -0.2]])
    assert len(single) == 4
    assert area(single) == pytest.approx(0.22 * 0.13)


@given(st.floats(-7.0, 7.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_sole_turns_about_its_ankle(yaw, x, y):
    """Each corner as a complex number, turned by e^(i yaw)."""
    level = sole_corners(RES, [0.0, 0.0]) @ [1.0, 1j]
    turned = sole_corners(RES, [x, y], yaw)
    np.testing.assert_allclose(
        turned @ [1.0, 1j], complex(x, y) + np.exp(1j * yaw) * level, atol=1e-12
    )
    assert area(turned) == pytest.approx(0.22 * 0.13), "counter-clockwise"
    np.testing.assert_array_equal(
        sole_corners(RES, [x, y]), sole_corners(RES, [x, y], 0.0)
    )


@given(st.floats(-0.4, 0.4), st.floats(-0.3, -0.13))
def test_hull_contains_both_soles(x, y):
    ankles = [[0.0, 0.0], [x, y]]
    hull = level_hull(ankles)
    corners = np.concatenate([sole_corners(RES, ankle) for ankle in ankles])
    assert margin(corners, hull).min() > -1e-12
    assert margin(hull, hull) == pytest.approx(0.0, abs=1e-12)
    # A hull of two equal rectangles: the sole, and what it sweeps on its way.
    swept = 0.13 * abs(x) + 0.22 * abs(y)
    assert area(hull) == pytest.approx(0.22 * 0.13 + swept)


def test_hull_of_a_turned_sole_is_the_turned_sole():
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    turned = sole_corners(RES, [0.0, 0.0]) @ turn.T
    hull = support_polygon([turned, 0.5 * turned])
    assert len(hull) == 4
    assert area(hull) == pytest.approx(0.22 * 0.13)
    np.testing.assert_allclose(margin(turned, hull), 0.0, atol=1e-12)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_margin_of_a_rectangle(x, y):
    distance = min(x + 0.09, 0.13 - x, 0.065 - y, y + 0.065)
    found = margin(np.array([x, y]), level_hull([[0.0, 0.0]]))
    assert found == pytest.approx(distance, abs=1e-12)


def test_margin_batches_and_signs():
    sole = sole_corners(RES, [0.0, 0.0])
    where = np.array([[[0.02, 0.0], [0.0, 0.0], [0.13, 0.0]], [[0.2, 0.0]] * 3])
    expected = [[0.065, 0.065, 0.0], [-0.07] * 3]
    np.testing.assert_allclose(margin(where, sole), expected, atol=1e-12)


@given(SEEDS)
def test_the_zmp_of_a_force_on_the_ground_is_where_it_acts(seed):
    """Also of several; a torque about the vertical moves none of them."""
    rng = np.random.default_rng(seed)
    force, at = rng.normal(size=(2, 5, 3))
    force[:, 2] = rng.uniform(1.0, 9.0, size=5)
    acts = np.column_stack([rng.normal(size=(5, 2)), np.zeros(5)])
    torque = np.cross(acts - at, force)
    torque[:, 2] += rng.normal(size=5)
    np.testing.assert_allclose(zmp_of_wrench(torque, force, at), acts[:, :2])
    np.testing.assert_allclose(zmp_of_wrench(torque[0], force[0], at[0]), acts[0, :2])


def test_a_robot_in_the_air_has_no_zmp():
    """Nor has it a warning, of which pytest makes an error."""
    at, force = np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0], [np.nan] * 3])
    found = zmp_of_wrench(np.zeros((2, 3)), force, at)
    np.testing.assert_array_equal(found, [[0.0, 0.0], [np.nan, np.nan]])


def test_to_world_mirrors_the_right_foot_and_turns_with_it():
    foot = np.array([1.0, 2.0, np.pi / 2])
    point = np.array([0.3, 0.1])
    assert to_world(point, foot, True) == pytest.approx([0.9, 2.3])
    assert to_world(point, foot, False) == pytest.approx([1.1, 2.3])
    both = to_world(np.array([point] * 2), np.array([foot] * 2), [True, False])
    np.testing.assert_allclose(both, [[0.9, 2.3], [1.1, 2.3]])


@pytest.mark.parametrize(
    ("support", "ends"),
    [("rs", [-0.1]), ("ls", [0.1]), *((s, [-0.1, 0.1]) for s in ("rl", "lr", "stand"))],
)
def test_the_planned_region_is_as_wide_as_its_feet(support, ends):
    feet = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
    y = planned_region(RES, feet, support)[:, 1]
    half = 0.5 * BIPED.sole_width
    assert [y.min(), y.max()] == pytest.approx([ends[0] - half, ends[-1] + half])


def test_support_runs_through_the_papers_regions():
    times = np.linspace(0.0, 3.0, 60, endpoint=False)
    regions = [
        support_at(TIMING, time, left_support)
        for left_support in (False, True, False)
        for time in times
    ]
    changes = [r for i, r in enumerate(regions) if i == 0 or r is not regions[i - 1]]
    assert [r.value for r in changes] == ["rs", "rl", "ls", "lr", "rs", "rl"]
    assert [r.value for r in Support] == ["rs", "rl", "ls", "lr"]
    double = {Support.LEFT_TO_RIGHT, Support.RIGHT_TO_LEFT}
    assert sum(r in double for r in regions) / len(regions) == pytest.approx(0.2)


@given(st.floats(-0.35, 0.0), st.floats(0.0, 0.35))
def test_desired_zmp_lies_within_the_support_of_its_moment(rear, ahead):
    desired = desired_zmp(RES, rear, ahead)
    own = [0.0, 0.0]
    ankles = ([own, [rear, -0.2]], [own], [own], [own, [ahead, -0.2]])
    for point, feet in zip(desired, ankles, strict=True):
        assert margin(point, level_hull(feet)) > 0.06
    # In the middle between both soles, so it splits their hull in halves.
    hull = level_hull(ankles[3])
    centre = 0.5 * (hull.min(axis=0) + hull.max(axis=0))  # it is its own mirror image
    np.testing.assert_allclose(desired[3], centre, atol=1e-12)


def test_desired_zmp_closes_and_batches():
    """Where a step's desired ZMP ends is where the next step's begins."""
    lengths = np.array([0.05, 0.2, 0.3])
    desired = desired_zmp(RES, -lengths, lengths)
    assert desired.shape == (3, 4, 2)
    moved = desired[:, 3] - np.stack([lengths, np.full(3, -BIPED.hip_width)], axis=-1)
    np.testing.assert_allclose(moved * [1.0, -1.0], desired[:, 0], atol=1e-15)
    assert desired_zmp(RES, -0.1, lengths).shape == (3, 4, 2)


def test_interpolated_zmp_is_the_cubic_through_the_key_moments():
    rng = np.random.default_rng(0)
    coefficients = rng.uniform(-1, 1, (2, 4))
    time = np.linspace(0.0, 3.0, 13)
    keys = np.stack([np.polyval(c, TIMING.key_times) for c in coefficients], axis=-1)
    curve = np.stack([np.polyval(c, time) for c in coefficients], axis=-1)
    exact = interpolated_zmp(TIMING, keys, np.array(TIMING.key_times))
    np.testing.assert_allclose(exact, keys, atol=1e-12)
    np.testing.assert_allclose(interpolated_zmp(TIMING, keys, time), curve, atol=1e-10)


def test_interpolated_zmp_is_scipys_polynomial():
    keys = np.random.default_rng(1).uniform(-0.2, 0.2, (4, 2))
    time = np.linspace(-0.1, 3.1, 33)
    expected = scipy.interpolate.KroghInterpolator(TIMING.key_times, keys)(time)
    found = interpolated_zmp(TIMING, keys, time)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-16)


@given(
    st.lists(
        st.tuples(*2 * [st.sampled_from([-0.2, 0.0, 0.1])], st.floats(-4.0, 4.0)),
        min_size=1,
        max_size=3,
    )
)
def test_the_hull_is_qhulls(ankles):
    """Feet in line, on each other and turned: many corners nearly on an edge."""
    soles = [sole_corners(RES, [x, y], yaw) for x, y, yaw in ankles]
    hull, corners = support_polygon(soles), np.concatenate(soles)
    qhull = scipy.spatial.ConvexHull(corners)
    assert area(hull) == pytest.approx(qhull.volume, rel=1e-12)
    expected = corners[qhull.vertices]
    points = np.concatenate([corners, corners.mean(axis=0)[None]])
    np.testing.assert_allclose(
        margin(points, hull), margin(points, expected), atol=1e-12
    )
