"""The walk as a Gymnasium environment, and the expert that walks it."""

import copy
import math
import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest
from other_robots import with_legs

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError, LibraryError
from gaitchain.messages import Command
from gaitchain.rl.actions import TargetScale
from gaitchain.rl.environment import WalkEnv
from gaitchain.rl.expert import Expert, open_library
from gaitchain.rl.phase import StepPhase
from gaitchain.rl.registration import WALK, register
from gaitchain.rl.reward import Reward
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

gymnasium = pytest.importorskip("gymnasium")
register()
AHEAD = (0.3, 0.0, 0.0)


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_errors_count_by_the_size_of_the_robot(size):
    """By dynamic similarity: speeds go with sqrt(l), turns with 1 / sqrt(l)."""
    robot = load_box_robot("res")
    lengths = {
        n: size * getattr(robot.reduced, n) for n in ("femur_length", "crus_length")
    }
    scaled = with_legs(robot, robot.legs, **lengths)
    off, turned = 0.1 * math.sqrt(size), 0.3 / math.sqrt(size)
    backend = MujocoBackend(robot)
    backend.connect(np.array(robot.legs.stand))
    reward = Reward(Command(off, 0.0, turned), scaled, backend)
    parts = reward.parts(np.zeros(1), np.zeros(1))
    assert parts["reward_speed"] == pytest.approx(math.exp(-1.0), rel=2e-3)
    assert parts["reward_turn"] == pytest.approx(0.5 * math.exp(-1.0), rel=2e-3)


@pytest.fixture(scope="module")
def env():
    return WalkEnv(random_world=False)


def walk(env, act, periods, seed=0):
    """Return observations, rewards and the last info of a walk."""
    seen, _ = env.reset(seed=seed)
    rewards, infos = [], {}
    for _ in range(periods):
        seen, reward, fell, _, infos = env.step(act(seen))
        rewards.append(reward)
        if fell:
            break
    return seen, np.array(rewards), infos


def nothing(env):
    return lambda seen: np.zeros(env.action_space.shape, np.float32)


@pytest.mark.parametrize("action", ["residual", "command", "targets"])
def test_gymnasium_finds_no_fault(action):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(WALK, action=action).unwrapped)


def test_an_episode_is_cut_off_after_ten_seconds():
    env = gymnasium.make(WALK, command=(0.0, 0.0, 0.0), random_world=False)
    env.reset(seed=0)
    ends = []
    while not ends or not any(ends[-1]):
        _, _, fell, late, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        ends.append((fell, late))
    assert len(ends) == 1000
    assert ends[-1] == (False, True)


def test_importing_the_package_registers_the_environment():
    code = f"import gymnasium, gaitchain.rl; gymnasium.spec({WALK!r})"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_registered_twice_is_registered_once():
    before = gymnasium.registry[WALK]
    register()
    assert gymnasium.registry[WALK] is before


def test_without_residual_it_walks_as_commanded():
    env = WalkEnv(command=AHEAD, random_world=False)
    _, rewards, infos = walk(env, nothing(env), 500)
    ahead = env._backend.data.qpos[0]
    assert len(rewards) == 500 and "fall" not in infos
    # Five seconds at 0.3 m/s, less what the start takes.
    assert 1.0 < ahead < 1.6
    assert rewards[300:].mean() > 1.0  # of 1.5 at most


def test_observations_are_the_sensors():
    env = WalkEnv(command=AHEAD, random_world=False)
    seen, _ = env.reset(seed=0)
    measured, layout = env._backend.read(), env.layout
    assert seen[layout.joint_position] == pytest.approx(
        measured.joint_position - env.stand, abs=1e-6
    )
    upright = seen[layout.acceleration]
    assert np.linalg.norm(upright) == pytest.approx(9.81, rel=0.02)
    assert seen[layout.command][0] == pytest.approx(0.3 / env.range.vx[1])
    assert layout.size == len(seen) == env.observation_space.shape[0]


@pytest.mark.parametrize("command", [AHEAD, (-0.2, 0.0, 0.0), (0.1, 0.05, 0.2)])
def test_a_phase_goes_on_without_jumps(command):
    """Through double supports, too, in which the gait has chosen the next side."""
    env = WalkEnv(command=command, random_world=False)
    env.reset(seed=0)
    phases = []
    for _ in range(400):
        seen, *_ = env.step(np.zeros(12, np.float32))
        sine, cosine = seen[env.layout.phase]
        phases.append(math.atan2(sine, cosine) / math.tau)
    ahead = np.diff(phases[100:]) % 1.0
    ahead[ahead > 1.0 - 1e-6] = 0.0  # one that waits, in 32 bits
    assert ahead.max() < 0.1
    # 3 s are as many cycles as the planned time has.
    cycles = 2.99 / (2.0 * env.library.timing.step)
    assert ahead.sum() == pytest.approx(cycles, abs=0.1)


def test_the_first_step_begins_at_its_own_phase():
    """The weight is shifted before it: no half cycle is passed meanwhile."""
    for command, start in ((Command(vy=0.1), 0.5), (Command(vy=-0.1), 0.0)):
        walker = Walker(open_library(None))
        backend = MujocoBackend(walker.library.robot)
        gait, phase, shifts = walker.gait, StepPhase(walker.gait), []
        backend.connect(walker.stand)
        for tick in range(300):
            if tick == 120:
                walker.command(command)
            backend.write(walker.step(backend.read()).position)
            phase.tick()
            if gait.steps == 1:
                break
            if not gait.standing:
                shifts.append(phase.value)
        assert gait.state.left_support == (start == 0.0)
        assert shifts and set(shifts) == {start}
        assert phase.value == start


def test_the_same_seed_is_the_same_walk():
    env = WalkEnv()
    first, second = (walk(env, nothing(env), 100, seed=3) for _ in range(2))
    assert np.array_equal(first[0], second[0])
    other, _, _ = walk(env, nothing(env), 100, seed=4)
    assert not np.array_equal(first[0], other)


def test_an_action_is_a_command():
    env = WalkEnv(action="command", random_world=False)
    parts = np.array([0.0, 0.0, 0.5], np.float32)
    walk(env, lambda seen: parts, 300)
    # Three seconds at half the limit, less what the start takes.
    most = 0.5 * env.range.yaw_rate[1] * 3.0
    assert 0.6 * most < env._backend.heading < 1.05 * most


def test_a_fall_ends_the_episode_and_says_how():
    world = World(push=(Push(200.0, 0.0, 0.3),))
    env = WalkEnv(command=AHEAD, world=world)
    _, rewards, infos = walk(env, nothing(env), 500)
    assert len(rewards) < 500
    assert infos["fall"].startswith("fell forward after")
    assert rewards[-1] < -90.0
    parts = [value for name, value in infos.items() if name.startswith("reward_")]
    assert sum(parts) == pytest.approx(rewards[-1])


def test_actions_and_their_change_cost_as_documented():
    robot = load_box_robot("res")
    backend = MujocoBackend(robot)
    backend.connect(np.array(robot.legs.stand))
    reward = Reward(Command(), robot, backend)
    parts = reward.parts(np.full(12, -0.5), np.full(12, 0.2))
    assert parts["reward_action"] == pytest.approx(-0.05 * 0.25)
    assert parts["reward_change"] == pytest.approx(-0.05 * 0.04)


def test_a_residual_is_added_to_the_targets_of_the_walk():
    """And clipped: 2 adds no more than 1."""
    env = WalkEnv(command=AHEAD, random_world=False, residual_rad=0.05)
    env.reset(seed=0)
    control, walker = env._control, env._control.walker
    action = np.linspace(-2.0, 2.0, 12).astype(np.float32)
    sent, targets = [], []
    write, step = env._backend.write, walker.step
    env._backend.write = lambda target: (sent.append(target), write(target))

    def walked(sensors):
        found = step(sensors)
        targets.append(found.position.copy())
        return found

    control.walker.step = walked
    for _ in range(5):
        seen, *_ = env.step(action)
    off = 0.05 * np.clip(action, -1.0, 1.0)
    np.testing.assert_allclose(
        np.subtract(sent, targets), np.tile(off, (5, 1)), atol=1e-7
    )
    assert seen[env.layout.action] == pytest.approx(np.clip(action, -1.0, 1.0))
    measured = env._sensors
    assert seen[env.layout.joint_velocity] == pytest.approx(
        measured.joint_velocity, abs=1e-5
    )
    assert seen[env.layout.angular_velocity] == pytest.approx(
        measured.angular_velocity, abs=1e-5
    )


def test_worlds_are_drawn_and_fields_of_them_fixed():
    env = WalkEnv(command=AHEAD)
    worlds = []
    for seed in (3, 4, 3):
        env.reset(seed=seed)
        worlds.append(env._backend.world)
    assert worlds[0] == worlds[2] != worlds[1]
    assert worlds[0].friction != worlds[1].friction
    for drawn in (True, False):
        fixed = WalkEnv(world={"friction": 0.4}, random_world=drawn)
        fixed.reset(seed=3)
        assert fixed._backend.world.friction == 0.4
        assert (fixed._backend.world == World(friction=0.4)) != drawn


def test_the_expert_walks_by_observations_alone():
    env, expert = WalkEnv(action="targets", command=AHEAD), Expert()
    _, rewards, infos = walk(env, expert.act, 500)
    assert len(rewards) == 500 and "fall" not in infos
    assert env._backend.data.qpos[0] > 0.7  # it stands for the first second
    # Without an expert's targets the robot only stands.
    walk(env, nothing(env), 300)
    assert math.hypot(*env._backend.data.qpos[:2]) < 0.1


def test_targets_and_actions_are_inverse():
    library = open_library(None)
    stand = library.robot.legs.stand
    scale = TargetScale(library, stand)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, len(stand)))
    for action in actions:
        assert scale.action(scale.targets(action)) == pytest.approx(action)
    assert scale.targets(np.ones(len(stand))) == pytest.approx(library.robot.legs.upper)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"action": "torque"}, "residual, command, targets"),
        ({"residual_rad": 0.0}, "above 0 to 1"),
        ({"command": (9.0, 0.0, 0.0)}, "this library walks"),
        ({"render_mode": "human"}, "only None"),
        ({"action": ["residual"]}, "residual, command, targets"),
        ({"residual_rad": "a"}, "'a': give above 0 to 1"),
        ({"residual_rad": math.nan}, "above 0 to 1"),
        ({"residual_rad": None}, "above 0 to 1"),
        ({"world": {"nope": 1}}, "world 'nope': there are friction, "),
        ({"world": {3: 1}}, "world 3: there are"),
        ({"world": {"friction": -1}}, "friction is -1, must be 0.001 to 10"),
        ({"world": {"friction": "a"}}, "friction is 'a', must be"),
        ({"world": {"push": (Push(1.0, 0.0, 1.0, body="tail"),)}}, "body 'tail'"),
        ({"world": World(timestep=0.003)}, "must divide the control period"),
        ({"world": "ice"}, "'ice': give a World, or fields of one"),
        ({"world": 5}, "5: give a World"),
    ],
)
def test_options_that_cannot_be_are_refused(options, says):
    with pytest.raises(CommandError, match=says):
        WalkEnv(**options)


def test_a_library_that_is_none_is_refused():
    with pytest.raises(LibraryError, match="library 5: give a GaitLibrary, the path"):
        WalkEnv(library=5)


@pytest.mark.parametrize(
    "command",
    [
        (math.nan, 0.0, 0.0),
        (0.1, math.inf, 0.0),
        (0.1, 0.0),
        (0.1, 0.0, 0.0, 0.0),
        (),
        "abc",
        ("0.1", "0", "0"),
        (0.1, (0.0,), 0.0),
        (0.1, None, 0.0),
        0.1,
        {"vx": 0.1},
    ],
)
def test_a_command_is_three_finite_numbers(env, command):
    with pytest.raises(CommandError, match="three finite numbers"):
        WalkEnv(command=command)
    with pytest.raises(CommandError, match="three finite numbers"):
        env.reset(options={"command": command})


def test_a_command_comes_in_any_form_of_three_numbers(env):
    for command in ([0.25, 0, 0], np.array([0.25, 0.0, 0.0], np.float32)):
        _, info = env.reset(seed=0, options={"command": command})
        assert info["command"] == (0.25, 0.0, 0.0)
    assert env.reset(options={"command": (0, 0, 0)})[1]["command"] == (0.0, 0.0, 0.0)
    with pytest.raises(CommandError, match="this library walks"):
        env.reset(options={"command": (1e308, 1e308, 0.0)})


def test_steps_that_cannot_be_are_refused():
    with pytest.raises(CommandError, match="random_world 'no': need True or False"):
        WalkEnv(random_world="no")
    env = WalkEnv(random_world=False)
    with pytest.raises(CommandError, match="call reset first"):
        env.step(np.zeros(12, np.float32))
    env.reset(seed=0)
    with pytest.raises(CommandError, match="need 12 numbers"):
        env.step(np.zeros(3, np.float32))
    with pytest.raises(CommandError, match="need 12 numbers"):
        env.step(np.full(12, np.nan, np.float32))
    for action in ("a", None, ["a"] * 12, [[0.0]] * 11 + [0.0]):
        with pytest.raises(CommandError, match="need 12 numbers"):
            env.step(action)
    with pytest.raises(CommandError, match="give a dictionary"):
        env.reset(options=5)
    with pytest.raises(CommandError, match="only 'command'"):
        env.reset(options={"speed": 1.0})
    with pytest.raises(CommandError, match="need 47 numbers"):
        Expert().act(np.zeros(5, np.float32))


def test_an_episode_is_not_copied_and_an_environment_is():
    env = WalkEnv(random_world=False)
    other = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(env.reset(seed=3)[0], other.reset(seed=3)[0])
    for copied in pickle.dumps, copy.deepcopy:
        with pytest.raises(CommandError, match="make another one of the same robot"):
            copied(env)


def test_vectorised():
    envs = gymnasium.make_vec(
        WALK, num_envs=2, vectorization_mode="sync", random_world=False
    )
    seen, _ = envs.reset(seed=0)
    assert seen.shape == (2, 47)
    _, rewards, fell, _, _ = envs.step(np.zeros((2, 12), np.float32))
    assert rewards.shape == (2,) and not fell.any()
    envs.close()
