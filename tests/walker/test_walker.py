"""The walker: smooth targets within limits, on any backend, at any pace."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import resized
from verdicts import FAILED

from gaitchain.backends.mock import MockBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.keypose_rollout import walk_targets
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.command_range import ends_text, inward
from gaitchain.gait.family import STAND
from gaitchain.gait.library_file import save_library
from gaitchain.gait.qualification import Qualification
from gaitchain.gait.zmp import Support
from gaitchain.messages import CONTROL_PERIOD_S, Command, Sensors
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.walker.walker import Walker

TICKS = 300  # per step of 3 s
SPEEDS = (0.04, 0.08, 0.08, 0.02)


def speed_asked(walker):
    return walker.gait.state.asked[0] / walker.library.timing.step


def sensors(time_s):
    nothing = np.full(12, np.nan)  # open loop: only the time counts
    return Sensors(time_s, nothing, nothing, np.full(3, np.nan), np.full(3, np.nan))


def drive(walker, backend, ticks):
    """Walk on a backend; return the targets and the decisions in force."""
    backend.connect(walker.stand)
    targets, decisions = [], []
    for _ in range(ticks):
        target = walker.step(backend.read())
        assert target.joint_names == JOINT_NAMES
        targets.append(target.position)
        decisions.append(walker.decision)
        backend.write(target.position)
    return np.array(targets), decisions


def walked_gaits(decisions):
    """The (S, 4) pose indices of the steps, from the decisions as they came."""
    made = [decisions[0]]
    made += [b for a, b in pairwise(decisions) if b is not a]
    poses = [d.pose for d in made if d.layer > 0]
    inner = np.array(poses).reshape(-1, 3)
    starts = np.concatenate([[STAND], inner[:-1, 2]])
    return np.column_stack([starts, inner])


def commands(*speeds):
    return [Command(speed) for speed in speeds]


@pytest.fixture
def walker(library):
    return Walker(library, feedback=False)


@pytest.mark.parametrize("policy", ["look_ahead", "greedy"])
def test_targets_are_the_chains_key_poses_joined(library, policy):
    """The same key poses give the same targets as the walks that were trained on."""
    walker = Walker(library, policy, feedback=False)
    walker.follow(commands(*SPEEDS, 0.0))
    targets, decisions = drive(walker, MockBackend(CONTROL_PERIOD_S), 8 * TICKS)
    gaits = walked_gaits(decisions)
    assert len(gaits) >= len(SPEEDS)
    assert gaits[-1, 3] == STAND
    expected = walk_targets(library.poses, library.timing, gaits)[50:]
    compared = min(len(expected), len(targets))
    np.testing.assert_allclose(targets[:compared], expected[:compared], atol=1e-9)
    np.testing.assert_allclose(
        targets[compared:], np.tile(walker.stand, (len(targets) - compared, 1))
    )


def test_targets_are_continuous_and_within_the_limits(walker, library):
    robot = library.robot
    walker.follow(commands(*SPEEDS, 0.0, 0.08, 0.0))
    targets, _ = drive(walker, MockBackend(CONTROL_PERIOD_S), 10 * TICKS)
    jumps = np.abs(np.diff(targets, axis=0)).max()
    assert 0.0 < jumps <= robot.reduced.joint_speed_limit * CONTROL_PERIOD_S
    assert np.abs(targets).max() <= robot.reduced.joint_angle_limit


def test_without_a_command_it_stands(walker):
    targets, decisions = drive(walker, MockBackend(CONTROL_PERIOD_S), 2 * TICKS)
    np.testing.assert_array_equal(targets, np.tile(walker.stand, (2 * TICKS, 1)))
    assert walker.standing
    assert all(d.layer == 0 for d in decisions)


def test_stop_brings_the_feet_together_and_stays(walker, library):
    backend = MockBackend(CONTROL_PERIOD_S)
    walker.command(Command(library.speed_range[1]))
    drive(walker, backend, 4 * TICKS)
    assert not walker.standing
    walker.command(Command(0.0))
    targets = []
    for _ in range(4 * TICKS):
        target = walker.step(backend.read()).position
        targets.append(target)
        backend.write(target)
    assert walker.standing
    np.testing.assert_allclose(
        targets[-TICKS:], np.tile(walker.stand, (TICKS, 1)), atol=1e-12
    )


def test_a_command_counts_from_the_next_step_on(library):
    """Until the step's end the targets are as if it had not been given."""
    low, high = library.speed_range
    one, two = (Walker(library, feedback=False) for _ in range(2))
    paths = []
    for walker, later in ((one, low), (two, 0.0)):
        walker.command(Command(high))
        path = []
        for tick in range(3 * TICKS):
            if tick == TICKS + 100:
                walker.command(Command(later))
            path.append(walker.step(sensors(tick * CONTROL_PERIOD_S)).position)
        paths.append(np.array(path))
    np.testing.assert_array_equal(paths[0][: 2 * TICKS], paths[1][: 2 * TICKS])
    assert not np.array_equal(paths[0], paths[1])


def test_one_command_per_step_and_the_last_one_stays(walker, library):
    low, high = library.speed_range
    walker.follow(commands(low, high, high))
    seen = []
    for tick in range(5 * TICKS):
        walker.step(sensors(tick * CONTROL_PERIOD_S))
        if tick % TICKS == 0:
            seen.append(speed_asked(walker))
    assert seen == pytest.approx([low, high, high, high, high])


def test_standing_counts_commands_by_the_step_time(walker, library):
    high = library.speed_range[1]
    walker.follow(commands(0.0, 0.0, high))
    standing = []
    for tick in range(3 * TICKS):
        walker.step(sensors(tick * CONTROL_PERIOD_S))
        standing.append(walker.standing)
    assert standing == [True] * (2 * TICKS) + [False] * TICKS


def test_a_command_out_of_range_is_clamped_with_a_note(walker, library):
    low, high = library.speed_range
    done = walker.command(Command(2.0 * high))
    assert done.vx == high
    assert ends_text(low, high, "m/s") in walker.note
    walker.step(sensors(0.0))
    assert speed_asked(walker) == pytest.approx(high)
    walker.command(Command(low))
    assert walker.note == ""


def test_followed_commands_out_of_range_are_noted(walker, library):
    low, high = library.speed_range
    walker.follow(commands(2.0 * high, low, 2.0 * high, -1.0, float("nan"), 0.0))
    walked = ends_text(low, high, "m/s")
    clamped = f"{2.0 * high:g} m/s is outside {walked}: {inward(high):.3f}"
    # Each once, in the order of the commands.
    assert walker.note.split("; ") == [
        clamped,
        "-1 m/s is no way on: stop",
        "nan m/s is no way on: stop",
    ]
    walker.follow(commands(low, 0.0))
    assert walker.note == ""


@settings(max_examples=25)
@given(st.lists(st.integers(1, 700), min_size=1, max_size=20), st.integers(0, 10**6))
def test_skipped_periods_land_where_they_should(library, gaps, start_s):
    """Late sensors miss targets, but change none: neither poses nor their times."""
    steady, late = Walker(library, feedback=False), Walker(library, feedback=False)
    walk = commands(*SPEEDS, 0.0)
    for walker in (steady, late):
        walker.follow(walk)
    ticks = [0, *np.cumsum(gaps).tolist()]
    wanted = set(ticks)
    expected = {}
    for tick in range(min(ticks[-1], 8 * TICKS) + 1):
        # Whatever lies between the sensors' times: every tenth tick is enough here.
        if tick in wanted or tick % 10 == 0:
            time_s = start_s + tick * CONTROL_PERIOD_S
            expected[tick] = steady.step(sensors(time_s)).position
    for tick in ticks:
        target = late.step(sensors(start_s + tick * CONTROL_PERIOD_S)).position
        if tick in expected:
            np.testing.assert_allclose(target, expected[tick], atol=1e-6)
        else:  # after the last step
            np.testing.assert_allclose(target, late.stand, atol=1e-12)


def test_other_control_periods_follow_the_same_path(library):
    fast, slow = Walker(library, feedback=False), Walker(library, feedback=False)
    for walker in (fast, slow):
        walker.command(Command(library.speed_range[1]))
    path = [fast.step(sensors(0.004 * n)).position for n in range(1600)]
    coarse = [slow.step(sensors(0.02 * n)).position for n in range(320)]
    np.testing.assert_allclose(path[::5], coarse, atol=1e-9)


BAD_TIMES = pytest.mark.parametrize("bad", [float("nan"), np.inf, -np.inf])


@BAD_TIMES
def test_a_bad_time_counts_as_one_period(library, bad):
    """Targets are those of a clock that is right all the time."""
    spoilt, clean = Walker(library, feedback=False), Walker(library, feedback=False)
    for walker in (spoilt, clean):
        walker.command(Command(library.speed_range[1]))
    for tick in range(2 * TICKS):
        time_s = CONTROL_PERIOD_S * tick
        lost = tick % 50 in (1, 2, 3)
        target = spoilt.step(sensors(bad if lost else time_s))
        expected = clean.step(sensors(time_s)).position
        np.testing.assert_allclose(target.position, expected, atol=1e-9)
        assert ("time" in target.status) == lost


@BAD_TIMES
def test_a_bad_first_time_stands_at_the_start(library, bad):
    walker = Walker(library, feedback=False)
    walker.command(Command(library.speed_range[1]))
    target = walker.step(sensors(bad)).position
    np.testing.assert_allclose(target, walker.stand, atol=1e-12)


def test_the_planned_support_alternates(walker, library):
    walker.command(Command(library.speed_range[1]))
    timing, regions = library.timing, []
    for tick in range(4 * TICKS):
        walker.step(sensors(tick * CONTROL_PERIOD_S))
        regions.append(walker.gait.support)
    single = round((timing.rise + timing.fall) / CONTROL_PERIOD_S)
    left = [Support.LEFT_SINGLE] * single + [Support.LEFT_TO_RIGHT] * (TICKS - single)
    right = [Support.RIGHT_SINGLE] * single
    right += [Support.RIGHT_TO_LEFT] * (TICKS - single)
    assert regions == 2 * (left + right)


def test_the_panel_shows_the_pose_in_force(walker, library):
    walker.command(Command(library.speed_range[1]))
    times, key_moments = library.timing.key_times, []
    for time_s in (*times[:3], times[3] + times[1]):
        walker.step(sensors(time_s))
        key_moments.append(
            (walker.gait.panel.key_moment, walker.gait.panel.left_support)
        )
        assert walker.gait.panel.key_moment == f"kp_{walker.decision.layer + 1}"
    assert key_moments == [
        ("kp_2", True),
        ("kp_3", True),
        ("kp_4", True),
        ("kp_3", False),
    ]


def test_the_simulator_and_the_mock_get_the_same_targets(library):
    """One protocol: open loop, the walk does not depend on who carries it out."""
    paths = []
    for backend in (MockBackend(CONTROL_PERIOD_S), MujocoBackend(library.robot)):
        walker = Walker(library, feedback=False)
        walker.follow(commands(0.04, 0.02, 0.0))
        paths.append(drive(walker, backend, 4 * TICKS)[0])
        backend.close()
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-9)


def test_reset_stands_and_walks_the_same_again(walker, library):
    walker.command(Command(library.speed_range[1]))
    first, _ = drive(walker, MockBackend(CONTROL_PERIOD_S), 2 * TICKS)
    walker.reset()
    assert walker.standing
    again, _ = drive(walker, MockBackend(CONTROL_PERIOD_S), 2 * TICKS)
    np.testing.assert_array_equal(first, again)


def test_an_unqualified_library_is_refused(library):
    for verdict in (Qualification(), FAILED):
        draft = replace(library, qualification=verdict)
        with pytest.raises(LibraryError, match="not qualified: physics has not passed"):
            Walker(draft)
        assert Walker(draft, require_qualified=False).standing


def test_load(library, tmp_path):
    path = tmp_path / "res.gait"
    save_library(library, path)
    loaded, made = Walker.load(path, library.robot), Walker(library)
    for walker in (loaded, made):
        walker.command(Command(library.speed_range[1]))
    for tick in range(0, 2 * TICKS, 25):
        one, two = (w.step(sensors(0.01 * tick)).position for w in (loaded, made))
        np.testing.assert_array_equal(one, two)
    other = resized(load_box_robot("res"), hip_width=0.3)
    with pytest.raises(LibraryError, match="hip_width"):
        Walker.load(path, other)
    save_library(replace(library, qualification=Qualification()), path)
    with pytest.raises(LibraryError, match="not qualified"):
        Walker.load(path)


@pytest.mark.parametrize("asked_s", [1.0, 2.7])
def test_commands_given_in_mid_step_begin_with_the_next_step(library, asked_s):
    low, high = library.speed_range
    walker = Walker(library, feedback=False)
    walker.command(Command(high))
    begun = []
    for tick in range(4 * TICKS):
        if tick == round(asked_s / CONTROL_PERIOD_S):
            walker.follow(commands(low, high, low))
        walker.step(sensors(tick * CONTROL_PERIOD_S))
        if tick % TICKS == 0:
            begun.append(speed_asked(walker))
    assert begun == pytest.approx([high, low, high, low])


@pytest.mark.parametrize("clock_s", [-5.0, 0.0, 1e9])
def test_a_clock_that_jumps_moves_no_joint_by_a_jump(library, clock_s):
    walker = Walker(library, feedback=False)
    walker.command(Command(library.speed_range[1]))
    before = None
    for tick in range(TICKS):
        # From the 150th period on the clock shows another time.
        jump = clock_s - 1.5 if tick >= 150 else 0.0
        target = walker.step(sensors(tick * CONTROL_PERIOD_S + jump)).position
        if before is not None:
            largest = library.robot.reduced.joint_speed_limit * CONTROL_PERIOD_S
            assert np.abs(target - before).max() <= largest
        before = target


def test_a_slow_step_goes_ahead_alone(walker, library):
    """As the ends of a walk in steps, which are slower than any steady one."""
    slow = 0.5 * library.speed_range[0]
    assert slow > 0.0
    walker.follow([Command(slow, 0.1, 0.2, 0.01), Command(slow)])
    assert walker.commanded == Command(slow)
    assert "key poses walk straight ahead" in walker.note
    assert "key poses do not crouch" in walker.note
    walker.follow([Command(slow)])
    assert (walker.commanded, walker.note) == (Command(slow), "")


def test_key_poses_have_no_odometry(library):
    """Their steps are not measured, so nobody knows how far off it would be."""
    walker, backend = Walker(library), MockBackend(CONTROL_PERIOD_S)
    walker.keep_odometry()
    drive(walker, backend, 3)
    assert walker.place is None
    assert walker.odometry is None


def test_no_command_is_refused(library):
    with pytest.raises(CommandError, match="no command"):
        Walker(library, feedback=False).follow([])
