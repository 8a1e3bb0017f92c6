"""Walks measured in MuJoCo: linked, repeatable, falls told, and true to contacts."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.keypose_rollout import walk_targets
from gaitchain.build.rollout import PhysicsCost, Weights, WorldRange
from gaitchain.errors import CommandError
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.model import World

BEFORE, TICKS, AFTER = 50, 300, 100  # control periods: standing, a step, standing


@pytest.fixture(scope="module")
def source(library):
    return PhysicsCost(library.poses, library.timing)


@pytest.fixture(scope="module")
def walk(library):
    """Two steps of the longest stride that physics passed, from and to standing."""
    there = library.allowed_pairs[STAND] & library.allowed_pairs[:, STAND]
    longest = int(np.flatnonzero(there)[-1])
    gaits = library.gait_of
    return np.stack([gaits[STAND, longest], gaits[longest, STAND]])


@pytest.fixture(scope="module")
def targets(library, walk):
    return walk_targets(library.poses, library.timing, walk)


@pytest.fixture
def backend(res, targets):
    backend = MujocoBackend(res)
    backend.connect(targets[0])
    return backend


def assert_same(one, other):
    np.testing.assert_array_equal(one.cost, other.cost)
    np.testing.assert_array_equal(one.advance, other.advance)
    assert one.fell == other.fell


def test_targets_pass_the_key_poses_at_the_key_times(library, walk, targets):
    poses, timing = library.poses, library.timing
    assert targets.shape == (BEFORE + 2 * TICKS + AFTER, 12)
    for step, gait in enumerate(walk):
        for layer, (n, time_s) in enumerate(zip(gait, timing.key_times, strict=True)):
            tick = BEFORE + step * TICKS + round(time_s / CONTROL_PERIOD_S)
            expected = joint_angles(poses.q[layer][n], left_support=step % 2 == 0)
            np.testing.assert_allclose(targets[tick], expected, atol=1e-9)
    stand = joint_angles(poses.q[0][STAND], left_support=True)
    np.testing.assert_array_equal(targets[:BEFORE], np.tile(stand, (BEFORE, 1)))
    np.testing.assert_array_equal(targets[-AFTER:], np.tile(stand, (AFTER, 1)))
    limit = library.robot.reduced.joint_speed_limit * CONTROL_PERIOD_S
    assert np.abs(np.diff(targets, axis=0)).max() <= limit


def test_unlinked_walks_are_refused(source, walk):
    unlinked = walk.copy()
    unlinked[1, 0] = (unlinked[1, 0] + 1) % len(source.poses.q[0])
    moving = walk.copy()
    moving[0, 0] = 1
    unfinished = walk[:1]
    for wrong in (unlinked, moving, unfinished):
        with pytest.raises(CommandError, match="must start at the pose where the step"):
            list(source.walk_all([walk, wrong]))


def test_same_seed_same_results_for_any_workers(source, walk):
    walks = [walk] * 3
    one = list(replace(source, seed=5).walk_all(walks))
    two = list(replace(source, seed=5, workers=2).walk_all(walks))
    for a, b in zip(one, two, strict=True):
        assert_same(a, b)
    # Each walk has a world of its own, and it depends on seed and place alone.
    assert not np.array_equal(one[0].cost, one[1].cost)
    assert_same(next(replace(source, seed=5).walk_all(walks[:1])), one[0])
    other = next(replace(source, seed=6).walk_all(walks[:1]))
    assert not np.array_equal(one[0].cost, other.cost)


def test_a_walk_that_holds(source, library, walk):
    result = source.measure(walk, World())
    assert not result.fell
    assert result.cost.shape == result.advance.shape == (2,)
    assert np.all((result.cost >= 0.0) & (result.cost <= 1.0))
    lengths = library.poses.foot_x[3][walk[:, 3]] - library.poses.foot_x[0][walk[:, 0]]
    # Half a stride each, give or take slip.
    assert result.advance.sum() == pytest.approx(0.5 * lengths.sum(), rel=0.4)
    assert_same(result, source.measure(walk, World()))


@pytest.fixture(scope="module")
def tripping(library, walk):
    """Candidates with one kp_2 that throws the robot on its side, and a walk to it."""
    poses = library.poses
    parameters = [np.array(p) for p in poses.parameters]
    bad = int(np.setdiff1d(np.arange(poses.counts[1]), walk[:, 1])[0])
    parameters[1][bad, PARAMETERS.index("sway")] = 1.0
    last = walk.copy()
    last[0, 1] = bad
    source = PhysicsCost(replace(poses, parameters=tuple(parameters)), library.timing)
    return source, np.concatenate([walk, last])


def first_fall(source, walk, world):
    """Tick of the fall, counted from the first step, by a walk of our own."""
    backend = MujocoBackend(source.poses.robot, world)
    targets = walk_targets(source.poses, source.timing, walk)
    backend.connect(targets[0])
    for tick, target in enumerate(targets, start=-BEFORE):
        backend.write(target)
        if backend.fallen:
            return tick
    return None


def test_a_fall_is_told_at_its_step(tripping):
    source, walk = tripping
    result = source.measure(walk, World())
    assert result.fell
    assert first_fall(source, walk, World()) // TICKS == 2
    assert np.all(result.cost[:2] < 1.0)
    np.testing.assert_array_equal(result.cost[2:], [1.0, np.nan])
    assert np.all(np.isfinite(result.advance[:2]))
    assert np.all(np.isnan(result.advance[2:]))


def test_weak_servos_fall(source, walk):
    world = World(servo_gain=0.1)
    longer = np.concatenate([walk, walk])
    result = source.measure(longer, world)
    assert result.fell
    step = max(first_fall(source, longer, world) // TICKS, 0)
    assert result.cost[step] == 1.0
    assert np.all(result.cost[:step] < 1.0)
    assert np.all(np.isnan(result.cost[step + 1 :]))


def test_slippery_ground_costs_more(source, walk):
    """On 1/40 of the friction it slides about; a slow walk need not fall."""
    dry, wet = (source.measure(walk, World(friction=f)) for f in (0.8, 0.02))
    assert not dry.fell
    assert wet.fell or np.linalg.norm(wet.advance - dry.advance) > 0.01
    assert np.nanmean(wet.cost) > np.nanmean(dry.cost)


def test_a_fall_before_the_first_step_costs_the_first_step(source, walk):
    result = source.measure(walk, World(servo_gain=1e-3))
    assert result.fell
    np.testing.assert_array_equal(result.cost, [1.0, np.nan])
    assert np.all(np.isnan(result.advance))


def test_cost_terms_by_hand(library, walk, targets):
    """Tracking, effort and ZMP alone, from a second walk of the same world."""
    robot, world = library.robot, World(friction=0.7, servo_gain=0.95)
    backend = MujocoBackend(robot, world)
    backend.connect(targets[0])
    rows = {"error": [], "torque": [], "zmp": [], "base": []}
    for tick, target in enumerate(targets):
        rows["error"].append(np.mean((backend.data.qpos[7:] - target) ** 2))
        rows["torque"].append(np.mean(backend.data.actuator_force**2))
        support = (tick - BEFORE) // TICKS % 2
        yaw = backend.foot_yaws()[support]
        ahead = robot.reduced.sole_offset * np.array([np.cos(yaw), np.sin(yaw)])
        sole = backend.foot_positions()[support, :2] + ahead
        rows["zmp"].append(np.sum((backend.zmp() - sole) ** 2))
        rows["base"].append(backend.data.qpos[0])
        backend.write(target)
    steps = [slice(BEFORE + i * TICKS, BEFORE + (i + 1) * TICKS) for i in range(2)]
    single = round((library.timing.rise + library.timing.fall) / CONTROL_PERIOD_S)
    alone = [slice(s.start, s.start + single) for s in steps]
    scales = {
        "tracking": ("error", steps, np.radians(3.0) ** 2),
        "effort": ("torque", steps, (0.5 * robot.reduced.joint_torque_limit) ** 2),
        "zmp": ("zmp", alone, (0.5 * robot.reduced.sole_length) ** 2),
    }
    nothing = Weights(zmp=0.0, tracking=0.0, effort=0.0, slip=0.0)
    for name, (row, parts, scale) in scales.items():
        weights = replace(nothing, **{name: 0.7})
        source = PhysicsCost(library.poses, library.timing, weights)
        result = source.measure(walk, world)
        mean = np.array([np.mean(rows[row][part]) for part in parts])
        np.testing.assert_allclose(result.cost, 1.0 - np.exp(-mean / scale), rtol=1e-9)
    base = [*(rows["base"][s.start] for s in steps), backend.data.qpos[0]]
    np.testing.assert_allclose(result.advance, np.diff(base), atol=1e-12)


def test_worlds_vary_within_their_range():
    ranges = WorldRange(friction=(0.2, 0.3), servo_gain=(0.9, 0.9), mass=(1.0, 2.0))
    worlds = [ranges.draw(np.random.default_rng(seed)) for seed in range(20)]
    assert all(0.2 <= w.friction <= 0.3 and 1.0 <= w.mass <= 2.0 for w in worlds)
    assert {w.servo_gain for w in worlds} == {0.9}
    assert len({w.friction for w in worlds}) == 20
    assert ranges.draw(np.random.default_rng(3)) == worlds[3]


def contact_zmp(backend):
    """Where the moment of all contact forces about the ground has no x and no y."""
    model, data = backend.model, backend.data
    force, moment = np.zeros(3), np.zeros(3)
    for i in range(data.ncon):
        local = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, local)
        contact = data.contact[i]
        axes = contact.frame.reshape(3, 3)
        # The force acts on the second geom; the floor is the world's.
        sign = 1.0 if model.geom_bodyid[contact.geom1] == 0 else -1.0
        one = sign * local[:3] @ axes
        force += one
        moment += np.cross(contact.pos, one) + sign * local[3:] @ axes
    return np.array([-moment[1], moment[0]]) / force[2], force[2]


def test_zmp_is_that_of_the_contact_forces(backend, targets, res):
    ticks = {30, BEFORE + 30, BEFORE + 150, BEFORE + 250, BEFORE + 310, BEFORE + 500}
    ticks |= set(range(BEFORE + 2 * TICKS, BEFORE + 2 * TICKS + 5))
    seen = []
    for tick, target in enumerate(targets):
        backend.write(target)
        if tick in ticks:
            expected, load = contact_zmp(backend)
            np.testing.assert_allclose(backend.zmp(), expected, atol=1e-6)
            assert backend.foot_loads().sum() == pytest.approx(load)
            seen.append(tuple(backend.foot_loads() > 0.02 * 9.81 * res.reduced.mass))
    # Standing on the left foot, on the right foot, on both.
    assert {(True, False), (False, True), (True, True)} <= set(seen)


def test_zmp_is_unknown_in_the_air(backend):
    backend.data.qpos[2] += 0.5
    mujoco.mj_forward(backend.model, backend.data)
    backend.write(backend.data.qpos[7:].copy())
    assert np.all(np.isnan(backend.zmp()))
    np.testing.assert_allclose(backend.foot_loads(), 0.0, atol=1e-9)


def test_connect_stands_on_level_soles(backend, res):
    np.testing.assert_allclose(backend.foot_positions()[:, 2], res.reduced.ankle_height)
    np.testing.assert_allclose(
        backend.foot_positions()[:, 1],
        [0.5 * res.reduced.hip_width, -0.5 * res.reduced.hip_width],
    )
    np.testing.assert_allclose(backend.foot_yaws(), 0.0, atol=1e-12)
    upright = backend.data.xmat[backend.feet].reshape(2, 3, 3)
    np.testing.assert_allclose(upright, [np.eye(3)] * 2, atol=1e-9)
    assert not backend.fallen


def test_standing_carries_the_weight(backend, targets, res):
    for _ in range(200):
        backend.write(targets[0])
    assert backend.foot_loads().sum() == pytest.approx(
        9.81 * res.reduced.mass, rel=0.01
    )
    left, right = backend.foot_loads()
    assert left == pytest.approx(right, rel=0.05)
    sensors = backend.read()
    assert np.linalg.norm(sensors.acceleration) == pytest.approx(9.81, abs=0.05)
    assert sensors.acceleration[2] == pytest.approx(9.81, abs=0.1)
    np.testing.assert_allclose(sensors.angular_velocity, 0.0, atol=0.01)
    assert not backend.fallen


def test_read_is_what_the_sensors_say(backend, targets):
    for count in range(3):
        assert backend.read().time == pytest.approx(count * CONTROL_PERIOD_S)
        backend.write(targets[BEFORE + 40])
    sensors, data = backend.read(), backend.data
    np.testing.assert_array_equal(sensors.joint_position, data.qpos[7:])
    np.testing.assert_array_equal(sensors.joint_velocity, data.qvel[6:])
    assert np.abs(sensors.joint_velocity).max() > 0.01
    before = sensors.joint_position.copy()
    backend.write(targets[BEFORE + 40])
    np.testing.assert_array_equal(sensors.joint_position, before)  # a copy


def test_gyro_and_accelerometer_measure_in_the_trunks_frame(backend):
    data = backend.data
    data.qpos[2] += 1.0  # in the air, nothing but gravity
    data.qpos[3:7] = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]  # on its face
    data.qvel[3:6] = [0.0, 0.3, 0.0]
    mujoco.mj_forward(backend.model, data)
    sensors = backend.read()
    np.testing.assert_allclose(sensors.angular_velocity, [0.0, 0.3, 0.0], atol=1e-12)
    assert np.linalg.norm(sensors.acceleration) < 0.5  # falls freely
    # The other robot turns about the world's vertical: the trunk's own -x.
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
    np.testing.assert_allclose(
        rotation.reshape(3, 3).T @ [0, 0, 1], [-1, 0, 0], atol=1e-12
    )


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)])
def test_fallen_by_tilt(backend, axis):
    for degrees, fallen in ((40.0, False), (50.0, True), (120.0, True)):
        mujoco.mju_axisAngle2Quat(
            backend.data.qpos[3:7], np.array(axis, float), np.radians(degrees)
        )
        assert backend.fallen == fallen


def test_turning_on_the_spot_is_no_fall(backend):
    mujoco.mju_axisAngle2Quat(backend.data.qpos[3:7], np.array([0.0, 0.0, 1.0]), 2.5)
    assert not backend.fallen


def test_fallen_by_height(backend):
    standing = backend.data.qpos[2]
    for part, fallen in ((0.7, False), (0.6, True)):
        backend.data.qpos[2] = part * standing
        assert backend.fallen == fallen


@pytest.mark.parametrize("make", [PlannedCost, PhysicsCost])
def test_both_costs_take_linked_gaits(library, make):
    gait_of = library.gait_of
    out, back = np.argwhere(library.allowed_pairs[0])[0][0], 0
    walk = np.array([gait_of[0, out], gait_of[out, back]])
    costs = make(library.poses, library.timing)(np.stack([walk, walk]))
    assert costs.shape == (2, 2)
    assert np.all((costs >= 0.0) & (costs <= 1.0))
