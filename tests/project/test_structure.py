"""The package's shape: who may import whom, and what stays light."""

import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import gaitchain

ROOT = Path(__file__).parents[2]
HEAVY = ("mujoco", "matplotlib", "viser", "scipy", "joblib", "numpy")


def test_imports_point_down_the_table():
    # A process of its own: it silences the loggers of the one that it runs in.
    code = "import sys, importlinter.cli as cli; sys.exit(cli.lint_imports())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_public_names_exist():
    for name in gaitchain.__all__:
        assert getattr(gaitchain, name).__name__ == name
    assert gaitchain.__version__ == version("gaitchain")
    with pytest.raises(AttributeError, match="nothing_of_the_kind"):
        _ = gaitchain.nothing_of_the_kind


@pytest.mark.parametrize(
    "words", ["--help", "walk --help", "trial --help", "push --help"]
)
def test_help_loads_nothing_heavy(words):
    code = (
        "import sys\n"
        "from gaitchain.cli import main\n"
        "try:\n    main(sys.argv[1:])\n"
        "except SystemExit as stop:\n    assert not stop.code\n"
        f"loaded = [m for m in {HEAVY!r} if m in sys.modules]\n"
        "assert not loaded, loaded\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words.split()],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "usage: gaitchain" in done.stdout


def test_walking_needs_no_simulator():
    code = "import sys, gaitchain.walker.walker; assert 'mujoco' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("part", "spared"),
    [
        ("supervisor", {"numba", "mujoco", "pydantic"}),
        ("log_part", {"numba", "mujoco", "pydantic"}),
        ("player_part", {"numba", "mujoco", "pydantic"}),
        ("ros_part", {"numba", "mujoco", "pydantic"}),
        ("api", {"numba", "mujoco", "viser", "matplotlib"}),
        ("viewer_part", {"numba", "joblib", "pydantic", "scipy.spatial"}),
        ("loop_part", {"mujoco", "pydantic", "scipy.spatial"}),
    ],
)
def test_a_part_of_the_service_loads_only_what_it_runs(part, spared):
    code = (
        f"import sys, gaitchain.service.{part}\n"
        f"loaded = {spared!r} & set(sys.modules)\n"
        "assert not loaded, loaded\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_few_modules_lie_beside_the_packages():
    beside = sorted(path.name for path in (ROOT / "src" / "gaitchain").glob("*.py"))
    assert len(beside) <= 5, beside


def import_ranks():
    """Return the packages of each rank that imports are checked by, highest first."""
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]
    layers = tools["importlinter"]["contracts"][0]["layers"]
    return [set(re.findall(r"gaitchain\.(\w+)", rank)) for rank in layers]


def test_the_table_of_the_design_is_what_is_checked():
    page = (ROOT / "docs" / "design.md").read_text("utf-8")
    table = page[page.index("| package |") : page.index("## Where a new thing goes")]
    rows = re.findall(r"^\| (`[^|]+) \|", table, re.M)
    assert [set(re.findall(r"\w+", row)) for row in rows] == import_ranks()


def test_the_import_table_has_one_rank_per_subject():
    ranks = import_ranks()
    assert len(ranks) <= 13
    named = set[str]().union(*ranks)
    here = ROOT / "src" / "gaitchain"
    packages = {path.parent.name for path in here.glob("*/__init__.py")}
    assert packages <= named, packages - named


def test_no_lock_file_and_no_foreign_path_is_committed():
    tracked = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if tracked.returncode:  # an unpacked source distribution has no history
        pytest.skip("not a git checkout")
    assert not [f for f in tracked.stdout.split() if f.endswith("uv.lock")]
