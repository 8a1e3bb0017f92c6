"""A library of strides: its file, its range of commands, and what it is not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from other_robots import resized

from gaitchain.errors import LibraryError
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.library_file import library_bytes, load_library, save_library
from gaitchain.gait.stride.family import STRIDES
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.walker.stride_generator import StrideGenerator

SHARED = settings(
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def data(brisk):
    return library_bytes(brisk)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stride_library")


def loaded(folder, content):
    path = folder / "some.gait"
    path.write_bytes(content)
    return load_library(path)


def test_the_file_gives_the_library_back(brisk, folder, data):
    assert save_library(brisk, folder / "brisk.gait") == len(data)
    again = load_library(folder / "brisk.gait", brisk.robot)
    assert isinstance(again.poses, StridePoses)
    assert again.family is STRIDES
    assert again.poses.hip_height == brisk.poses.hip_height
    assert again.command_range == brisk.command_range
    assert again.qualification == brisk.qualification
    for one, two in zip(again.poses.parameters, brisk.poses.parameters, strict=True):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(again.allowed_pairs, brisk.allowed_pairs)
    assert library_bytes(again) == data


def test_the_stance_is_kept(brisk, folder):
    closer = replace(brisk.poses, stance=0.9 * brisk.poses.stance)
    save_library(replace(brisk, poses=closer), folder / "closer.gait")
    assert load_library(folder / "closer.gait").poses.stance == closer.stance


def test_the_same_library_gives_the_same_choices(brisk, folder, data):
    again = loaded(folder, data)
    np.testing.assert_array_equal(again.gait_of, brisk.gait_of)


@SHARED
@given(st.data())
def test_a_changed_byte_is_refused_or_changes_nothing(folder, data, draw):
    header = 8 + int.from_bytes(data[:8], "little")
    place = draw.draw(st.integers(0, header - 1) | st.integers(0, len(data) - 1))
    value = draw.draw(st.integers(0, 255).filter(lambda v: v != data[place]))
    changed = data[:place] + bytes([value]) + data[place + 1 :]
    try:
        again = loaded(folder, changed)
    except LibraryError:
        return
    assert place < header
    assert library_bytes(again) == data


@SHARED
@given(st.floats(0.0, 1.0, exclude_max=True))
def test_a_truncated_file_is_refused(folder, data, part):
    with pytest.raises(LibraryError):
        loaded(folder, data[: int(part * len(data))])


def test_strides_of_another_shape_are_refused(brisk, folder):
    """Written with a checksum of its own, but short of a candidate."""
    poses = brisk.poses.keep(
        [np.arange(n - (layer == 1)) for layer, n in enumerate(brisk.poses.counts)]
    )
    with pytest.raises(LibraryError, match="inconsistent"):
        loaded(folder, library_bytes(replace(brisk, poses=poses)))


def test_another_robot_is_refused(brisk, folder, data):
    (folder / "other.gait").write_bytes(data)
    heavier = resized(brisk.robot, trunk_mass=20.0, name="Heavy")
    with pytest.raises(LibraryError, match="trunk_mass 16 / 20"):
        load_library(folder / "other.gait", heavier)


def test_it_has_none_of_the_papers_poses(brisk, library):
    with pytest.raises(LibraryError, match="walks by strides"):
        brisk.poses_as(KeyPoses)
    assert library.poses_as(KeyPoses) is library.poses
    assert library.family is KEY_POSES
    with pytest.raises(LibraryError, match="needs strides"):
        StrideGenerator(library)


def cycles(library):
    """All cycles of two steps that physics passed, their motion per second."""
    strides, step_s = library.poses.strides, library.timing.step
    passed = (library.pair_runs > 0) & (library.pair_passes == library.pair_runs)
    for first in range(len(strides)):
        for second in range(len(strides)):
            if STAND in (first, second):
                continue
            if passed[first, second] and passed[second, first]:
                one, two = strides[first], strides[second]
                yield (
                    one,
                    two,
                    np.array([one[0] + two[0], one[1] - two[1], one[2] - two[2]])
                    / (2.0 * step_s),
                )


def expected_range(library):
    """Least and most per axis, of cycles that go along that axis alone."""
    ends = []
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        speeds = [
            motion[axis]
            for one, two, motion in cycles(library)
            if not one[others].any() and not two[others].any()
        ]
        ends.append((min(speeds), max(speeds)) if speeds else (0.0, 0.0))
    return ends


def assert_range(library):
    span = library.command_range
    np.testing.assert_allclose(
        (span.vx, span.vy, span.yaw_rate), expected_range(library)
    )


def test_the_command_range_is_that_of_the_cycles(brisk):
    assert_range(brisk)
    span = brisk.command_range
    assert span.vy[0] == pytest.approx(-span.vy[1])
    assert span.yaw_rate[0] == pytest.approx(-span.yaw_rate[1])
    assert brisk.speed_range == (0.0, span.vx[1])


@SHARED
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_the_command_range_follows_the_verdicts(brisk, seed, share):
    """Whatever falls is out: of the pairs that are left, the range is the same rule."""
    rng = np.random.default_rng(seed)
    held = rng.random(brisk.pair_runs.shape) < share
    verdicts = replace(
        brisk,
        pair_runs=np.ones_like(brisk.pair_runs),
        pair_passes=held.astype(np.int64),
        steady=None,  # what long walks held has a word of its own
    )
    np.testing.assert_array_equal(verdicts.allowed_pairs, held)
    assert_range(verdicts)


@pytest.mark.parametrize(
    ("ends", "backward", "sideways"),
    [
        (
            (-0.05, -0.02, 0.04),
            "to 0.050 m/s",
            "to 0.040 m/s to the left, to 0.020 m/s to the right",
        ),
        ((-0.05, -0.02, 0.02), "to 0.050 m/s", "to 0.020 m/s"),
        ((0.0, 0.0, 0.0), *2 * ("not at all, as no such walk held",)),
    ],
)
def test_it_says_how_fast_it_goes_each_way(brisk, ends, backward, sideways):
    back, *aside = ends
    steady = replace(brisk.command_range, vx=(back, 0.2), vy=tuple(aside))
    told = dict(replace(brisk, steady=steady).describe())
    assert (told["backward"], told["sideways"]) == (backward, sideways)


def test_a_step_that_was_never_walked_is_not_allowed(brisk):
    runs = np.array(brisk.pair_runs)
    runs[1, 2] = 0
    passes = np.minimum(brisk.pair_passes, runs)
    assert not replace(brisk, pair_runs=runs, pair_passes=passes).allowed_pairs[1, 2]


def test_physics_measured_what_the_strides_promise(brisk):
    """Of two steps that repeat, the advance is near the strides' lengths."""
    allowed, lengths = brisk.allowed_pairs, brisk.poses.step_lengths
    steady = [i for i in range(1, len(lengths)) if allowed[i, i]]
    assert len(steady) > 3
    measured = [brisk.pair_advance[i, i] for i in steady]
    slope = np.polyfit(lengths[steady], measured, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.3)
