"""The replay: one file, silent to write, and a real browser plays it alone."""

import re
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import mujoco
import numpy as np
import pytest
from page_browser import Watched, chromium

from gaitchain.errors import CommandError
from gaitchain.figures.replay import Recording, write_replay

LEG = """
<body name="{side}/leg" pos="0 {y} 0">
  <joint axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".05"/>
  <body pos="0 0 -.55">
    <joint axis="0 1 0"/>
    <geom type="box" pos=".03 0 -.03" size=".1 .06 .02" rgba=".3 .3 .3 1"/>
  </body>
</body>"""
TOY = f"""
<mujoco>
  <asset>
    <material name="blue" rgba=".2 .5 .8 1"/>
    <mesh name="nose" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body name="trunk" pos="0 0 .6">
      <freejoint/>
      <geom type="box" pos="0 0 .2" size=".1 .15 .2" material="blue"/>
      <geom type="mesh" mesh="nose" pos=".1 0 .3"/>
      <geom type="ellipsoid" pos="0 0 .5" size=".08 .07 .1"/>
      <geom type="cylinder" pos="0 0 .62" size=".1 .02"/>
      <geom type="sphere" size=".06"/>
      {LEG.format(side="left", y=0.1)}
      {LEG.format(side="right", y=-0.1)}
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def toy() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(TOY)


def toy_walk(model: mujoco.MjModel, seconds: float = 2.0) -> Recording:
    """Shuffle along x; both feet lose the floor for a moment in mid-walk."""
    time = np.arange(0.0, seconds, 0.004)
    swing = 0.4 * np.sin(2.0 * np.pi * time)
    qpos = np.tile(model.qpos0, (len(time), 1))
    qpos[:, 0] = 0.3 * time
    qpos[:, 7:] = np.stack([swing, -swing, -swing, swing], axis=1)
    zmp = np.stack([qpos[:, 0], 0.1 * np.sign(swing)], axis=1)
    sole = np.array([[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]])
    support = [sole[: 3 + i % 2] + zmp[i] for i in range(len(time))]
    flight = slice(len(time) // 2, len(time) // 2 + 30)
    zmp[flight] = np.nan
    support[flight] = [np.empty((0, 2))] * 30
    return Recording(time, qpos, zmp, tuple(support))


def test_the_page_is_whole_and_nothing_is_left_running(
    toy: mujoco.MjModel, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "walk.html"
    threads = threading.active_count()
    size = write_replay(toy, toy_walk(toy), path, title="A <walk>")
    page = path.read_text(encoding="utf-8")
    assert size == path.stat().st_size < 2_000_000
    assert page.lower().startswith("<!doctype html>")
    assert "<title>A &lt;walk&gt;</title>" in page
    assert "__VISER_EMBED_DATA__" in page
    # Nothing is fetched by markup or style; the browser test sees the scripts.
    assert not re.search(r"""(?:src|href)=["']?https?:""", page)
    assert not re.search(r"url\(\s*[\"']?https?:", page)
    assert capfd.readouterr() == ("", "")
    assert threading.active_count() == threads


def test_the_server_is_on_loopback_and_stops_after_a_failure(
    toy: mujoco.MjModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bound: list[Any] = []
    bind = socket.socket.bind

    def spy(self: socket.socket, address: Any) -> None:
        bind(self, address)
        bound.append(self.getsockname())

    def fail(*_: Any) -> None:
        raise ArithmeticError

    monkeypatch.setattr(socket.socket, "bind", spy)
    monkeypatch.setattr(mujoco, "mj_kinematics", fail)
    with pytest.raises(ArithmeticError):
        write_replay(toy, toy_walk(toy), tmp_path / "walk.html")
    assert [host for host, _ in bound] == ["127.0.0.1"]
    with socket.socket() as probe:
        assert probe.connect_ex(bound[0]) != 0


def test_a_walk_at_rest_needs_little_room(toy: mujoco.MjModel, tmp_path: Path) -> None:
    walk = toy_walk(toy, 10.0)
    n = len(walk.time)
    still = Recording(walk.time, walk.qpos[:1].repeat(n, 0), np.zeros((n, 2)))
    moving = write_replay(toy, walk, tmp_path / "moving.html")
    assert write_replay(toy, still, tmp_path / "still.html") < moving - 10_000


def test_bad_recordings_name_the_value_and_the_limit(
    toy: mujoco.MjModel, tmp_path: Path
) -> None:
    walk = toy_walk(toy)
    with pytest.raises(
        CommandError, match="time must rise over 1 or more samples, got 0"
    ):
        Recording(walk.time[:0], walk.qpos[:0], walk.zmp[:0])
    with pytest.raises(CommandError, match="zmp has 3 samples, time has 500"):
        Recording(walk.time, walk.qpos, walk.zmp[:3])
    short = Recording(walk.time, walk.qpos[:, :-1], walk.zmp)
    with pytest.raises(CommandError, match=r"qpos is \(500, 10\), must be \(N, 11\)"):
        write_replay(toy, short, tmp_path / "walk.html")
    with pytest.raises(CommandError, match=r"fps is 0, must be in \(0, 240\]"):
        write_replay(toy, walk, tmp_path / "walk.html", fps=0.0)


def test_importing_the_module_loads_neither_mujoco_nor_viser() -> None:
    code = (
        "import sys, gaitchain.figures.replay;"
        "sys.exit(bool({'mujoco', 'viser', 'trimesh'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def settled(page: Any) -> np.ndarray:
    """Poll the canvas until two pictures agree; return it as ``(h, w, channels)``."""
    shots = [b""]
    while len(shots) < 60:
        shots.append(page.locator("canvas").first.screenshot())
        if shots[-1] == shots[-2]:
            return np.asarray(imageio.imread(shots[-1])).astype(int)
    raise TimeoutError("the paused picture still changes after 60 screenshots")


@pytest.mark.slow
@pytest.mark.browser
def test_chromium_plays_the_page_without_network(
    toy: mujoco.MjModel, tmp_path: Path
) -> None:
    path = tmp_path / "walk.html"
    write_replay(toy, toy_walk(toy, 4.0), path)
    clock = "parseFloat(document.querySelector('input').value)"
    with chromium() as browser:
        size = {"width": 640, "height": 400}
        visitor = Watched(browser, path.as_uri(), heard=("error",), viewport=size)
        page = visitor.open()
        page.wait_for_function(f"document.querySelector('input') && {clock} > 0.5")
        page.locator("input").first.fill("1.2")  # scrubs and pauses
        early = settled(page)
        page.locator("input").first.fill("3.7")
        late = settled(page)
        page.locator("input").first.blur()
        page.keyboard.press("Space")  # plays on
        page.wait_for_function(f"{clock} < 3.0")  # past the end: it loops
    wanted = visitor.wanted
    assert wanted[0] == path.as_uri()
    assert not [u for u in wanted if not u.startswith(("file:", "data:", "blob:"))]
    assert not visitor.errors
    assert (np.abs(early - late).max(axis=2) > 30).sum() > 500  # the robot has moved
    red, green, blue = late[..., 0], late[..., 1], late[..., 2]
    assert ((red > 180) & (green < 90) & (blue < 90)).sum() > 5  # the ZMP
