"""The published figures: the smallest part is measured anew, and all are published."""

import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
CLAIMS = tomllib.loads((ROOT / "benchmarks" / "results.toml").read_text("utf-8"))


def run(*words):
    script = ROOT / "benchmarks" / "results.py"
    return subprocess.run(
        [sys.executable, str(script), *words],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def smallest(tmp_path_factory):
    """What the smallest part says of the shipped library, and its folder."""
    folder = tmp_path_factory.mktemp("smallest")
    return run("smallest", "--out", str(folder)), folder


def test_the_shipped_librarys_figures_have_not_moved(smallest):
    done, folder = smallest
    assert done.returncode == 0, done.stdout + done.stderr
    table = (folder / "results.md").read_text("utf-8")
    assert "speed_mps" in table
    assert "**moved**" not in table


def test_a_figure_that_moved_is_said(smallest, tmp_path):
    """Of what was measured before, which is not measured again."""
    shutil.copytree(smallest[1], tmp_path, dirs_exist_ok=True)
    first = CLAIMS["claim"][0]
    words = "_".join([first["command"][0], "res", *first["command"][2:]])
    name = "".join(c if c.isalnum() else "_" for c in words)
    assert (tmp_path / f"{name}.json").exists()
    (tmp_path / f"{name}.json").write_text('{"survived": 1, "speed_mps": 0.299}')
    done = run("smallest", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "**moved**" in done.stdout


def test_a_claim_that_is_refused_has_no_figures(tmp_path, capfd):
    """Its row then says moved, and the other claims are measured all the same."""
    script = runpy.run_path(str(ROOT / "benchmarks" / "results.py"))
    fast = ["--schedule", "9,0,0@3"]
    assert script["result"]("trial", "res", fast, tmp_path) == {}
    assert "this library walks" in capfd.readouterr().err
    assert script["Figure"]("", "", 1.0, None, 0.0, "").moved


def test_every_claim_has_a_tolerance_and_stands_in_the_results():
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    for claim in CLAIMS["claim"]:
        assert set(claim["published"]) <= set(CLAIMS["tolerance"])
        if claim["part"] == "smallest":  # of the shipped library, for CI
            continue
        for name, value in claim["published"].items():
            shown = (
                f"{value}/{value}",
                f"{value:g}",
                f"{value:.2f}",
                f"{1e3 * value:g} mm",
            )
            assert any(text in page for text in shown), (claim["what"], name)


def test_an_unknown_part_is_refused(tmp_path):
    done = run("nothing", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "no such part: nothing" in done.stderr
