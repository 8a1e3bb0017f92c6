"""What drivers give to `Walker.step`, and what leaves it."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planned_library import planned_library

import gaitchain
from gaitchain.backends.mock import MockBackend
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.library_file import save_library
from gaitchain.messages import Command, JointTargets, Sensors
from gaitchain.robot.box_robot import JOINT_NAMES, box_legs, load_box_robot
from gaitchain.walker.target_check import TargetCheck
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
ODD_WALK = Path(__file__).parents[1] / "support" / "odd_walk.py"
ARRAYS = ("joint_position", "joint_velocity", "angular_velocity", "acceleration")
TICKS = 120


@pytest.fixture(scope="module")
def planned():
    return planned_library(RES)


def walk(walker, given, ticks=TICKS):
    """Walk on perfect servos whose driver gives its arrays in some manner."""
    backend, rows = MockBackend(walker.period_s), []
    backend.connect(walker.stand)
    walker.command(Command(0.3))
    for _ in range(ticks):
        sensors = backend.read()
        # What every manner can hold: numbers of single precision.
        exact = {n: np.float32(getattr(sensors, n)).astype(float) for n in ARRAYS}
        odd = {name: given(values) for name, values in exact.items()}
        targets = walker.step(replace(sensors, foot_load=[10, 20], **odd))
        assert targets.status == ""
        assert targets.position.dtype == np.float64
        rows.append(targets.position)
        backend.write(targets.position)
    return np.array(rows)


def read_only(values):
    values.setflags(write=False)
    return values


MANNERS = {
    "list": np.ndarray.tolist,
    "single": np.float32,
    "strided": lambda v: np.repeat(v, 2)[::2],
    "backward": lambda v: v[::-1].copy()[::-1],
    "read-only": read_only,
    "swapped": lambda v: v.astype(">f8"),
    "objects": lambda v: v.astype(object),
}


@pytest.mark.parametrize("given", MANNERS.values(), ids=MANNERS)
def test_any_array_of_numbers_gives_the_same_walk(planned, given):
    expected = walk(Walker(planned), np.copy)
    assert np.ptp(expected, axis=0).max() > 0.2
    np.testing.assert_array_equal(walk(Walker(planned), given), expected)


def test_whole_numbers_are_numbers(planned):
    still = [0] * 12
    one = Sensors(0, still, still, [0, 0, 0], [0, 0, 10])
    same = Sensors(0.0, *(np.array(getattr(one, n), dtype=float) for n in ARRAYS))
    targets = [Walker(planned).step(s).position for s in (one, same)]
    np.testing.assert_array_equal(*targets)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("joint_position", np.zeros(3), "joint_position has 3 values, needs 12: one "),
        ("joint_position", np.zeros(11), "one for each of left_hip_yaw, left_hip_roll"),
        ("joint_velocity", np.zeros((12, 1)), r"has shape \(12, 1\), needs 12"),
        ("joint_velocity", None, r"joint_velocity has shape \(\), needs 12"),
        ("angular_velocity", np.zeros(4), "4 values, needs 3: x, y, z in the trunk's"),
        ("acceleration", "a lot", "acceleration holds no numbers: 'a lot'"),
        ("foot_load", [1.0], "foot_load has 1 values, needs 2: left and right sole"),
        ("foot_load", 5.0, r"foot_load has shape \(\), needs 2"),
        ("time", "noon", "time is 'noon', must be seconds"),
    ],
)
def test_another_size_is_refused_and_changes_nothing(planned, name, value, message):
    walker, alone = Walker(planned), Walker(planned)
    backend = MockBackend(0.01)
    backend.connect(walker.stand)
    sensors = backend.read()
    walker.step(sensors)
    alone.step(sensors)
    with pytest.raises(CommandError, match=message):
        walker.step(replace(sensors, **{name: value}))
    np.testing.assert_array_equal(
        walker.step(sensors).position, alone.step(sensors).position
    )


@pytest.mark.parametrize(
    ("name", "huge", "lost"),
    [
        ("time", 10**400, np.nan),
        ("joint_position", [10**400] * 12, [np.nan] * 12),
        ("joint_velocity", [-(10**400), None, *[0] * 10], [np.nan] * 2 + [0] * 10),
        ("acceleration", [0, 0, 10**400], [0, 0, np.nan]),
        ("foot_load", [10**400, 1], [np.nan, 1]),
    ],
)
def test_a_number_beyond_all_floats_is_not_measured(planned, name, huge, lost):
    """As NaN is not: in the loop a measurement is replaced and not refused."""
    found = []
    for odd in (huge, lost):
        walker, backend = Walker(planned), MockBackend(0.01)
        backend.connect(walker.stand)
        sensors = backend.read()
        walker.step(sensors)
        found.append(walker.step(replace(sensors, **{name: odd})))
    assert found[0].status == found[1].status
    assert (name in found[0].status) == (name != "foot_load")
    np.testing.assert_array_equal(found[0].position, found[1].position)


def test_what_is_no_library_or_no_sensors_is_refused(planned):
    for odd in ("res", None):
        with pytest.raises(LibraryError, match="is no gait library; read one"):
            Walker(odd)
    with pytest.raises(CommandError, match=r"sensors: None: give gaitchain\.Sensors"):
        Walker(planned).step(None)


def test_sizes_are_those_of_the_robots_joints(planned):
    walker = Walker(planned, joint_names=JOINT_NAMES[::-1])
    with pytest.raises(CommandError, match=r"20 values, needs 12: .* right_ankle_roll"):
        backend = MockBackend(0.01)
        backend.connect(np.zeros(20))
        walker.step(backend.read())


def test_a_driver_may_fill_the_same_arrays_again(planned):
    """The last good measurement is the walker's own copy."""
    walker = Walker(planned)
    position = walker.stand
    still = np.zeros(12), np.zeros(3), np.array([0.0, 0.0, 9.81])
    good = walker.step(Sensors(0.0, position, *still)).position
    position[:] = np.nan
    targets = walker.step(Sensors(0.01, position, *still))
    assert targets.status == "no measurement in joint_position: last one used"
    np.testing.assert_allclose(targets.position, good, atol=1e-6)


def test_a_load_that_is_no_number_is_not_measured(planned):
    walker, without = Walker(planned), Walker(planned)
    backend = MockBackend(0.01)
    backend.connect(walker.stand)
    for load in ([np.nan, np.inf], (-np.inf, None)):
        sensors = backend.read()
        targets = walker.step(replace(sensors, foot_load=load)).position
        np.testing.assert_array_equal(targets, without.step(sensors).position)


@pytest.mark.parametrize(
    "period_s", [0.0, -0.01, np.nan, np.inf, "0.01", None, np.array([0.01]), 10**400]
)
def test_a_control_period_that_cannot_be_is_refused(planned, period_s):
    with pytest.raises(CommandError, match=r"^control period .*: need seconds above 0"):
        Walker(planned, period_s=period_s)


def test_a_control_period_has_to_be_half_of_a_rise_or_fall(planned):
    timing = planned.timing
    most = 0.5 * min(timing.rise, timing.fall)
    assert Walker(planned, period_s=most).period_s == most
    with pytest.raises(CommandError, match=r"control period .* at most 0\.\d+ s"):
        Walker(planned, period_s=1.001 * most)


@pytest.mark.parametrize("policy", ["lookahead", "", None])
def test_a_policy_that_is_none_is_refused(planned, policy):
    with pytest.raises(CommandError, match="it must be look_ahead or greedy"):
        Walker(planned, policy)


def test_what_leaves_is_finite_and_in_range():
    full = box_legs(RES.reduced)
    check = TargetCheck(full, full.stand)
    good = JointTargets(JOINT_NAMES, full.stand + 0.1)
    assert check.kept(good) is good
    beyond = full.stand.copy()
    beyond[[1, 3]] = -9.0, 9.0
    kept = check.kept(JointTargets(JOINT_NAMES, beyond, "soles unknown"))
    assert kept.status == ("soles unknown; left_hip_roll, left_knee kept within range")
    assert kept.position[1] == full.lower[1]
    assert kept.position[3] == full.upper[3]
    rest = np.delete(np.arange(12), [1, 3])
    np.testing.assert_array_equal(kept.position[rest], full.stand[rest])
    lost = np.where(np.arange(12) == 4, np.nan, full.stand)
    again = check.kept(JointTargets(JOINT_NAMES, lost))
    assert again.status == "no target for left_ankle_pitch: last ones used"
    np.testing.assert_array_equal(again.position, kept.position)


def test_a_walker_whose_state_is_lost_sends_the_last_targets(planned):
    walker = Walker(planned)
    backend = MockBackend(0.01)
    backend.connect(walker.stand)
    walker.command(Command(0.3))
    for _ in range(TICKS):
        before = walker.step(backend.read()).position
        backend.write(before)
    walk = walker.gait._walk
    walk.state = walk.state._replace(pelvis_yaw=np.nan)
    targets = walker.step(backend.read())
    assert "last ones used" in targets.status
    np.testing.assert_array_equal(targets.position, before)
    walker.reset()
    backend.connect(walker.stand)
    assert walker.step(backend.read()).status == ""


def test_stand_is_in_the_robots_order(planned):
    names = JOINT_NAMES[::-1]
    walker, own = Walker(planned, joint_names=names), Walker(planned)
    assert (walker.joint_names, own.joint_names) == (names, JOINT_NAMES)
    np.testing.assert_array_equal(walker.stand[::-1], own.stand)
    held = walker.standing_targets.position
    np.testing.assert_array_equal(held[::-1], own.standing_targets.position)
    np.testing.assert_allclose(held, walker.stand, atol=0.02)  # bears the weight
    backend = MockBackend(0.01)
    backend.connect(walker.stand)
    targets = walker.step(backend.read())
    np.testing.assert_allclose(targets.position, walker.stand, atol=0.02)


def test_a_walker_says_what_it_was_made_of(planned, tmp_path):
    path = str(tmp_path / "x.gait")
    size = gaitchain.save_library(planned, path)
    assert size == (tmp_path / "x.gait").stat().st_size
    walker = Walker.load(
        path, RES, "greedy", feedback=False, require_qualified=False, period_s=0.02
    )
    assert walker.period_s == 0.02
    assert walker.command_range == walker.library.command_range == planned.command_range
    assert walker.library.robot.name == RES.name
    assert walker.gait.generator.library is walker.library
    with pytest.raises(TypeError, match="feedbak"):
        Walker.load(path, feedbak=False)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["brisk", "library"])
def test_nothing_is_compiled_while_it_walks(kind, request, tmp_path):
    """In a fresh process, from the first step on, pushed, with all kinds of arrays."""
    path = tmp_path / "a.gait"
    save_library(request.getfixturevalue(kind), path)
    done = subprocess.run(
        [sys.executable, ODD_WALK, path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
