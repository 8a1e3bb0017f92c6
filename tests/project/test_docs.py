"""What README, docs and examples say is carried out."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from commands import call

from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import VERBS
from gaitchain.cli.parser import parse
from gaitchain.cli.world_options import check_crouch, read_schedule

ROOT = Path(__file__).parents[2]
BUILDING = ("03_walk.py",)  # a library, in physics
SHORTER = {"07_residuals.py": ["1"]}  # seconds of training
EXAMPLES = [
    pytest.param(path, marks=pytest.mark.slow if path.name in BUILDING else ())
    for path in sorted((ROOT / "examples").glob("[0-9]*.py"))
]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]
# Python in other pages is run here, page by page.
RUN_ELSEWHERE = {
    "README.md": "test_the_ten_lines_of_the_readme_walk",
    "add_your_robot.md": "tests/project/test_add_your_robot.py",
    "chain_alone.md": "tests/chain/test_estimator.py",
    "extend.md": "tests/project/test_extend.py",
}
PRINTED = {  # what the code of a page says, and every reader may expect
    "start.md": " m in ",
    "walk_res.md": "Decision(layer=3",
    "own_model.md": "m ahead, hips 0.",
    "rl.md": " numbers seen",
    "ros2.md": "12 joints:",
}
SMALL = "walks=8, steps_per_walk=4, qualification_walks=16, gate_runs=2, "
SMALL += "poses_per_layer=(5, 10, 15, 5)"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_examples_run(path, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", path, *SHORTER.get(path.name, [])],
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


def test_the_page_of_commands_has_each_verb_once():
    page = (ROOT / "docs" / "commands.md").read_text("utf-8")
    rows = re.findall(r"^\| `gaitchain ([a-z-]+)", page, re.M)
    headings = re.findall(r"^## (.+)$", page, re.M)
    blocks = re.findall(r"^```\{command-help\} (.+)\n```$", page, re.M)
    assert sorted(rows) == sorted(headings) == sorted(VERBS)
    assert blocks == headings


def test_the_recipes_ask_for_what_a_library_of_res_walks():
    """The one that comes with the package is such a `brisk.gait`."""
    library, recipes = read_library("res"), commands("howto.md")
    walks = [words for words in recipes if words.startswith("walk brisk.gait")]
    assert len(walks) >= 3
    for words in walks:
        options = parse(shlex.split(words))
        check_crouch(options.crouch, library)
        if options.schedule is not None:
            read_schedule(options.schedule, library)


def blocks(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def commands(page):
    text = (ROOT / "docs" / page).read_text("utf-8")
    return re.findall(
        r"^    uv run gaitchain ((?:inspect|walk \S+|explain) .*)$", text, re.M
    )


def test_every_page_with_python_is_run():
    with_python = {page.name for page in PAGES if blocks(page)}
    assert with_python == RUN_ELSEWHERE.keys() | PRINTED.keys()


@pytest.mark.parametrize("name", PRINTED)
def test_the_python_of_a_page_runs(name, capsys):
    space = {}
    for number, block in enumerate(blocks(ROOT / "docs" / name)):
        exec(compile(block, f"{name}, block {number}", "exec"), space)
    assert PRINTED[name] in capsys.readouterr().out


@pytest.mark.slow
def test_the_commands_of_the_start_do_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    inspect, walk, explain = commands("start.md")
    code, out, _ = call(capsys, *shlex.split(inspect))
    assert code == 0
    assert "mass 31 kg" in out
    code, out, _ = call(capsys, *shlex.split(walk))
    assert code == 0
    assert "no fall" in out
    assert "<html" in Path("runs/walk/walk.html").read_text("utf-8")
    code, out, _ = call(capsys, *shlex.split(explain))
    assert code == 0
    assert "runs/walk" in out


@pytest.mark.slow
def test_the_push_of_the_tutorial_is_too_much(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    push, explain = (words for words in commands("walk_res.md") if "pushed" in words)
    code, out, _ = call(capsys, *shlex.split(push))
    assert code == 1
    assert "after a push of 40 N s" in out
    code, out, _ = call(capsys, *shlex.split(explain))
    assert code == 0
    assert "The robot fell" in " ".join(out.split())


def test_links_lead_to_headings():
    for page in PAGES:
        for target in re.findall(r"\]\(([^):]*#[^)]+)\)", page.read_text("utf-8")):
            name, _, anchor = target.partition("#")
            there = page.parent / name if name else page
            headings = re.findall(r"^#+ (.+)$", there.read_text("utf-8"), re.M)
            assert anchor in map(slug, headings), f"{page.name}: {target}"


def slug(heading):
    """Name a heading as code hosts do."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
