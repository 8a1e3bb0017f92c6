"""What README, docs and examples say is carried out."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from gaitchain.cli.parser import parse

ROOT = Path(__file__).parents[2]
BUILDING = ("03_walk.py",)  # a library, in physics
EXAMPLES = [
    pytest.param(path, marks=pytest.mark.slow if path.name in BUILDING else ())
    for path in sorted((ROOT / "examples").glob("[0-9]*.py"))
]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]
SMALL = "walks=8, steps_per_walk=4, qualification_walks=16, gate_runs=2, "
SMALL += "poses_per_layer=(5, 10, 15, 5)"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_examples_run(path, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", path],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.slow
def test_the_ten_lines_of_the_readme_walk(capsys):
    (code,) = re.findall(
        r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.S
    )
    assert 'BuildConfig(robot="res")' in code
    # Fewer walks than a user's library has; everything else as printed.
    exec(
        compile(
            code.replace('robot="res"', f'robot="res", {SMALL}'), "README.md", "exec"
        ),
        {},
    )
    distance = float(capsys.readouterr().out.split()[0])
    assert 0.5 < distance < 2.0  # 20 s at about 0.06 m/s


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_commands_exist(page):
    for words in re.findall(
        r"(?:^|`|uv run )gaitchain ([a-z][^`\n|#&(]*)", page.read_text("utf-8"), re.M
    ):
        parse(shlex.split(words.strip()))
