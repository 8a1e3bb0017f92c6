"""What the walker makes of its sensors, against the simulator's truth."""

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gaitchain
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.attitude import Vertical, turn_attitude
from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.rotations import rotation
from gaitchain.balance.state import Attitude, Planar
from gaitchain.balance.support_foot import measured_step, see_support
from gaitchain.build.search_walks import Walk, walk_of
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.gait.stride.shape import MODEL_SHAPE
from gaitchain.gait.zmp import Support
from gaitchain.messages import CONTROL_PERIOD_S, Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.model import build_model
from gaitchain.sim.world import World
from gaitchain.walker.stride_setup import make_walk
from gaitchain.walker.walker import Walker

SHARED = Path(__file__).parents[3] / "shared" / "robots"
H1 = Path(os.environ.get("MENAGERIE_ROOT") or SHARED) / "unitree_h1" / "h1.xml"
LEGS = legs_of(load_box_robot("res"))
STILL_TICKS = 100  # in which the walker learns the vertical
WALK = Command(0.25), Command(0.15, 0.0, 0.1), Command(0.0, 0.03), Command(-0.1)
SIDES = {Support.LEFT_SINGLE: 1.0, Support.RIGHT_SINGLE: -1.0}


def walk_on(library, ticks, world=None, see=None, blind=False):
    """Stand for a second, then walk a command after the other; return all targets.

    `see` is called before every `write`. Blind, all that the simulator knows of the
    base is garbage while the walker thinks.
    """
    walker, backend = Walker(library), MujocoBackend(library.robot, world)
    backend.connect(walker.stand)
    targets = []
    for tick in range(ticks):
        if tick >= STILL_TICKS and tick % 250 == STILL_TICKS:
            walker.command(WALK[tick // 250 % len(WALK)])
        sensors = backend.read()
        if blind:
            with blindfolded(backend.data):
                targets.append(walker.step(sensors).position)
        else:
            targets.append(walker.step(sensors).position)
        if see is not None:
            see(tick, walker, backend, sensors)
        backend.write(targets[-1])
        assert not backend.fallen, f"fell in tick {tick}"
    return np.array(targets)


class blindfolded:
    """Hide the base and everything that follows from it, and put it back."""

    def __init__(self, data):
        free = [data.qpos[:7], data.qvel[:6], data.qacc[:6]]
        world = [data.xpos, data.xmat, data.xquat, data.xipos, data.geom_xpos]
        more = [data.site_xpos, data.subtree_com, data.cfrc_ext, data.sensordata]
        self._truth = [(array, array.copy()) for array in (*free, *world, *more)]

    def __enter__(self):
        for array, _ in self._truth:
            array[...] = np.nan

    def __exit__(self, *_):
        for array, before in self._truth:
            array[...] = before


class Truth:
    """The simulator's state, worked out at the moment of the sensors."""

    def __init__(self, backend):
        self.data = mujoco.MjData(backend.model)
        self.data.qpos[:], self.data.qvel[:] = backend.data.qpos, backend.data.qvel
        mujoco.mj_fwdPosition(backend.model, self.data)
        mujoco.mj_fwdVelocity(backend.model, self.data)
        mujoco.mj_subtreeVel(backend.model, self.data)

    @property
    def angles(self):
        """Roll, pitch, yaw of the trunk [rad]."""
        turn = self.data.body("trunk").xmat.reshape(3, 3)
        return np.array(
            [
                math.atan2(turn[2, 1], turn[2, 2]),
                -math.asin(turn[2, 0]),
                math.atan2(turn[1, 0], turn[0, 0]),
            ]
        )

    def com(self, side):
        """CoM and its velocity in the step frame of a support foot."""
        foot = self.data.body("left_foot" if side > 0 else "right_foot")
        ahead = foot.xmat.reshape(3, 3)[:2, 0] / np.linalg.norm(foot.xmat[[0, 3]])
        axes = np.array([ahead, side * np.array([-ahead[1], ahead[0]])])
        place = axes @ (self.data.subtree_com[1] - foot.xpos)[:2]
        return np.concatenate([place, axes @ self.data.subtree_linvel[1, :2]])


def test_orientation_and_com_are_the_simulators(brisk):
    """Eleven seconds without noise: forward, in a curve, sideways and back."""
    angles, coms = [], []

    def see(tick, walker, backend, sensors):
        if tick < STILL_TICKS:
            return
        truth = Truth(backend)
        angles.append(np.array(walker.gait.estimate[:3]) - truth.angles)
        side = SIDES.get(walker.gait.support)
        if side is not None and not walker.standing:
            view = see_support(
                LEGS,
                walker.gait.estimate,
                side,
                sensors.joint_position,
                sensors.joint_velocity,
            )
            coms.append(np.array(view.com) - truth.com(side))

    walk_on(brisk, 1100, see=see)
    roll, pitch, yaw = np.degrees(np.abs(angles)).max(axis=0)
    assert roll < 0.5
    assert pitch < 0.5
    assert yaw < 3.0  # nothing tells it of the heading but the gyro
    off = np.sqrt(np.mean(np.square(coms), axis=0))
    assert len(coms) > 500
    assert off[:2].max() < 0.003  # m
    assert off[2:].max() < 0.03  # m/s


def test_noise_and_bias_do_not_carry_it_away(brisk):
    """A cheap robot's sensors: the support foot and gravity hold the tilt."""
    off = []

    def see(tick, walker, backend, _):
        if tick >= STILL_TICKS:
            off.append(np.array(walker.gait.estimate[:2]) - backend.tilt)

    walk_on(brisk, 900, World(noise=1.0, seed=4), see)
    assert np.degrees(np.abs(off)).max() < 2.0


def test_the_walker_knows_nothing_of_the_simulators_base(brisk):
    """With the truth poisoned while it thinks, every target is the same bit."""
    world = World(noise=1.0, seed=3)
    seeing = walk_on(brisk, 450, world)
    blind = walk_on(brisk, 450, world, blind=True)
    np.testing.assert_array_equal(seeing, blind)


def test_measurements_are_copies(brisk):
    """None of them is a window into the simulator."""
    backend = MujocoBackend(brisk.robot, World(foot_sensors=True))
    backend.connect(np.zeros(12))
    sensors = backend.read()
    for name in (
        "joint_position",
        "joint_velocity",
        "angular_velocity",
        "acceleration",
    ):
        measured = getattr(sensors, name)
        for array in (backend.data.qpos, backend.data.qvel, backend.data.sensordata):
            assert not np.shares_memory(measured, array), name


def test_walking_loads_no_simulator():
    code = (
        "import sys, gaitchain.walker.walker, gaitchain.walker.stride_gait\n"
        "import gaitchain.balance.walk_controller\n"
        "print([m for m in ('mujoco', 'joblib') if m in sys.modules])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_no_word_of_the_simulator_in_the_online_path():
    package = Path(gaitchain.__file__).parent
    files = [*(package / "balance").glob("*.py"), *(package / "walker").glob("*.py")]
    assert len(files) > 25
    for file in files:
        text = file.read_text()
        for word in ("import mujoco", "backends", "qpos", "qvel"):
            assert word not in text, f"{word} in {file.name}"


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_gyro_integrates_to_the_orientation(seed):
    """Against the simulator's quaternions, turned by the same body rates."""
    rng = np.random.default_rng(seed)
    amplitude, phase = rng.uniform(-0.5, 0.5, 3), rng.uniform(0.0, 6.0, 3)
    attitude = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    for tick in range(1000):
        gyro = amplitude * np.sin(3.0 * tick * 0.001 + phase)
        attitude = turn_attitude(attitude, gyro, 0.001)
        mujoco.mju_quatIntegrate(quaternion, gyro, 0.001)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, quaternion)
    seen = rotation(attitude.yaw, attitude.pitch, attitude.roll)
    np.testing.assert_allclose(seen, turn.reshape(3, 3), atol=2e-3)


def test_a_tumbling_trunk_gives_numbers():
    """Euler angles end at 90 deg; a falling robot passes it."""
    attitude = Attitude(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(1000):
        attitude = turn_attitude(attitude, np.array([3.0, 9.0, -4.0]), 0.01)
        assert np.isfinite(attitude).all()


@settings(max_examples=30)
@given(
    st.sampled_from([1.0, -1.0]),
    st.lists(st.floats(-0.6, 0.6), min_size=12, max_size=12).map(np.array),
)
def test_a_step_is_measured_as_the_simulator_has_it(side, joints):
    model = build_model(load_box_robot("res"))
    data = mujoco.MjData(model)
    data.qpos[7:] = joints
    mujoco.mj_forward(model, data)
    names = ("left_foot", "right_foot")
    support, swing = (data.body(n) for n in (names if side > 0 else names[::-1]))
    turn = support.xmat.reshape(3, 3)
    ahead, left, _ = turn.T @ (swing.xpos - support.xpos)
    relative = turn.T @ swing.xmat.reshape(3, 3)
    heading = math.atan2(relative[1, 0], relative[0, 0])
    made = measured_step(LEGS, joints, side)
    np.testing.assert_allclose(made, (ahead, left, heading), atol=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turning_trunk_carries_the_com_around_the_foot(side):
    """Upright, turning, joints at rest: v = w x r about the middle of the sole."""
    joints = np.zeros(12)
    joints[[2, 3, 4, 8, 9, 10]] = -0.2, 0.4, -0.2, -0.4, 0.6, -0.2
    turning = Attitude(0.0, 0.0, 0.4, 0.0, 0.0, 0.7)
    com = see_support(LEGS, turning, side, joints, np.zeros(12)).com
    assert abs(com.y) > 0.05
    assert com.vx == pytest.approx(-0.7 * side * com.y, abs=1e-9)
    ahead = com.x - 0.5 * (LEGS.sole_front + LEGS.sole_rear)
    assert com.vy == pytest.approx(0.7 * side * ahead, abs=1e-9)


@settings(max_examples=40)
@given(
    st.sampled_from([1.0, -1.0]),
    st.tuples(st.sampled_from([-1, 1]), st.sampled_from([-1, 1])),
    st.integers(0, 2**32 - 1),
)
def test_a_foot_that_tips_over_a_corner_carries_the_com_along(side, corner, seed):
    """The simulator's CoM moves as seen, while the corner that bears stays put."""
    rng, model = np.random.default_rng(seed), build_model(load_box_robot("res"))
    data, name = mujoco.MjData(model), "left_foot" if side > 0 else "right_foot"
    data.qpos[7:] = rng.uniform(-0.3, 0.3, 12)
    mujoco.mj_forward(model, data)
    # The trunk lies so that the foot is tilted towards the corner.
    tilted = rotation(0.0, corner[0] * rng.uniform(0.03, 0.3), 0.0) @ rotation(
        0.0, 0.0, -corner[1] * rng.uniform(0.03, 0.3)
    )
    trunk = rotation(rng.uniform(-3.0, 3.0), 0.0, 0.0) @ tilted
    trunk = trunk @ data.body(name).xmat.reshape(3, 3).T
    mujoco.mju_mat2Quat(data.qpos[3:7], trunk.ravel())
    mujoco.mj_forward(model, data)
    foot = data.body(name)
    along = LEGS.sole_front if corner[0] > 0 else LEGS.sole_rear
    across = corner[1] * LEGS.sole_half_width
    bears = foot.xpos + foot.xmat.reshape(3, 3) @ [along, across, -LEGS.ankle_height]
    rates = np.append(rng.normal(0.0, 1.0, 3), rng.normal(0.0, 1.0, 12))
    moves = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, moves, None, bears, foot.id)
    data.qvel[3:] = rates
    data.qvel[:3] = -moves @ data.qvel  # the corner stays put
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    yaw = math.atan2(trunk[1, 0], trunk[0, 0])
    level = rotation(yaw, 0.0, 0.0).T @ trunk
    roll = math.atan2(level[2, 1], level[2, 2])
    pitch = -math.asin(level[2, 0])
    attitude = turn_attitude(Attitude(roll, pitch, yaw, 0.0, 0.0, 0.0), rates[:3], 0.0)
    view = see_support(LEGS, attitude, side, data.qpos[7:], rates[3:])
    heading = yaw + view.foot_yaw
    ahead, left, _ = rotation(heading, 0.0, 0.0).T @ data.subtree_linvel[1]
    assert (view.com.vx, side * view.com.vy) == pytest.approx((ahead, left), abs=1e-9)


def test_standing_still_shows_tilt_bias_and_slope():
    """Gravity corrects the tilt; the gyro's mean is its bias."""
    vertical, attitude = Vertical(CONTROL_PERIOD_S), Attitude(yaw=0.3)
    bias, tilt = np.array([0.01, -0.02, 0.03]), (0.04, -0.06)
    gravity = rotation(0.0, tilt[1], tilt[0]).T @ [0.0, 0.0, 9.81]
    for _ in range(6000):
        attitude = turn_attitude(attitude, bias - vertical.bias, CONTROL_PERIOD_S)
        attitude = vertical.stand(attitude, bias, gravity)
    np.testing.assert_allclose(vertical.bias, bias, atol=3e-3)
    np.testing.assert_allclose(attitude[:2], tilt, atol=5e-3)
    assert attitude.yaw == pytest.approx(0.3, abs=0.06)  # learned meanwhile


@pytest.mark.parametrize("rate_hz", [250, 500])
def test_a_robot_stands_as_still_at_any_rate(brisk, rate_hz):
    """It rocked itself at first, by 5 deg/s, and took that for the gyro's bias."""
    walker = Walker(brisk, period_s=1.0 / rate_hz)
    backend = MujocoBackend(brisk.robot, period_s=1.0 / rate_hz)
    backend.connect(walker.stand)
    gyro = []
    for _ in range(2 * rate_hz):
        sensors = backend.read()
        gyro.append(sensors.angular_velocity)
        backend.write(walker.step(sensors).position)
    assert np.degrees(np.std(gyro, axis=0)).max() < 0.5
    assert math.degrees(abs(walker.gait.estimate.yaw)) < 0.05


def test_an_average_is_over_as_many_seconds_at_any_rate():
    """Six seconds turned at 0.1 rad/s, one without, and one more after a walk."""
    found = []
    for rate_hz in (100, 500):
        vertical, up = Vertical(1.0 / rate_hz), np.array([0.0, 0.0, 9.81])
        for tick in range(7 * rate_hz):
            gyro = np.array([0.0, 0.0, 0.1 if tick < 6 * rate_hz else 0.0])
            vertical.stand(Attitude(), gyro, up)
        found.append(vertical.bias[2])
        vertical.leave_stand()
        for _ in range(rate_hz):
            vertical.stand(Attitude(), np.zeros(3), up)
        found.append(vertical.bias[2])
    assert found[2:] == pytest.approx(found[:2], rel=0.01)
    kept = math.exp(-1.0 / 6.0)  # of a second, at 1 / (5 s + the first 1 s)
    assert found[0] == pytest.approx(0.1 * (1.0 - kept / 6.0) * kept, rel=0.01)


def test_a_robot_that_sways_to_a_stand_has_no_bias():
    """Half a swing of 1.5 deg, gravity seen all along: the gyro was right."""
    vertical, attitude = Vertical(CONTROL_PERIOD_S), Attitude()
    ticks, amplitude = 40, math.radians(1.5)
    for i in range(ticks):
        pitch = amplitude * math.sin(math.pi * i / ticks)
        rate = amplitude * math.cos(math.pi * i / ticks) * math.pi / (ticks * 0.01)
        gyro, up = np.array([0.0, rate, 0.0]), rotation(0.0, pitch, 0.0).T
        if i < ticks // 2:  # the average of half a swing is far from zero
            attitude = turn_attitude(attitude, gyro - vertical.bias, 0.01)
            attitude = vertical.stand(attitude, gyro, up @ [0.0, 0.0, 9.81])
    assert attitude.pitch == pytest.approx(amplitude, abs=math.radians(0.2))
    np.testing.assert_allclose(vertical.bias, 0.0, atol=2e-3)


def test_a_shaken_robot_learns_nothing():
    vertical, attitude = Vertical(CONTROL_PERIOD_S), Attitude(0.1, 0.2)
    for gyro, acceleration in (
        (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81])),
        (np.zeros(3), np.array([0.0, 9.0, 9.0])),
    ):
        assert vertical.stand(attitude, gyro, acceleration) == attitude
    np.testing.assert_array_equal(vertical.bias, 0.0)


def test_soles_that_chatter_do_not_tilt_it():
    """Mostly 2 m/s^2 to one side, at times 8 to the other, which alone look shaken."""
    vertical, attitude = Vertical(CONTROL_PERIOD_S), Attitude()
    rng = np.random.default_rng(0)
    for _ in range(500):
        aside = -8.0 if rng.random() < 0.2 else 2.0
        felt = np.array([0.0, aside, 9.81])
        attitude = vertical.stand(attitude, np.zeros(3), felt)
    assert math.degrees(abs(attitude.roll)) < 1.0
    assert math.degrees(np.abs(vertical.bias).max()) < 0.5


def test_a_robot_that_comes_to_rest_finds_its_tilt_but_no_bias():
    vertical, attitude = Vertical(CONTROL_PERIOD_S), Attitude(0.08, -0.05)
    up, still = np.array([0.0, 0.0, 9.81]), np.zeros(3)
    for _ in range(round(6.0 / CONTROL_PERIOD_S)):
        attitude = vertical.settle(attitude, still, up)
    np.testing.assert_allclose(attitude[:2], 0.0, atol=2e-3)
    np.testing.assert_array_equal(vertical.bias, 0.0)


def test_gravity_shows_roll_and_bias_while_a_robot_sways():
    """The trunk's middle goes 3 cm to either side in 0.8 s, the gyro is wrong."""
    vertical, attitude = (
        Vertical(CONTROL_PERIOD_S, foot_tells_roll=False),
        Attitude(0.06, 0.1),
    )
    bias, omega = np.array([0.01, 0.0, 0.0]), math.tau / 0.8
    for tick in range(6000):
        aside = -0.03 * omega**2 * math.sin(omega * tick * CONTROL_PERIOD_S)
        gyro, felt = bias - vertical.bias, np.array([0.0, aside, 9.81])
        attitude = turn_attitude(attitude, gyro, CONTROL_PERIOD_S)
        attitude = vertical.lean(attitude, felt, 0.0)
    assert math.degrees(abs(attitude.roll)) < 0.6
    assert vertical.bias[0] == pytest.approx(bias[0], abs=2e-3)


def test_a_curve_does_not_look_like_a_lean():
    vertical = Vertical(CONTROL_PERIOD_S, foot_tells_roll=False)
    before = Attitude(yaw_rate=0.5)
    felt = np.array([0.0, 0.4 * 0.5, 9.81])  # v times yaw rate, to the middle
    assert vertical.lean(before, felt, 0.4) == before


def test_an_impact_counts_no_more_than_half_a_radian():
    after = Vertical(CONTROL_PERIOD_S, foot_tells_roll=False).lean(
        Attitude(), np.array([0.0, 500.0, -80.0]), 0.0
    )
    assert 0.0 < after.roll <= 0.4 * 0.5 * CONTROL_PERIOD_S


def test_a_foot_that_stands_on_its_edge_says_nothing_about_roll():
    still, on_edge = Attitude(), Planar(0.1, 0.02)
    flat = Vertical(CONTROL_PERIOD_S).walk(still, on_edge, CONTROL_PERIOD_S)
    edge = Vertical(CONTROL_PERIOD_S, foot_tells_roll=False).walk(
        still, on_edge, CONTROL_PERIOD_S
    )
    assert flat.roll < 0.0 == edge.roll
    assert flat.pitch == edge.pitch < 0.0


def test_a_wrong_roll_is_found_though_each_foot_lands_by_it():
    """A foot that is placed level by an attitude agrees with it, however wrong."""
    vertical = Vertical(CONTROL_PERIOD_S, foot_tells_roll=False)
    attitude, up = Attitude(roll=0.05), np.array([0.0, 0.0, 9.81])
    for _ in range(round(20.0 / CONTROL_PERIOD_S)):
        attitude = turn_attitude(attitude, -vertical.bias, CONTROL_PERIOD_S)
        attitude = vertical.lean(attitude, up, 0.3)
        attitude = vertical.walk(attitude, Planar(0.0, 0.0), CONTROL_PERIOD_S)
    assert abs(attitude.roll) < 5e-3


@pytest.mark.parametrize(
    ("file", "tells"),
    [
        ("unitree_h1/h1.xml", 0),
        ("unitree_g1/g1.xml", 0),
        ("booster_t1/t1.xml", 1),
        ("robotis_op3/op3.xml", 1),
    ],
)
def test_narrow_soles_and_those_without_an_ankle_roll_tell_no_roll(file, tells):
    path = H1.parents[1] / file
    if not path.is_file():
        pytest.skip(f"no {path}; set MENAGERIE_ROOT")
    assert legs_of(load_robot(str(path))).foot_tells_roll == tells


@pytest.mark.skipif(not H1.is_file(), reason=f"no {H1}; set MENAGERIE_ROOT")
def test_a_robot_without_ankle_rolls_keeps_the_vertical():
    """H1 steps in place, its feet near together: the soles lean by 5 deg either way."""
    robot, shape = load_robot(str(H1)), replace(MODEL_SHAPE, stance=0.7)
    timing = shape.timing(robot)
    poses, gaits = walk_of(robot, shape, timing.step, Walk(0.0), 0.2, 36)
    goals = iter(poses.step_targets(gaits[:, 1:].tolist()))
    walked, backend = make_walk(poses, timing), MujocoBackend(robot)
    backend.connect(walked.stand)
    off = []
    for tick in range(1500):
        sensors = backend.read()
        walked.sense(sensors)
        if tick == STILL_TICKS:
            walked.begin_shift(left_support=True)
        backend.write(walked.drive(sensors, lambda _: next(goals)))
        off.append(np.subtract(walked.attitude[:2], backend.tilt))
    assert np.degrees(np.abs(np.mean(off[-200:], axis=0))).max() < 1.0


@pytest.mark.skipif(not H1.is_file(), reason=f"no {H1}; set MENAGERIE_ROOT")
@pytest.mark.parametrize("lean", [-0.1, -0.03, 0.05, 0.12])
def test_a_foot_on_an_edge_that_points_outward_is_not_pitched(lean):
    """H1 rests on its heel and one of its toes: MuJoCo says that they are level."""
    robot = load_robot(str(H1))
    legs, joints = legs_of(robot), np.array(robot.legs.stand)
    joints[1] += lean  # the left hip's roll
    joints[4] -= legs.sole_taper * abs(lean)
    model = build_model(robot)
    data = mujoco.MjData(model)
    data.qpos[7:] = joints
    mujoco.mj_kinematics(model, data)
    corners = [data.geom(f"left_corner_{i}").xpos[2] for i in (1, 2, 3)]
    heel, toe = corners[1], min(corners[0], corners[2])
    assert heel == pytest.approx(toe, abs=2e-4)
    view = see_support(legs, Attitude(), 1.0, joints, np.zeros(10))
    assert view.foot_tilt.y == pytest.approx(0.0, abs=2e-3)


def test_a_robot_set_down_with_a_wrong_vertical_walks_off(brisk):
    """For half a second something pulled at it; its DCM then seems beside its feet."""
    walker, backend = Walker(brisk), MujocoBackend(brisk.robot)
    backend.connect(walker.stand)
    walker.command(Command(0.2))
    pulled = np.array([0.0, 4.0, 9.6])
    for tick in range(800):
        sensors = backend.read()
        if tick < 50:
            sensors = replace(sensors, acceleration=pulled)
        backend.write(walker.step(sensors).position)
    assert not backend.fallen
    assert backend.data.qpos[0] > 0.3
