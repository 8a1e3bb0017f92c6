"""What docs/add_your_robot.md promises: its profile, its code, and every message."""

import re
import tomllib
from pathlib import Path

import pytest
from commands import call
from planned_library import planned_library
from toy_file import JOINTS, toy
from toy_urdf import toy_urdf

from gaitchain.discover.loaded_robot import load_robot
from gaitchain.discover.profile import parse_profile
from gaitchain.errors import CommandError
from gaitchain.gait.library_file import save_library
from gaitchain.walker.walker import Walker

PAGE = (Path(__file__).parents[2] / "docs" / "add_your_robot.md").read_text("utf-8")
SMOOTH = " ".join(PAGE.split())
ARM = (
    '<mujoco><worldbody><body name="base"><joint name="a"/><geom size=".1"/><body>'
    '<joint name="b"/><geom size=".1"/></body></body></worldbody></mujoco>'
)
MESH = (
    '<asset><mesh name="m" file="torso.stl"/></asset><worldbody>',
    '<freejoint/><geom type="mesh" mesh="m" mass="1"/>',
)
SOLE = 'type="box" size="0.09 0.05 0.01" pos="0.02 0 -0.04"'
KNEE = 'name="left_knee" axis="0 1 0"'
INERTIAL = '<inertial mass="0.3" pos="0 0 0" diaginertia="3e-4 3e-4 3e-4"/>'
LEG = ", ".join(f'"left_{j}"' for j in JOINTS).replace("knee", "kne")
FILES = {
    "arm.xml": lambda t: ARM,
    "bare.urdf": lambda t: toy_urdf(weighs=lambda name, mass: None),
    "fused.xml": lambda t: (
        re.sub(r'<body name="torso".*?(?=<body name="left1")', "", t, flags=re.S)
        .replace("</body></worldbody>", "</worldbody>")
        .partition("<actuator>")[0]
        + "</mujoco>"
    ),
    "nan.xml": lambda t: t.replace('"2e-4 2e-4 2e-4"', '"nan 2e-4 2e-4"', 1),
    "mesh.xml": lambda t: t.replace("<worldbody>", MESH[0]).replace(
        "<freejoint/>", MESH[1]
    ),
    "balls.xml": lambda t: t.replace(SOLE, 'type="sphere" size="0.04" pos="0 0 -0.01"'),
    "bare.xml": lambda t: t.replace(f'<geom {SOLE} mass="0.3"/>', INERTIAL),
    "soft.xml": lambda t: t.replace("300.0", "200"),
    "stiff.xml": lambda t: t.replace(
        '"1 0 0" range="-1 1"', '"1 0 0" range="-.06 .06"'
    ),
    "damped.xml": lambda t: t.replace(KNEE, f'{KNEE} damping="nan"'),
    "hips.xml": lambda t: re.sub(
        '(_yaw") axis="0 0 1" range="-1 1"',
        r'\1 type="ball"',
        re.sub('<position joint="[a-z]+_yaw"[^>]*/>', "", t),
    ),
    "one_tilt.xml": lambda t: re.sub('<position joint="right_tilt"[^>]*/>', "", t),
    "my_robot.xml": lambda t: t,
    "aside.toml": lambda t: "forward = [0, 1, 0]\n",
    "high.toml": lambda t: "[stand]\nhip_height = 0.7\n",
    "odd.toml": lambda t: "[stand]\nhip_hight = 0.4\n",
    "knee.toml": lambda t: f"[legs]\nleft = [{LEG}]\nright = [{LEG}]\n",
}
MY = ("inspect", "my_robot.xml", "--profile")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mine")
    for name, change in FILES.items():
        (folder / name).write_text(change(toy()), "utf-8")
    library = planned_library(load_robot(folder / "my_robot.xml"))
    save_library(library, folder / "my_robot.gait")
    return folder


@pytest.fixture(autouse=True)
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr("gaitchain.discover.catalogue._package", lambda: None)
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)


@pytest.mark.parametrize(
    "words",
    [
        ("inspect", "my_robot.urdf"),
        ("inspect", "unitre_g1"),
        ("inspect", "unitree_g1"),
        ("inspect", "arm.xml"),
        ("inspect", "fused.xml"),
        ("inspect", "bare.urdf"),
        ("inspect", "nan.xml"),
        ("inspect", "damped.xml"),
        ("inspect", "hips.xml"),
        ("inspect", "one_tilt.xml"),
        ("inspect", "mesh.xml"),
        ("inspect", "balls.xml"),
        ("inspect", "bare.xml"),
        (*MY, "aside.toml"),
        (*MY, "high.toml"),
        (*MY, "odd.toml"),
        (*MY, "knee.toml"),
        ("build", "stiff.xml", "-o", "b.gait", "--preset", "default"),
        ("walk", "my_robot.gait", "--robot", "soft.xml"),
    ],
    ids=" ".join,
)
def test_the_messages_are_those_of_the_page(words, capsys):
    code, _, err = call(capsys, *words)
    assert code == 2
    message = " ".join(err.removeprefix("gaitchain: ").split())
    # The page leaves out which file it was, and what a long message ends with.
    told = [m.replace("``", "`") for m in re.findall(r"^\| `(.*?)` \|", PAGE, re.M)]
    assert any(" ".join(t.split()) in message for t in told), message


@pytest.mark.parametrize(
    "names",
    [
        ["left_kne", *(f"{s}_{j}" for s in ("left", "right") for j in JOINTS)][:13],
        [f"{s}_{j}" for s in ("left", "right") for j in JOINTS[:-1]],
    ],
)
def test_so_are_those_of_the_walker(names):
    with pytest.raises(CommandError) as error:
        Walker.load("my_robot.gait", joint_names=names)
    assert str(error.value).split(": left_yaw")[0] in SMOOTH


def test_the_profile_of_the_page_is_one(folder, capsys):
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, re.S)
    profile = parse_profile(tomllib.loads(text), "page")
    assert profile.servo["left_knee"]["stiffness"] == 280.0
    Path("page.toml").write_text(text, "utf-8")
    code, out, _ = call(capsys, *MY, "page.toml")
    assert code == 0
    assert "left_shoulder 11.5" in out


def test_the_code_of_the_page_walks(capsys):
    code = re.findall(r"```python\n(.*?)```", PAGE, re.S)
    for part in code:
        exec(compile(part, "add_your_robot.md", "exec"), {})
    on_perfect_servos, in_its_model = capsys.readouterr().out.splitlines()
    assert on_perfect_servos.startswith("('left_shoulder', 'right_shoulder')")
    assert in_its_model == "('left_shoulder', 'right_shoulder') True False"
