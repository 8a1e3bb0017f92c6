"""The walker on a library of strides: bad sensors, commands, standing, repeats."""

import copy
import math
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.backends.mock import MockBackend
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance import compiled
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.qualification import Qualification
from gaitchain.gait.schedule import Segment
from gaitchain.gait.zmp import Support
from gaitchain.messages import CONTROL_PERIOD_S, Command, Sensors
from gaitchain.robot.box_robot import JOINT_NAMES
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

FIELDS = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
SECOND = round(1.0 / CONTROL_PERIOD_S)


def physical(library, world=None):
    walker = Walker(library)
    backend = MujocoBackend(library.robot, world)
    backend.connect(walker.stand)
    return walker, backend


def drive(walker, backend, ticks):
    """Walk on; return the targets."""
    targets = []
    for _ in range(ticks):
        targets.append(walker.step(backend.read()).position)
        backend.write(targets[-1])
    return np.array(targets)


def feet(backend):
    """Right ankle from the left one, ahead, to the left and turned."""
    left, right = backend.foot_positions()
    yaws = backend.foot_yaws()
    c, s = np.cos(yaws[0]), np.sin(yaws[0])
    x, y, _ = right - left
    return c * x + s * y, c * y - s * x, yaws[1] - yaws[0]


def test_an_unqualified_library_is_refused(brisk):
    with pytest.raises(LibraryError, match="not qualified"):
        Walker(replace(brisk, qualification=Qualification()))


def test_no_command_is_refused(brisk):
    with pytest.raises(CommandError, match="no command"):
        Walker(brisk).follow([])


def test_without_a_command_nothing_moves(brisk):
    """Five seconds in physics: the soles stay where they are."""
    walker, backend = physical(brisk)
    drive(walker, backend, SECOND // 2)
    before = backend.foot_positions()
    for _ in range(5 * SECOND):
        backend.write(walker.step(backend.read()).position)
        assert walker.standing
        assert np.abs(backend.foot_positions() - before).max() < 5e-4
    assert walker.gait.steps == 0
    assert np.degrees(np.abs(backend.tilt)).max() < 1.0


@pytest.mark.parametrize(
    "command", [Command(0.3), Command(-0.1), Command(0.0, 0.04), Command(0.1, 0.0, 0.1)]
)
def test_it_stops_with_the_feet_side_by_side(brisk, command):
    walker, backend = physical(brisk)
    drive(walker, backend, SECOND)
    assert walker.command(command) == command
    drive(walker, backend, 3 * SECOND)
    assert not walker.standing
    assert walker.gait.steps >= 3
    walker.command(Command())
    drive(walker, backend, 4 * SECOND)
    assert walker.standing
    ahead, aside, turn = feet(backend)
    leg, width = brisk.robot.reduced.leg_length, brisk.robot.reduced.hip_width
    assert abs(ahead) < 0.05 * leg
    assert abs(aside + width) < 0.05 * leg
    assert abs(turn) < 0.1


def test_from_full_speed_it_stands_with_its_feet_side_by_side_at_once(brisk):
    """One shorter step before the last: no stand with a foot ahead, to be put right."""
    walker, backend = physical(brisk)
    drive(walker, backend, SECOND)
    walker.command(Command(brisk.command_range.vx[1]))
    drive(walker, backend, 4 * SECOND)
    walker.command(Command())
    steps = walker.gait.steps
    for _ in range(3 * SECOND):
        drive(walker, backend, 1)
        if walker.standing:
            break
    assert walker.standing
    assert walker.gait.steps - steps <= 3
    assert abs(feet(backend)[0]) < 0.05 * brisk.robot.reduced.leg_length
    before = walker.gait.steps
    drive(walker, backend, 2 * SECOND)
    assert walker.standing
    assert walker.gait.steps == before


def test_it_starts_again_after_a_stop(brisk):
    walker, backend = physical(brisk)
    for command in (Command(0.2), Command(), Command(-0.1), Command()):
        walker.command(command)
        before = walker.gait.steps
        drive(walker, backend, 4 * SECOND)
        assert walker.standing == command.stops
        assert command.stops or walker.gait.steps > before + 3
    assert not backend.fallen


def test_steps_are_measured_from_the_foot_as_it_was_put_down(brisk, monkeypatch):
    """On slippery ground it turns under the swing leg; MuJoCo knows by how much."""
    walker, backend = physical(brisk, World(friction=0.4))
    steps, advance = [], walker.gait.generator.advance

    def noted(state, command, made=None, **told):
        if made is not None:
            poses = backend.foot_positions()[:, :2], backend.foot_yaws()
            steps.append((made, 1 - state.left_support, *poses))
        return advance(state, command, made=made, **told)

    monkeypatch.setattr(walker.gait.generator, "advance", noted)
    drive(walker, backend, SECOND)
    walker.command(Command(0.8 * brisk.command_range.vx[1]))
    drive(walker, backend, 8 * SECOND)
    off, slips = [], []
    for (_, _, places, yaws), (made, new, later, turned) in pairwise(steps):
        old = 1 - new
        c, s = np.cos(yaws[old]), np.sin(yaws[old])
        x, y = later[new] - places[old]
        truth = c * x + s * y, c * y - s * x, turned[new] - yaws[old]
        off.append(np.array([made.ahead, made.left, made.turn]) - truth)
        slips.append(turned[old] - yaws[old])
    assert len(off) > 10
    assert np.abs(slips).mean() > 0.01
    assert (np.abs(np.mean(off, axis=0)) < [0.0015, 0.0015, 0.005]).all()


def test_the_support_foot_alternates(brisk):
    walker, backend = physical(brisk)
    walker.command(Command(0.2))
    seen = []
    for _ in range(4 * SECOND):
        drive(walker, backend, 1)
        if not walker.standing and (not seen or walker.gait.support != seen[-1]):
            seen.append(walker.gait.support)
    cycle = [
        Support.LEFT_SINGLE,
        Support.LEFT_TO_RIGHT,
        Support.RIGHT_SINGLE,
        Support.RIGHT_TO_LEFT,
    ]
    start = cycle.index(seen[1])
    assert len(seen) > 8
    for i, support in enumerate(seen[1:]):
        assert support == cycle[(start + i) % 4]


def test_the_panel_and_the_decision_follow_the_key_moments(brisk):
    walker, backend = physical(brisk)
    walker.command(Command(0.2))
    moments, layers = [], []
    for _ in range(3 * SECOND):
        drive(walker, backend, 1)
        if walker.gait.panel and (
            not moments or walker.gait.panel.key_moment != moments[-1]
        ):
            moments.append(walker.gait.panel.key_moment)
            layers.append(walker.decision.layer)
    assert moments[:6] == ["kp_2", "kp_3", "kp_4"] * 2
    assert layers[:6] == [1, 2, 3] * 2
    assert {*walker.gait.panel.frontal, *walker.gait.panel.sagittal} == set(JOINT_NAMES)
    assert walker.gait.panel.duration_s > 0.0


def test_reset_walks_the_same_again(brisk):
    walker, backend = physical(brisk, World(noise=1.0, seed=5))
    walker.command(Command(0.2, 0.01, 0.05))
    first = drive(walker, backend, 3 * SECOND)
    walker.reset()
    assert walker.standing
    assert walker.gait.steps == 0
    backend.connect(walker.stand)
    again = drive(walker, backend, 3 * SECOND)
    np.testing.assert_array_equal(first, again)


def test_two_walkers_share_nothing(brisk):
    """Taking turns, each walks as it does alone."""
    commands = Command(0.3), Command(-0.1, 0.0, 0.05)
    alone = []
    for command in commands:
        walker, backend = physical(brisk)
        walker.command(command)
        alone.append(drive(walker, backend, 2 * SECOND))
    pairs = [physical(brisk) for _ in commands]
    together = [[], []]
    for (walker, _), command in zip(pairs, commands, strict=True):
        walker.command(command)
    for _ in range(2 * SECOND):
        for (walker, backend), targets in zip(pairs, together, strict=True):
            targets.append(drive(walker, backend, 1)[0])
    np.testing.assert_array_equal(alone, together)


def test_targets_given_out_are_not_changed_later(brisk):
    walker, backend = physical(brisk)
    walker.command(Command(0.2))
    kept, copies = [], []
    for _ in range(2 * SECOND):
        target = walker.step(backend.read()).position
        kept.append(target)
        copies.append(target.copy())
        backend.write(target)
    np.testing.assert_array_equal(kept, copies)


def test_a_command_in_mid_step_counts_from_the_next_step_on(brisk):
    """Until then the targets are as if it had not been given."""
    paths, steps = [], []
    for later in (Command(0.3), Command()):
        walker, backend = physical(brisk)
        walker.command(Command(0.3))
        path, begun = [], []
        given = None
        for tick in range(4 * SECOND):
            if given is None and walker.gait.steps == 2:
                walker.command(later)
                given = tick
            path.append(drive(walker, backend, 1)[0])
            begun.append(walker.gait.steps)
        paths.append(np.array(path))
        steps.append(np.array(begun))
    changed = int(np.argmax(np.any(paths[0] != paths[1], axis=1)))
    assert changed > 0
    assert steps[0][changed - 1] == 2
    assert steps[0][changed] == 3


def test_one_command_per_step_and_the_last_one_stays(brisk):
    walker, backend = physical(brisk)
    step_s = brisk.timing.step
    walker.follow([Command(0.1), Command(0.3), Command(0.2)])
    asked = {}
    for _ in range(5 * SECOND):
        drive(walker, backend, 1)
        if walker.gait.steps:
            asked.setdefault(walker.gait.steps, walker.gait.state.asked[0] / step_s)
    seen = [asked[i + 1] for i in range(5)]
    assert seen == pytest.approx([0.1, 0.3, 0.2, 0.2, 0.2])


def test_a_stop_among_commands_is_stood_on_for_a_step(brisk):
    """It stood there for ever, with three commands left."""
    walker, backend = physical(brisk)
    walker.follow([Command(0.2), Command(0.2), Command(), Command(0.2), Command()])
    stood = []
    for _ in range(8 * SECOND):
        backend.write(walker.step(backend.read()).position)
        stood.append(walker.standing)
    begins = [i for i, (a, b) in enumerate(pairwise(stood)) if b and not a]
    leaves = [i for i, (a, b) in enumerate(pairwise(stood)) if a and not b]
    step = round(brisk.timing.step / CONTROL_PERIOD_S)
    assert (len(begins), len(leaves)) == (2, 1)
    assert leaves[0] - begins[0] == pytest.approx(step, abs=1)
    assert walker.gait.steps == 5
    assert walker.commanded == Command()


def test_stops_before_a_walk_take_a_step_each(brisk):
    walker, backend = physical(brisk)
    drive(walker, backend, SECOND)
    walker.follow([Command(), Command(crouch=0.005), Command(0.2)])
    step = round(brisk.timing.step / CONTROL_PERIOD_S)
    drive(walker, backend, step - 1)
    assert walker.commanded == Command()
    drive(walker, backend, step)
    assert walker.commanded == Command(crouch=0.005)
    assert walker.standing
    drive(walker, backend, 1)
    assert walker.commanded == Command(0.2)
    assert not walker.standing
    drive(walker, backend, 2 * SECOND)
    assert walker.commanded == Command(0.2)


def test_a_command_out_of_range_is_noted(brisk):
    walker = Walker(brisk)
    most = brisk.command_range.vx[1]
    done = walker.command(Command(3.0 * most))
    assert done.vx == pytest.approx(most)
    assert "3 of what the library walks" in walker.note
    walker.follow([Command(3.0 * most), Command(0.5 * most), Command(3.0 * most)])
    assert walker.note.count("3 of what") == 1
    assert walker.command(Command(0.5 * most)) == Command(0.5 * most)
    assert walker.note == ""
    for absurd in (1e308, -1e308, 1e7, -math.inf):
        assert walker.command(Command(absurd)) == Command()
        assert "is no command: stop" in walker.note
    assert walker.command(Command(float("nan"))) == Command()
    assert walker.note


def spoilt(sensors, field, value, index):
    array = np.array(getattr(sensors, field))
    array[index % len(array)] = value
    return replace(sensors, **{field: array})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", FIELDS)
def test_a_bad_number_is_replaced_and_said(brisk, field, value):
    """One period in ten has one: the robot walks on."""
    walker, backend = physical(brisk)
    walker.command(Command(0.2))
    for tick in range(4 * SECOND):
        sensors, bad = backend.read(), tick % 10 == 5
        if bad:
            sensors = spoilt(sensors, field, value, tick // 10)
        targets = walker.step(sensors)
        assert np.isfinite(targets.position).all()
        assert (field in targets.status) == bad
        assert bool(targets.status) == bad
        backend.write(targets.position)
    assert not backend.fallen
    assert walker.gait.steps >= 5


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("rate", [12.0, 30.0, 300.0, -999.0])
def test_one_sample_of_the_gyro_fells_no_robot(brisk, rate, axis):
    """Oracle: where the robot walks without it."""
    ends = []
    for spoils in (False, True):
        walker, backend = physical(brisk)
        for tick in range(6 * SECOND):
            if tick == SECOND:
                walker.command(Command(0.3))
            sensors = backend.read()
            if spoils and tick in (50, 3 * SECOND):
                sensors = spoilt(sensors, "angular_velocity", rate, axis)
            targets = walker.step(sensors)
            spoilt_now = spoils and tick in (50, 3 * SECOND)
            assert ("angular_velocity" in targets.status) == spoilt_now
            backend.write(targets.position)
        assert not backend.fallen
        ends.append(walker.place)
    assert ends[1] == pytest.approx(ends[0], abs=0.01)


def test_a_punch_is_felt_one_sample_later(brisk):
    """From one period to the next the trunk turns by 8 rad/s more, and goes on."""
    walker, backend = physical(brisk)
    seen = []
    for tick in range(20):
        sensors = backend.read()
        if tick >= 10:
            sensors = spoilt(sensors, "angular_velocity", 11.0 - 0.3 * tick, 1)
        seen.append((walker.step(sensors).status, walker.gait.estimate.pitch_rate))
    told, rates = zip(*seen, strict=True)
    replaced = ["angular_velocity" in text for text in told]
    assert replaced == [tick == 10 for tick in range(20)]
    assert abs(rates[10]) < 0.1
    assert rates[11] == pytest.approx(7.7, abs=0.1)


@pytest.mark.parametrize(
    "clock",
    [
        lambda t: t,
        lambda t: 0.0,
        lambda t: t + 100.0 * (t > 2.5),
        lambda t: t - 100.0 * (t > 2.5),
        lambda t: np.nan if 2.0 < t < 2.5 else t,
        lambda t: np.inf,
    ],
    ids=["sound", "stands", "ahead", "back", "gap", "none"],
)
def test_a_drivers_clock_chooses_no_step(brisk, clock):
    """It stood still by itself after a NaN, or made ever shorter steps."""
    walks = []
    for shown in (float, clock):
        walker, backend, rows = Walker(brisk), MockBackend(CONTROL_PERIOD_S), []
        backend.connect(walker.stand)
        walker.command(Command(0.2, 0.0, 0.1))
        for tick in range(5 * SECOND):
            time = shown(tick * CONTROL_PERIOD_S)
            targets = walker.step(replace(backend.read(), time=time))
            assert ("time" in targets.status) == (not np.isfinite(time))
            backend.write(targets.position)
            rows.append(targets.position)
        walks.append(np.array(rows))
        assert not walker.standing
    np.testing.assert_array_equal(*walks)


def test_sensors_that_never_work_let_it_walk_on(brisk):
    """The plan goes on over what was last known: here, nothing at all."""
    walker, nothing = Walker(brisk), np.full(12, np.nan)
    sensors = Sensors(0.0, nothing, nothing, nothing[:3], nothing[:3])
    walker.command(Command(0.2))
    for _ in range(3 * SECOND):
        targets = walker.step(sensors)
        assert np.isfinite(targets.position).all()
        assert all(field in targets.status for field in FIELDS)
    assert walker.gait.steps >= 3


@settings(
    max_examples=30,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(FIELDS),
            st.floats(allow_nan=True, allow_infinity=True, width=32),
            st.integers(0, 11),
        ),
        max_size=40,
    ),
    st.integers(0, 2**32 - 1),
)
def test_whatever_is_measured_targets_are_numbers(brisk, faults, seed):
    rng = np.random.default_rng(seed)
    walker = Walker(brisk)
    backend = MockBackend(CONTROL_PERIOD_S)
    backend.connect(walker.stand)
    walker.command(Command(0.2, 0.0, 0.1))
    due = dict(zip(rng.integers(0, 3 * SECOND, len(faults)), faults, strict=True))
    for tick in range(3 * SECOND):
        sensors = backend.read()
        if tick in due:
            sensors = spoilt(sensors, *due[tick])
        target = walker.step(sensors).position
        assert np.isfinite(target).all(), f"tick {tick}"
        backend.write(target)


@pytest.mark.parametrize(
    "field",
    [
        "joint_position",
        "joint_velocity",
        "angular_velocity",
        "acceleration",
    ],
)
def test_open_loop_nothing_is_felt(brisk, field):
    """Without feedback the plan alone is sent: no sensor changes a target."""
    rng = np.random.default_rng(0)
    paths = []
    for noise in (0.0, 0.1):
        walker = Walker(brisk, feedback=False)
        backend = MockBackend(CONTROL_PERIOD_S)
        backend.connect(walker.stand)
        walker.command(Command(0.2, 0.01, 0.1))
        path = []
        for _ in range(4 * SECOND):
            sensors = backend.read()
            array = getattr(sensors, field)
            wrong = array + rng.normal(0.0, noise, array.shape)
            path.append(walker.step(replace(sensors, **{field: wrong})).position)
            backend.write(path[-1])
        paths.append(np.array(path))
    np.testing.assert_array_equal(*paths)


@pytest.mark.parametrize(
    "values", [[np.inf, -np.inf, *[0.0] * 10], [1.7e308] * 12], ids=["inf", "large"]
)
def test_numbers_that_do_not_add_up_raise_no_warning(brisk, values):
    """Infinities of both signs, and finite ones whose sum is infinite."""
    walker, backend = physical(brisk)
    sensors = replace(backend.read(), joint_velocity=np.array(values))
    targets = walker.step(sensors)
    assert "joint_velocity" in targets.status
    assert np.isfinite(targets.position).all()


def test_who_fell_and_is_up_goes_on_from_where_it_was(brisk):
    """By its place the robot was turned as it lay; the world knows of no turn."""
    walker, backend = physical(brisk)
    walker.keep_odometry()
    drive(walker, backend, SECOND)
    walker.command(Command(0.3, 0.0, 0.3))
    drive(walker, backend, 4 * SECOND)
    before = walker.place
    assert before.x > 0.5 and before.yaw > 0.5
    sensors, turning = backend.read(), np.array([0.0, 0.0, 1.0])
    for _ in range(SECOND):
        walker.lie(replace(sensors, angular_velocity=turning))
    walker.command(Command())
    walker.reset(fell=True)
    here, odometry = walker.place, walker.odometry
    assert here[:2] == pytest.approx(before[:2])
    assert here.yaw == pytest.approx(before.yaw + 1.0, abs=0.1)
    assert odometry.attitude[2] == pytest.approx(here.yaw)
    assert np.hypot(*np.subtract(odometry.place[:2], here[:2])) < 0.1
    left, right = walker.feet
    assert left.seen_from(here).y == pytest.approx(-right.seen_from(here).y)
    backend.connect(walker.stand)
    drive(walker, backend, SECOND)
    goal = here.moved(0.4, 0.0)
    walker.go_to(goal)
    drive(walker, backend, 5 * SECOND)
    off = goal.seen_from(walker.place)
    assert np.hypot(off.x, off.y) < 0.03 and abs(off.yaw) < 0.05
    moved = backend.data.qpos[:2]
    np.testing.assert_allclose(moved, [0.4, 0.0], atol=0.1)  # straight ahead of it
    walker.reset()
    assert walker.place == (0.0, 0.0, 0.0)
    assert walker.odometry.distance == 0.0


def test_a_gyro_that_is_lost_as_it_lies_leaves_the_heading(brisk):
    walker, backend = physical(brisk)
    drive(walker, backend, SECOND)
    before, nothing = walker.place, np.full(3, np.nan)
    for _ in range(SECOND):
        walker.lie(replace(backend.read(), angular_velocity=nothing))
    walker.reset(fell=True)
    assert walker.place == before


def test_with_feedback_a_tilt_changes_the_targets(brisk):
    paths = []
    for rate in (0.0, 0.3):
        walker = Walker(brisk)
        backend = MockBackend(CONTROL_PERIOD_S)
        backend.connect(walker.stand)
        walker.command(Command(0.2))
        path = []
        for tick in range(2 * SECOND):
            sensors = backend.read()
            if tick > 1.5 * SECOND:
                sensors = replace(sensors, angular_velocity=np.array([rate, 0.0, 0.0]))
            path.append(walker.step(sensors).position)
            backend.write(path[-1])
        paths.append(np.array(path))
    assert np.abs(paths[0] - paths[1]).max() > 1e-3


def test_the_record_of_a_walk_has_its_plan(brisk):
    """The loop records planned ZMPs while stepping and none while standing."""
    walker = Walker(brisk)
    record = run_schedule(
        walker, MujocoBackend(brisk.robot), (Segment(Command(0.2), 3.0),)
    )
    standing = record.support == "stand"
    assert np.isnan(record.planned_zmp[standing]).all()
    assert np.isfinite(record.planned_zmp[~standing]).all()
    assert record.fell_at_s is None


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda walker: pickle.loads(pickle.dumps(walker))]
)
def test_a_copy_walks_on_alike_and_by_itself(brisk, copied):
    """Sensors are those of the one that walks; nothing is compiled for the other."""
    walker, backend = physical(brisk)
    walker.command(Command(0.1))
    drive(walker, backend, 120)
    other = copied(walker)
    known = [len(function.signatures) for function in compiled._functions]
    for _ in range(150):
        sensors = backend.read()
        position = walker.step(sensors).position
        np.testing.assert_array_equal(other.step(sensors).position, position)
        backend.write(position)
    drive(walker, backend, 20)
    assert walker.place != other.place, "it walks on alone"
    twin, sensors = copied(other), backend.read()
    for one in twin, other:
        one.reset()
    position = twin.step(sensors).position
    np.testing.assert_array_equal(other.step(sensors).position, position)
    assert known == [len(function.signatures) for function in compiled._functions]
