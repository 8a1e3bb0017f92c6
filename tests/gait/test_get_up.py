"""Ways from lying to standing: what is played, and what a file may say."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitchain.errors import LibraryError
from gaitchain.gait.get_up import (
    GetUp,
    TimedPose,
    Way,
    load_get_up,
    save_get_up,
    way_targets,
)
from gaitchain.robot.box_robot import load_box_robot

PERIOD_S = 0.01
angles = st.floats(-3.0, 3.0)
poses = st.builds(TimedPose, st.floats(0.05, 2.0), st.tuples(angles, angles, angles))
ways = st.builds(
    Way, st.lists(poses, min_size=1, max_size=5).map(tuple), st.just(0), st.just(1)
)


def found(of, /, **changes):
    way = Way((TimedPose(0.5, (0.1, 0.2)), TimedPose(0.7, (0.0, 0.0))), 19, 20)
    values = {
        "robot": of.name,
        "fingerprint": of.fingerprint,
        "joint_names": ("left", "right"),
        "lying": (0.0, 0.0),
        "ways": {"front": way},
    }
    return GetUp(**{**values, **changes})


@given(ways, st.tuples(angles, angles, angles))
def test_targets_pass_through_each_pose_at_rest(way, start):
    targets = way_targets(way, np.array(start), PERIOD_S)
    ends = np.cumsum([max(round(p.seconds / PERIOD_S), 1) for p in way.poses])
    assert len(targets) == ends[-1]
    for end, pose in zip(ends, way.poses, strict=True):
        np.testing.assert_allclose(targets[end - 1], pose.angles, atol=1e-12)
    steps = np.abs(np.diff(np.vstack([start, targets]), axis=0))
    for end, ticks, before, pose in zip(
        ends,
        np.diff(ends, prepend=0),
        [start, *(p.angles for p in way.poses)],
        way.poses,
        strict=False,
    ):
        far = np.abs(np.subtract(pose.angles, before))
        # The cubic is fastest in its middle, 3/2 of the mean, and rests at its ends.
        assert (steps[end - ticks : end] <= 1.5 * far / ticks + 1e-12).all()
        assert (steps[end - 1] <= 3.0 * far / ticks**2 + 1e-12).all()


def test_a_file_gives_back_what_was_saved(tmp_path):
    robot = load_box_robot("res")
    save_get_up(found(robot), tmp_path / "res.getup")
    assert load_get_up(tmp_path / "res.getup", robot) == found(robot)
    assert found(robot).ways["front"].seconds == pytest.approx(1.2)


def test_what_is_of_another_robot_is_refused(tmp_path):
    robot = load_box_robot("res")
    save_get_up(found(robot, fingerprint="0" * 64, robot="ant"), tmp_path / "a.getup")
    with pytest.raises(LibraryError, match=r"another robot \(ant\), the library is of"):
        load_get_up(tmp_path / "a.getup", robot)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"lying": [0.0]}, "a pose has 1 joints, not 2"),
        ({"lying": [0.0, 99.0]}, "lying"),
        ({"ways": {"side": {}}}, "side"),
        ({"ways": {"front": {"poses": [], "stood": 0, "starts": 1}}}, "poses"),
        ({"extra": 1}, "extra"),
        ({"joint_names": 5}, "joint_names"),
        ({"joint_names": ["a", "a"]}, "joint_names has a more than once"),
    ],
)
def test_a_file_with_wrong_values_says_which(tmp_path, change, reason):
    robot, file = load_box_robot("res"), tmp_path / "res.getup"
    save_get_up(found(robot), file)
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(LibraryError, match=r"no file of `gaitchain get-up`") as caught:
        load_get_up(file, robot)
    assert reason in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "\x00\xff", '{"robot": "res"}'])
def test_a_file_that_is_none_is_refused(tmp_path, text):
    (tmp_path / "a.getup").write_text(text)
    with pytest.raises(LibraryError, match="no file of"):
        load_get_up(tmp_path / "a.getup", load_box_robot("res"))
    with pytest.raises(LibraryError, match="cannot be read"):
        load_get_up(tmp_path / "missing", load_box_robot("res"))
