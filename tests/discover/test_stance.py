"""The standing pose of robots whose joints allow few, and what is said of it."""

import mujoco
import pytest
from toy_file import toy

from gaitchain.discover.find import find
from gaitchain.discover.profile import parse_profile
from gaitchain.errors import RobotFileError

STRAIGHT, BELOW = 0.4, 0.05  # the toy's leg, and its sole below the ankle [m]


def stance_of(ankle, **stand):
    """The toy with a range of ankle pitch, and what a profile says of its stance."""
    text = toy().replace('range="-1.2 1.2"', f'range="{ankle}"')
    model = mujoco.MjModel.from_xml_string(text)
    return find(model, "toy", parse_profile({"stand": stand}, "p.toml"))


def refusal(ankle, **stand):
    with pytest.raises(RobotFileError, match="no standing pose") as caught:
        stance_of(ankle, **stand)
    return str(caught.value)


@pytest.mark.parametrize(("ankle", "share"), [("-0.38 0.7", 0.96), ("-0.28 0.7", 0.98)])
def test_ankles_that_pitch_little_stand_nearly_straight(ankle, share):
    found = stance_of(ankle)
    assert found.hip_height == pytest.approx(share * STRAIGHT + BELOW)
    assert found.stand["left_knee"] > 0.2


def test_wide_ranges_leave_the_stance_as_it_is():
    assert stance_of("-1.2 1.2").hip_height == pytest.approx(0.87 * STRAIGHT + BELOW)


def test_hips_that_are_too_low_are_told_where_they_stand():
    message = refusal("-0.38 0.7", hip_height=0.36)
    assert "at best, with the hips 0.36 m high" in message
    assert (
        "at the end of the range of 2 joints (left_ankle, -21.8 to 40.1 deg, "
        "right_ankle, -21.8 to 40.1 deg); it stands with higher hips, at 0.434 m"
    ) in message


def test_hips_that_are_too_high_are_told_where_they_stand():
    message = refusal("-1.2 1.2", hip_height=0.6)
    assert "it stands with lower hips, at 0.442 m" in message


def test_of_all_heights_the_best_one_is_told():
    """The last one that is tried is not always that."""
    message = refusal("-0.1 0.1")
    assert "at best, with the hips 0.442 m high, a sole is left with tilt " in message
    assert "left_ankle, -5.73 to 5.73 deg" in message
    assert "hips from 0.35 to 0.442 m were tried, higher ones may do" in message
