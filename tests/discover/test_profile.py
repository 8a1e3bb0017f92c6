"""The profile: what a person says about a robot, checked key by key."""

import pytest

from gaitchain.discover.profile import Profile, load_profile, parse_profile
from gaitchain.errors import RobotFileError

FULL = """
forward = [0, 2, 0]
up = [0, 0, 1]
[legs]
left = ["a", "b", "c", "d", "e"]
right = "right_foot"
[foot]
left = "left_foot"
[sole]
front = 0.1
rear = -0.05
half_width = 0.03
below = 0.04
[servo."*"]
stiffness = 100
[servo.a]
damping = 2.5
[stand]
hip_height = 0.5
[stand.angles]
arm = -0.3
"""


def test_every_key_is_read(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(FULL, encoding="utf-8")
    profile = load_profile(path)
    assert profile.forward == (0.0, 1.0, 0.0)
    assert profile.up == (0.0, 0.0, 1.0)
    assert profile.legs == {"left": ("a", "b", "c", "d", "e")}
    assert profile.foot == {"left": "left_foot", "right": "right_foot"}
    assert profile.sole["rear"] == -0.05
    assert profile.servo == {"*": {"stiffness": 100.0}, "a": {"damping": 2.5}}
    assert profile.angles == {"arm": -0.3}
    assert profile.hip_height == 0.5
    assert profile.origin == str(path)


def test_an_empty_profile_overrides_nothing():
    assert parse_profile({}, "profile") == Profile()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"forwards": [1, 0, 0]}, r"unknown key forwards; did you mean forward\?"),
        ({"legs": {"lefty": []}}, r"legs\.lefty; did you mean legs\.left\?"),
        ({"legs": {"left": ["a", "b"]}}, r"legs\.left: 2 joints; expected 5 to 7"),
        ({"legs": {"left": ["a"] * 6}}, "each once"),
        ({"legs": {"left": 3}}, r"legs\.left = 3: expected a list"),
        ({"foot": {"left": ["a"]}}, "expected a body's name"),
        ({"sole": {"front": -1}}, r"sole\.front = -1; allowed: 0\.001 to 1 m"),
        ({"sole": {"rear": float("nan")}}, r"sole\.rear = nan"),
        ({"sole": {"wide": 1}}, r"unknown key sole\.wide"),
        ({"sole": 3}, r"sole = 3: expected a table"),
        ({"servo": {"a": {"stiffness": True}}}, r"servo\.a\.stiffness = True"),
        ({"servo": {"a": {"armature": -1}}}, r"a\.armature = -1; allowed: 0 to 100"),
        ({"servo": {"a": 3}}, r"servo\.a = 3: expected a table"),
        ({"stand": {"hip_height": 9}}, r"allowed: 0\.02 to 3 m"),
        ({"stand": {"angles": {"a": "x"}}}, r"stand\.angles\.a = 'x'"),
        ({"forward": [0, 0, 0]}, "has no direction"),
        ({"up": [1, 0]}, r"expected \[x, y, z\]"),
    ],
)
def test_errors_name_key_value_and_what_is_allowed(table, words):
    with pytest.raises(RobotFileError, match=f"^p: .*{words}"):
        parse_profile(table, "p")


def test_missing_and_broken_files(tmp_path):
    with pytest.raises(RobotFileError, match="give a TOML file"):
        load_profile(tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("forward = [", encoding="utf-8")
    with pytest.raises(RobotFileError, match="not a TOML file"):
        load_profile(broken)
