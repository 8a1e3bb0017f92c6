"""The gallery's page: a row a robot, of what was built and measured."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image
from toy_file import toy

from gaitchain.discover.loaded_robot import load_with_findings
from gaitchain.gait.library_file import save_library

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "benchmarks" / "gallery.py"


def test_the_search_begins_as_it_did_for_all_robots_of_the_page(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPT.parent)
    gallery = runpy.run_path(str(SCRIPT))
    page = (ROOT / "docs" / "robots.md").read_text("utf-8")
    assert gallery["begins"]() in page, (
        "these numbers are every robot's: build and measure all of them anew, by "
        "`python benchmarks/gallery.py`, and compare the rows of before"
    )


def test_a_row_has_picture_servos_speeds_and_pushes(toy_path, toy_library, tmp_path):
    """What was built and measured before is not done again."""
    out, page = tmp_path / "out", tmp_path / "docs" / "robots.md"
    out.mkdir()
    page.parent.mkdir()
    save_library(toy_library, out / "toy.gait")
    (out / "toy.build.txt").write_text("240", "utf-8")
    most = toy_library.command_range.vx[1]
    speed = f"{int(1e4 * most) / 1e4:g}".replace(".", "_")
    held = {"survived": 19, "runs": 20, "speed_mps": 0.31}
    name = f"trial_toy___runs_20___seed_7___schedule_{speed}_0_0_30.json"
    (out / name).write_text(json.dumps(held), "utf-8")
    pushes = {"worst_over_m_sqrt_gh": 0.25, "mean_over_m_sqrt_gh": 0.3}
    vx = f"{0.6 * most:.3f}".replace(".", "_")
    name = f"push_toy___runs_20___seed_3___vx_{vx}.json"
    (out / name).write_text(json.dumps(pushes), "utf-8")
    words = [str(toy_path), str(tmp_path / "gone.xml"), "--out", out, "--page", page]
    done = subprocess.run(
        [sys.executable, SCRIPT, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    first, second = page.read_text("utf-8").splitlines()[-2:]
    cells = [cell.strip() for cell in first.split("|")[1:-1]]
    assert cells[0] == "![toy](images/robots/toy.png)"
    with Image.open(page.parent / "images" / "robots" / "toy.png") as picture:
        assert picture.width > 90
        assert len(picture.getcolors()) > 20
    assert cells[1] == "toy, 9 kg, legs 0.4 m"
    assert cells[2:4] == ["6 joints", "kp 300 N m/rad, the file's"]
    assert cells[4:7] == ["0.31 (19 of 20)", "-", "-"]
    assert cells[7:9] == ["0.250 / 0.300", "240"]
    assert cells[9] == "speeds to 30 rad/s"
    assert "| gone | no library: no such file |" in second


def test_a_mesh_that_the_picture_lacks_is_told(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(SCRIPT.parent)
    gallery = runpy.run_path(str(SCRIPT))
    shell = '<geom type="mesh" mesh="shell" mass="0" contype="0" conaffinity="0"/>'
    text = toy().replace("<freejoint/>", f"<freejoint/>{shell}")
    asset = '<asset><mesh name="shell" file="shell.stl"/></asset><worldbody>'
    file = tmp_path / "bare.xml"
    file.write_text(text.replace("<worldbody>", asset), "utf-8")
    said = gallery["_assumed"](load_with_findings(file))
    lost = "1 mesh file (shell.stl) cannot be read; left out"
    assert said == f"speeds to 30 rad/s, {lost}"
    page = (ROOT / "docs" / "robots.md").read_text("utf-8")
    assert lost.replace("shell", "torso") in page
