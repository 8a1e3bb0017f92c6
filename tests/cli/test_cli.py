"""The command line as a user has it: words in, files, tables and exit codes out."""

import contextlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import call
from full_disk import full_disk
from toy_file import toy

import gaitchain
from gaitchain.analysis.record_file import load_record
from gaitchain.build import push
from gaitchain.build.jobs import run_jobs
from gaitchain.build.journal import code_digest
from gaitchain.cli.console import resumable
from gaitchain.cli.files import check_writable
from gaitchain.cli.library_cache import cached_library
from gaitchain.cli.options import VERBS
from gaitchain.cli.world_options import check_effects
from gaitchain.commission.stages import STAGES
from gaitchain.errors import CommandError, JournalError, LibraryError
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import AXES, CommandRange, ends_text, inward
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.gait.qualification import Qualification
from gaitchain.messages import Command
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.sim.world import DISTURBANCES

WAYS = Path(__file__).parents[1] / "support" / "op3.getup"


@pytest.fixture(scope="module")
def library_path(library, tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "res.gait"
    save_library(library, path)
    return path


def middle_speed(library):
    return round(float(np.mean(library.speed_range)), 3)


def test_walk_writes_what_it_promises(library, library_path, tmp_path, capsys):
    speed = middle_speed(library)
    schedule = f"{speed / 2:.3f}@half,{speed}@1,0.01@half"
    code, out, _ = call(
        capsys, "walk", library_path, "--schedule", schedule,
        "--out", tmp_path / "walk", "--open-loop",
    )  # fmt: skip
    assert code == 0
    result = json.loads((tmp_path / "walk" / "walk.json").read_text())
    assert result["fell"] is False
    assert result["cause"] is None
    assert [s["commanded_mps"] for s in result["segments"]] == pytest.approx(
        [round(speed / 2, 3), speed, 0.01]
    )
    moved = sum(s["achieved_mps"] * s["duration_s"] for s in result["segments"])
    assert moved == pytest.approx(result["distance_m"], abs=0.005)
    assert 0.0 <= result["zmp_inside_support"] <= 1.0
    assert result["max_joint_speed_deg_s"] < 150.0
    assert result["max_joint_angle_deg"] < 80.0
    assert result["library"]["bytes"] == library_path.stat().st_size
    assert len(result["library"]["poses_per_layer"]) == 4
    assert result["build_s"] == 0.0
    moments = [
        d["key_moment"] for d in result["decisions"] if d["key_moment"] != "kp_1"
    ]
    assert moments == ["kp_2", "kp_3", "kp_4"] * 4
    for decision in result["decisions"]:
        others = [cost for _, cost in decision["runners_up"]]
        assert others == sorted(others)
        assert all(cost >= decision["cost"] for cost in others)
        assert {"hip_x", "foot_x", "sway"} <= set(decision["primitives"])
    assert result["walk_s"] > 0.0
    page = (tmp_path / "walk" / "walk.html").read_text("utf-8")
    assert page.lstrip().lower().startswith("<!doctype html")
    assert (tmp_path / "walk" / "walk.png").stat().st_size > 20_000
    assert "commanded" in out


def test_a_fall_is_told_and_exits_with_1(library, tmp_path, capsys):
    """The same library, but every kp_2 leans over much too far."""
    poses = library.poses
    parameters = [np.array(p) for p in poses.parameters]
    parameters[1][:, PARAMETERS.index("sway")] = 0.6
    leaning = replace(library, poses=replace(poses, parameters=tuple(parameters)))
    save_library(leaning, tmp_path / "leaning.gait")
    schedule = f"{middle_speed(library)}@1"
    code, out, _ = call(
        capsys, "walk", tmp_path / "leaning.gait", "--schedule", schedule,
        "--out", tmp_path / "walk",
    )  # fmt: skip
    assert code == 1
    result = json.loads((tmp_path / "walk" / "walk.json").read_text())
    assert result["fell"] is True
    assert result["cause"].startswith("fell ")
    assert result["segments"][-1]["achieved_mps"] is None
    assert "fell" in out
    assert (tmp_path / "walk" / "walk.html").stat().st_size > 100_000


@pytest.mark.slow
def test_a_fall_before_the_first_step_is_a_fall(tmp_path, capsys):
    """Without servos that hold, the record ends while the robot settles."""
    code, out, err = call(
        capsys, "walk", "res", "--gain", "0", "--schedule", "0.3,0,0@2",
        "--out", tmp_path,
    )  # fmt: skip
    assert code == 1, err
    record = load_record(tmp_path / "walk.rec")
    assert record.time_s[-1] < record.fell_at_s < 0.0
    assert json.loads((tmp_path / "walk.json").read_text())["fell"] is True
    assert "fell" in out
    assert (tmp_path / "walk.html").stat().st_size > 100_000


@pytest.mark.slow
def test_trial_counts_and_repeats(library_path, tmp_path, capsys):
    results = []
    for name in ("one.json", "two.json"):
        code, out, _ = call(
            capsys, "trial", library_path, "--runs", 2, "--seed", 7,
            "--json", tmp_path / name, "--open-loop",
        )  # fmt: skip
        results.append(json.loads((tmp_path / name).read_text()))
    assert results[0] == results[1]
    result = results[0]
    assert result["runs"] == 2
    assert result["survived"] == sum(r["survived"] for r in result["per_run"])
    assert code == (0 if result["survived"] == 2 else 1)
    keys = {"speed_mps", "speed_error_mps", "yaw_drift_deg", "stop_s"}
    told = {"seed", "cause", "schedule", "survived", "world"} | keys
    assert all(told <= set(r) for r in result["per_run"])
    stood = [r for r in result["per_run"] if r["survived"]]
    assert stood
    assert keys <= set(result)
    for name in ("speed_mps", "speed_error_mps"):
        assert result[name] == pytest.approx(np.mean([r[name] for r in stood]))
    drifts = [abs(r["yaw_drift_deg"]) for r in stood]
    assert result["yaw_drift_deg"] == pytest.approx(np.mean(drifts))
    assert result["feedback"] is False
    assert "survived" in out


def test_trial_in_worlds_that_are_given(library, library_path, tmp_path, capsys):
    schedule = f"{middle_speed(library)}@1"
    path = tmp_path / "trial.json"
    code, out, _ = call(
        capsys, "trial", library_path, "--runs", 2, "--json", path, "--workers", 1,
        "--schedule", schedule, "--friction", 0.9, "--gain", 1, "--mass", 1.1,
        "--model-error", 0.02, "--delay", 0.01, "--noise", 0.5, "--blocks", 0.001,
        "--slope", -0.5, "--contact", 0.01, "--speed-limit", "inf",
        "--push", "1@-90@0.5,2@45",
    )  # fmt: skip
    result = json.loads(path.read_text())
    assert code == (0 if result["survived"] == 2 else 1)
    world = {
        "friction": 0.9,
        "mass": 1.1,
        "model_error": 0.02,
        "delay_s": 0.01,
        "noise": 0.5,
        "blocks_m": 0.001,
        "slope_deg": -0.5,
        "contact_s": 0.01,
        "speed_limit_deg_s": "inf",
    }
    assert world | {"servo_gain": 1.0} == {
        k: v for k, v in result["fixed"].items() if k != "push"
    }
    assert [
        (p["impulse_ns"], p["direction_deg"], p["at_s"])
        for p in result["fixed"]["push"]
    ] == [(1.0, -90.0, 0.5), (2.0, 45.0, 4.0)]
    for run_ in result["per_run"]:
        assert world.items() <= run_["world"].items()
        assert run_["world"]["push"] == result["fixed"]["push"]
        assert run_["schedule"] == schedule
    seeds = [run_["world"]["seed"] for run_ in result["per_run"]]
    assert seeds[0] != seeds[1]
    assert schedule in out


@pytest.mark.slow
def test_a_replay_shows_the_floor_that_was_walked(
    library, library_path, tmp_path, capsys, monkeypatch
):
    """With its blocks, and a robot whose waist gives way, which no record holds."""
    drawn = []

    def write(model, recording, path, **_):
        drawn.append((model, recording))
        path.write_text("", "utf-8")

    monkeypatch.setattr("gaitchain.cli.walk.write_replay", write)
    schedule = f"{middle_speed(library)}@half"
    call(
        capsys, "walk", library_path, "--schedule", schedule, "--out",
        tmp_path / "w", "--blocks", 0.001, "--waist", 40,
    )  # fmt: skip
    ((model, recording),) = drawn
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    assert sum(name.startswith("block_") for name in names) > 10
    assert any("_look_" in name for name in names)
    assert recording.qpos.shape[1] == model.nq


@pytest.mark.slow
def test_push_reports_impulses(library, library_path, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(push, "RESOLUTION", 1.0 / 16.0)  # of few walks
    path, picture = tmp_path / "push.json", tmp_path / "push.png"
    code, out, _ = call(
        capsys, "push", library_path, "--vx", middle_speed(library), "--runs", 1,
        "--directions", 2, "--json", path, "-o", picture, "--workers", 1,
        "--model-error", 0.05,
    )  # fmt: skip
    assert code == 0
    result = json.loads(path.read_text())
    sides = result["per_direction"]
    assert [side["direction_deg"] for side in sides] == [0.0, 180.0]
    parts = [side["impulse_ns"] / result["m_sqrt_gh_ns"] for side in sides]
    assert [side["over_m_sqrt_gh"] for side in sides] == pytest.approx(parts)
    assert result["worst_over_m_sqrt_gh"] == pytest.approx(min(parts))
    assert result["mean_over_m_sqrt_gh"] == pytest.approx(np.mean(parts))
    assert result["fixed"] == {"model_error": 0.05}
    assert all(side["critical_ns"] == [side["impulse_ns"]] for side in sides)
    assert picture.stat().st_size > 20_000
    assert "m sqrt(g h)" in out


def test_walk_in_a_world_that_is_given(library, library_path, tmp_path, capsys):
    """The same push brings the robot down."""
    words = (
        "walk", library_path, "--out", tmp_path, "--friction", 0.7,
        "--schedule", f"{middle_speed(library)}@2", "--push", "80@90@2.5",
    )  # fmt: skip
    code, out, _ = call(capsys, *words)
    assert code == 1
    result = json.loads((tmp_path / "walk.json").read_text())
    assert result["world"]["friction"] == 0.7
    assert "after a push of 80 N s to 90 deg" in result["cause"]
    assert 2.5 < load_record(tmp_path / "walk.rec").fell_at_s < 6.0
    assert "fell" in out


def test_a_libraries_kind_decides_what_a_schedule_is(library_path, tmp_path, capsys):
    for verb in ("trial", "walk"):
        code, _, err = call(capsys, verb, library_path, "--schedule", "0.05,0,0@3")
        assert code == 2
        assert "speed@cycles" in err
    code, _, err = call(capsys, "push", library_path, "--vx", 3)
    assert code == 2
    assert err.startswith("gaitchain: --vx: 3 m/s ahead: this library walks")


def test_inspect_shows_sources_and_verdicts(
    library, library_path, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    code, out, _ = call(capsys, "inspect", "res")
    assert code == 0
    assert "paper, Sec. VI-A" in out
    assert "assumed" in out
    assert "kp_4" in out
    code, out, _ = call(capsys, "inspect", library_path)
    assert code == 0
    pages = (
        "Gait library",
        "Gait",
        "Verdicts",
        "Built from",
        "poses_per_layer",
    )
    at = [out.index(f"{title}") for title in pages]
    assert at == sorted(at)
    assert ends_text(*library.speed_range, "m/s") in out
    assert "grid of worlds" in out
    assert "random schedules" in out
    code, out, _ = call(capsys, "inspect", "res.gait")
    assert code == 0
    assert "res.gait: no such file here; taking the one that comes with" in out
    assert re.search(r"sensor noise 1 .* yes .* 16/16 .* 29/29", out)


def test_inspect_tells_how_far_mixed_commands_reach(library_path, tmp_path, capsys):
    path = tmp_path / "reach.json"
    code, out, _ = call(capsys, "inspect", "res.gait", "--json", path)
    assert code == 0
    table = out[out.index("Reach of commands") : out.index("Verdicts")]
    told = json.loads(path.read_text("utf-8"))
    span = CommandRange(**{name: tuple(e) for name, e in told["commands"].items()})
    names = [*AXES]
    slow, fast = map(inward, span.crouch)
    assert f"{slow:.3f} m, at full speed {fast:.3f} m lower" in out
    for reach in told["reach"]:
        free = [name for name in names if name in reach]
        assert {n for n in names if reach["beside"][n] == 0.0} == set(free)
        for name, most in ((n, most) for n in free for most in reach[n]):
            assert f"{abs(most):.3f}" in table
            both = {**reach["beside"], name: most}
            assert span.clamp(Command(**both))[1] == ""
            both[name] += math.copysign(0.006, most)
            assert span.clamp(Command(**both))[1] != ""
    halves = [reach["beside"] for reach in told["reach"]]
    assert {"vx": 0.0, "vy": 0.0, "yaw_rate": 0.0} in halves
    most = span.yaw_rate[1]
    turns = [beside["yaw_rate"] for beside in halves if beside["yaw_rate"]]
    assert turns == pytest.approx([0.5 * most, most], abs=0.001)
    code, out, _ = call(capsys, "inspect", library_path)  # it only walks ahead
    table = out[out.index("Reach of commands") : out.index("Verdicts")]
    assert "ahead / back" in table
    assert "turn left" not in table
    assert "half" not in table


def test_inspect_shows_a_library_that_physics_refused(library, tmp_path, capsys):
    path = tmp_path / "fallen.gait"
    nothing = 0 * library.pair_passes
    save_library(
        replace(library, pair_passes=nothing, qualification=Qualification()), path
    )
    code, out, _ = call(capsys, "inspect", path)
    assert code == 0
    assert re.search(r"qualified\W+NO", out)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 1.1])
def test_build_writes_a_library_or_says_that_it_failed(
    tmp_path, capsys, monkeypatch, share
):
    """No library reaches a share above 1 of its schedules."""
    small = partial(
        BuildConfig,
        poses_per_layer=(4, 6, 8, 4),
        qualification_walks=4,
        gate_runs=1,
        gate_share=share,
    )
    monkeypatch.setattr("gaitchain.cli.build.BuildConfig", small)
    path = tmp_path / "new" / "small.gait"
    words = ("build", "res", "-o", path, "--walks", 4, "--cost", "planned")
    code, out, _ = call(capsys, *words, "--seed", 1)
    library = load_library(path)
    config = library.config
    assert (config.walks, config.cost, config.seed) == (4, "planned", 1)
    assert code == (0 if library.qualified else 1)
    assert ("not qualified: this library will be refused" in out) == (code == 1)
    if share > 1.0:
        assert code == 1
    assert path.stat().st_size < 64_000
    assert "random schedules walked" in out


MAIN = "from gaitchain.cli import main; main()"
BAD = [
    ([], 0, "usage"),
    (["fly"], 2, "fly: no such verb"),
    (["wlak"], 2, "wlak: no such verb; did you mean walk?"),
    (
        ["walk", "--polcy", "greedy"],
        2,
        "--polcy: no option of walk; did you mean --pol",
    ),
    (
        ["walk", "--open-loop=no"],
        2,
        "--open-loop=no: it takes no value; give --open-loop, or leave it out",
    ),
    (["trial", "res", "--quiet="], 2, "--quiet=: it takes no value; give --quiet, or"),
    (["serve", "res", "--no_log=1"], 2, "--no_log=1: it takes no value; give --no-log"),
    (["build", "res", "--out", "x"], 2, "--out: no option of build; did you mean --ou"),
    (["walk", "--library", "x.gait"], 2, "give the library itself: gaitchain walk FI"),
    (["figures", "--library=x.gait"], 2, "give the library itself: gaitchain figures"),
    (
        ["trial", "x.gait", "--own-model", "x.xml", "--servo", "xm430-w350"],
        2,
        "--servo is not possible in the robot's own model, whose floor, contacts and "
        "servos are its file's; possible are --slope,",
    ),
    (
        [
            *("trial", "x.gait", "--own-model", "x.xml"),
            *("--servo", "xm430-w350", "--backlash", "0.1"),
        ],
        2,
        "--backlash is not possible in the robot's own model",
    ),
    (["trial", "nobody"], 2, "one that comes with gaitchain: res"),
    (["inspect", "res", "--json", "/proc/x/a.json"], 2, "/proc/x"),
    (["inspect", "res", "--json", "/proc/a.json"], 2, "directory; name another file"),
    (["build", "res", "-o", "x.gait", "--step-s", "1e-9"], 2, "must be 0.1 to 30"),
    (["build", "res", "-o", "x.gait", "--search", "-1"], 2, "search is -1, must be"),
    (["build", "res", "-o", "x.gait", "--preset", "fast"], 2, "default, table1, brisk"),
    (["explain", "missing"], 2, "missing: no such file; explain reads the folder"),
    (["walk", "--speed", "3"], 2, "--speed"),
    (["walk", "--seed", "x"], 2, "seed"),
    (["walk", "--robot", "nobody"], 2, "nobody"),
    (["walk", "missing.gait"], 2, "missing.gait"),
    (["walk", "--schedule", "fast"], 2, "speed@cycles"),
    (["inspect", "missing.gait"], 2, "missing.gait"),
    (["inspect", "missing.toml"], 2, "missing.toml"),
    (["trial", "missing.gait"], 2, "missing.gait"),
    (["figures", "--only", "5"], 2, "6,7,8,9,10,11"),
    (["figures", "--only", "six"], 2, "6,7,8,9,10,11"),
    (["figures", "--only", "6", "--seeds", "1"], 2, "--seeds"),
    (["figures", "res"], 2, "key poses: build one with preset 'default'"),
    (["figures", "missing.gait", "--only", "6"], 2, "missing.gait: no such file"),
    (["figures", "res", "--only", "8"], 2, "res: this library walks by strides"),
    (["build", "res", "-o", "x.gait", "--preset", "table1"], 2, "not closed"),
    (["build", "res", "-o", "x.gait", "--preset", "none"], 2, "default"),
    (["build", "res", "-o", "x.gait", "--seed", "-1"], 2, "--seed -1: give 0 to"),
    (
        ["build", "res", "-o", "x.gait", "--walks", "0"],
        2,
        "walks is 0, must be a whole number, 1 to",
    ),
    (
        ["build", "res", "-o", "x.gait", "--epsilon", "nan"],
        2,
        "epsilon is nan, must be 0 to",
    ),
    (["build", "res", "-o", "."], 2, "cannot be written, as it is a folder"),
    (["walk", "--seed", "-3"], 2, "--seed -3: give 0 to"),
    (["bench", "--json", "."], 2, "cannot be written"),
    (["trial", "x.gait", "--runs", "0"], 2, "--runs 0: give 1 to"),
    (["trial", "x.gait", "--seed", "-1"], 2, "--seed -1"),
    (
        ["trial", "x.gait", "--robot-hidden", "1.5"],
        2,
        "gaitchain: --robot-hidden 1.5: give a whole number, 0 to 4294967295\n",
    ),
    (["push", "res", "--vx", "nan"], 2, "--vx nan: need a speed in m/s, as 0.2"),
    (["push", "res", "--runs", "x"], 2, ": --runs x: give a whole number, 1 to 10"),
    (["serve", "--log-size", "big"], 2, " big: give a number, 1 to 100000 MB\n"),
    (["trial", "x.gait", "--doubt", "much"], 2, "--doubt much: give a number\n"),
    (["trial", "x.gait", "--seed", "1" + "0" * 400], 2, "00: give 0 to 4294967295"),
    (["trial", "x.gait", "--seed", "4294967296"], 2, "--seed 4294967296: give 0 to"),
    (
        ["push", "res", "--vx", "0.2", "--runs", "1000001"],
        2,
        "1000001: give 1 to 1000000",
    ),
    (["serve", "--log-size", "100000.5"], 2, "100000.5: give 1 to 100000 MB"),
    (["trial", "x.gait", "--workers", "0"], 2, "--workers 0: give 1 to"),
    (["trial", "x.gait", "--seconds", "0"], 2, "--seconds 0: give 1 to 3600"),
    (["trial", "x.gait", "--delay", "40"], 2, "--delay: delay_s is 40.0, must be 0"),
    (["trial", "x.gait", "--model-error", "-1"], 2, "--model-error: model_error is"),
    (["trial", "x.gait", "--speed-limit", "0"], 2, "--speed-limit: speed_limit_deg_s"),
    (["trial", "x.gait", "--push", "8"], 2, "impulse@direction@time"),
    (["trial", "x.gait", "--push", ""], 2, "--push '': expected impulse@direction"),
    (["trial", "x.gait", "--punches", ""], 2, "--punches '': expected impulse or"),
    (["trial", "x.gait", "--push", "8@x"], 2, "impulse@direction@time"),
    (["trial", "x.gait", "--push", "-8@0"], 2, "impulse_ns is -8.0"),
    (["trial", "x.gait", "--feedback", "--open-loop"], 2, "give one of them"),
    (["push", "missing.gait"], 2, "missing.gait"),
    (["push", "."], 2, ".: a folder; give a library that `gaitchain build` wrote"),
    (["warm-up", "."], 2, ".: a folder; give a library that `gaitchain build` wrote"),
    (["replay", "."], 2, ".: a folder; replay plays a log of `gaitchain serve` (.mcap"),
    (["replay", "x.mcap"], 2, "x.mcap: no such file; replay plays a log of"),
    (["trial", "res", "more"], 2, "options: more; see gaitchain trial --help"),
    (["replay", "x.mcap", "--robot", "no.xml"], 2, "no.xml: no such file; give a"),
    (["replay", "x.mcap", "--profile", "p.toml"], 2, "--profile describes a robot"),
    (["trial", "x.gait", "--own-model", "no.xml"], 2, "no.xml: no such file; give a"),
    (
        ["export", "x.gait", "--to", "npz", "--own-model", "no.xml"],
        2,
        "no.xml: no such file; give a",
    ),
    (["push", "RES"], 2, "RES: no such file (did you mean res?)"),
    (["push", "x.gait", "--runs", "0"], 2, "--runs 0: give 1 to"),
    (["push", "x.gait", "--directions", "0"], 2, "--directions 0"),
    (["push", "res", "-o", "."], 2, "cannot be written"),
    (["walk", "--slope", "90"], 2, "--slope: slope_deg is 90.0"),
    (["walk", "--contact", "0"], 2, "--contact: contact_s is 0.0, must be 0.002"),
]


@pytest.mark.parametrize(("words", "code", "said"), BAD, ids=lambda v: str(v)[:40])
def test_bad_input_is_one_line_and_exit_code_2(
    words, code, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    got, out, err = call(capsys, *words)
    assert got == code
    assert said in (out if code == 0 else err)
    if code:
        assert err.startswith("gaitchain: ")
        assert err.count("\n") == 1
        assert "Traceback" not in err
        assert not list(tmp_path.rglob("*.json"))


@pytest.mark.parametrize(
    "words",
    [("walk", "res", "--servo", "foo"), ("build", "res"), ("walk", "--seed"), ("-V",)],
    ids=" ".join,
)
def test_bad_words_read_the_same_without_colour(words, capsys, monkeypatch):
    """Then the frame round the message is of ASCII, without corners."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    framed = call(capsys, *words)
    monkeypatch.setenv("NO_COLOR", "1")
    plain = call(capsys, *words)
    assert plain[2] == framed[2]
    assert "---" not in plain[2]


def test_a_word_that_is_no_choice_is_refused_with_those_there_are(capsys):
    """In the order in which they are declared, and without None."""
    stages = ", ".join(stage.name for stage in STAGES)
    for words, given in (
        (("doctor", "res", "--from", "foo"), f"--from foo: give one of {stages}"),
        (("trial", "res", "--arms", "foo"), "--arms foo: give one of still, random"),
        (("trial", "res", "--arms", "None"), "--arms None: give one of still, random"),
    ):
        assert call(capsys, *words) == (2, "", f"gaitchain: {given}\n")


def test_help_says_how_to_ask_for_the_version(capsys):
    code, out, _ = call(capsys, "--help")
    assert (code, "--version" in out) == (0, True)


def test_an_empty_file_is_told_once(tmp_path, capsys):
    path = tmp_path / "empty"
    path.touch()
    said = f"gaitchain: {path}: it is empty; expected MJCF or URDF\n"
    assert call(capsys, "inspect", path) == (2, "", said)


def test_help_offers_no_none(capsys, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    for verb in VERBS:
        code, out, _ = call(capsys, verb, "--help")
        assert code == 0
        assert "{None" not in out


def test_where_work_goes_on_is_said_only_where_some_is_kept(tmp_path, capsys):
    begun, none = tmp_path / "begun.jsonl", tmp_path / "none.jsonl"
    begun.write_text("{}\n")
    some = tmp_path / "some.jsonl"
    some.write_text("{}\n1\n")
    for kept in (begun, none, some):
        with pytest.raises(JournalError), resumable(kept):
            raise JournalError("the disk is full")
        said = f"{kept}: what is finished" in capsys.readouterr().out
        assert said == (kept is some)


@pytest.mark.slow
def test_every_disturbance_is_an_option_that_names_itself(capsys):
    """Options, help and limits come from what `World` declares."""
    _, out, _ = call(capsys, "trial", "--help")
    for name, disturbance in DISTURBANCES.items():
        option = f"--{disturbance.option.replace('_', '-')}"
        assert option in out
        if disturbance.limits is not None:
            low = disturbance.limits.low - 1.0
            code, _, err = call(capsys, "trial", "x.gait", option, low)
            assert code == 2
            assert err.startswith(f"gaitchain: {option}: {name} is {low}, must be")


NEEDY = [name for name, disturbance in DISTURBANCES.items() if disturbance.needs]


@pytest.mark.parametrize("name", NEEDY)
@pytest.mark.parametrize(
    "words",
    [
        ("walk", "res"),
        ("trial", "res", "--runs", "1"),
        ("push", "res"),
        ("walk", "res", "--servo", "xm430-w350"),  # whose friction is not known
    ],
    ids=" ".join,
)
def test_a_disturbance_that_does_nothing_alone_is_refused_alone(
    name, words, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    own, other = (
        f"--{DISTURBANCES[each].option.replace('_', '-')}"
        for each in (name, DISTURBANCES[name].needs)
    )
    code, _, err = call(capsys, *words, own, 0.5)
    assert (code, err) == (2, f"gaitchain: {own} has no effect without {other}\n")
    assert not list(tmp_path.iterdir())


def test_stiction_is_of_any_dry_friction():
    """Given beside it, or the robot's own; and none of it needs none."""
    robot = load_box_robot("res")
    legs = robot.legs
    rusty = replace(robot, legs=replace(legs, friction_loss=0.1 * legs.torque_limit))
    check_effects({"stiction": 0.5}, rusty)
    check_effects({"stiction": 0.5, "dry_friction": 0.1}, robot)
    check_effects({"stiction": 0.0}, robot)
    with pytest.raises(CommandError, match="--stiction has no effect"):
        check_effects({"stiction": 0.5, "dry_friction": 0.0}, robot)


@pytest.mark.parametrize(
    "words",
    [
        ("build", "toy.xml", "-o", "toy.xml"),
        ("build", "toy.xml", "-o", "x.gait", "--profile", "p.toml", "--json", "p.toml"),
        ("build", "toy.xml", "-o", "p.toml", "--profile", "p.toml"),
        ("inspect", "toy.xml", "--json", "../{folder}/toy.xml"),
        ("inspect", "res.gait", "--json", "res.gait"),
        ("export", "res.gait", "--to", "npz", "-o", "x.npz", "--json", "x.npz"),
        ("export", "res", "--to", "open-duck", "-o", "x.pkl", "--json", "x.json"),
        ("export", "res", "--to", "csv", "-o", ".", "--json", "index.csv"),
        ("export", "res", "--to", "mjlab", "-o", ".", "--json", "motion_044.npz"),
        ("export", "res", "--to", "c", "-o", ".", "--json", "gait.c"),
        ("identify", "res", "mine.log", "-o", "x.gait", "--json", "mine.log"),
        ("qualify", "res.gait", "-o", "x.png", "--map", "x.png"),
        ("get-up", "res.gait", "toy.xml", "-o", "toy.xml"),
        ("get-up", "res", "toy.xml", "-o", "x.json", "--replay", "x.json"),
    ],
    ids=" ".join,
)
def test_no_output_takes_the_place_of_another_file(
    words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("toy.xml").write_text(toy(), "utf-8")
    shutil.copy(resources.files("gaitchain") / "data" / "res.gait", "res.gait")
    Path("p.toml").write_text("[stand]\n", "utf-8")
    Path("mine.log").write_text("a log", "utf-8")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    given = [word.format(folder=tmp_path.name) for word in words]
    code, _, err = call(capsys, *given)
    assert code == 2
    assert f"{given[-1]}: named twice" in err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_check_of_an_output_leaves_nothing_of_it(tmp_path):
    kept, new = tmp_path / "kept", tmp_path / "new"
    kept.write_text("mine", "utf-8")
    before = kept.stat()
    for path in (kept, new, Path(os.devnull)):
        check_writable(path)
    assert [*tmp_path.iterdir()] == [kept]
    assert kept.stat() == before
    for path in (tmp_path / ("a" * 250), tmp_path / ("a" * 300)):
        with pytest.raises(CommandError, match="File name too long; name another file"):
            check_writable(path)
    assert [*tmp_path.iterdir()] == [kept]


@pytest.mark.skipif(os.name == "nt", reason="no pipes in folders there")
def test_a_pipe_is_written_to_and_not_replaced(tmp_path, monkeypatch):
    """Nor does its folder have to take files, which that of /dev/stdout does not."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    monkeypatch.setattr("gaitchain.cli.files.make_folder", None)
    check_writable(pipe)
    assert [*tmp_path.iterdir()] == [pipe]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("calibrate", "res", "--robot-hidden", "1", "--exercise", "mine.gait"),
            "mine.gait: a gait library; name another file for the log",
        ),
        (
            ("calibrate", "res", "--robot-hidden", "1", "--exercise", "p.toml"),
            "p.toml: a robot's TOML file; name another file for the log",
        ),
        (
            ("inspect", "res", "--json", "mine.gait"),
            "mine.gait: a gait library; name another file for the results",
        ),
        (
            ("trial", "res", "--runs", "1", "--json", "p.toml"),
            "p.toml: a robot's TOML file; name another file for the results",
        ),
        (
            ("calibrate", "res", "--preview", "mine.gait"),
            "mine.gait: a gait library; name another file for the page",
        ),
        (
            ("calibrate", "res", "--preview", "p.toml"),
            "p.toml: a robot's TOML file; name another file for the page",
        ),
        (
            ("get-up", "res", "toy.xml", "-o", "a.getup", "--replay", "mine.gait"),
            "mine.gait: a gait library; name another file for the page",
        ),
        (
            ("get-up", "res", "toy.xml", "-o", "mine.gait"),
            "mine.gait: a gait library; name another file for the ways up",
        ),
        (
            ("build", "res", "-o", "p.toml"),
            "p.toml: a robot's TOML file; name another file for the library",
        ),
        (
            ("qualify", "res", "-o", "p.toml"),
            "p.toml: a robot's TOML file; name another file for the library",
        ),
        (
            ("trial", "res", "--json", "run.mcap"),
            "run.mcap: the log of a run; name another file for the results",
        ),
        (
            ("trial", "res", "--json", "toy.getup"),
            "toy.getup: a file of ways up; name another file for the results",
        ),
        (
            ("push", "res", "-o", "mine.png"),
            "mine.png: a gait library; name another file for the picture",
        ),
        (
            ("export", "res", "--to", "npz", "-o", "mine.npz"),
            "mine.npz: a gait library; name another file for the motions",
        ),
    ],
    ids=lambda words: words if isinstance(words, str) else " ".join(words),
)
def test_a_library_or_a_profile_is_not_replaced_by_anything_else(
    words, said, tmp_path, capsys, monkeypatch
):
    """It was, without a word; there may be no other copy."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine.gait", "mine.png", "mine.npz"):
        shutil.copy(resources.files("gaitchain") / "data" / "res.gait", name)
    Path("p.toml").write_text("[stand]\n", "utf-8")
    Path("run.mcap").write_bytes(b"\x89MCAP0\r\n")
    shutil.copy(WAYS, "toy.getup")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    code, _, err = call(capsys, *words)
    assert (code, err) == (2, f"gaitchain: {said}\n")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("push", "res", "--body", "nope"), "--body: body 'nope': the robot has trunk"),
        (("trial", "res", "--push", "9@0@1@nope"), "--push: body 'nope': the robot"),
        (
            ("walk", "res", "--schedule", "0.3,0,0@2", "--push", "9@0@1@nope"),
            "--push: body 'nope': the robot",
        ),
    ],
)
def test_a_body_that_is_not_there_is_refused_before_any_walk(
    words, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    code, _, err = call(capsys, *words)
    assert (code, said in err) == (2, True)
    assert ": 0 of" not in err, "no walk is begun"


@pytest.mark.slow
def test_a_build_that_cannot_be_leaves_an_interrupted_one(tmp_path, capsys):
    kept = tmp_path / "x.gait.build.jsonl"
    kept.write_text("finished walks\n", "utf-8")
    words = "build", "res", "-o", tmp_path / "x.gait", "--preset", "brisk"
    code, _, err = call(capsys, *words, "--cost", "planned")
    assert (code, kept.read_text("utf-8")) == (2, "finished walks\n")
    assert "strides are planned with the ZMP in the sole" in err


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("walk", "res", "--schedule", "0.3,0,0@2", "--push", "9@90"),
        ("trial", "res", "--schedule", "0.3,0,0@4", "--push", "9@90@1,9@90@4"),
        ("trial", "res", "--seconds", "3", "--push", "9@90"),
    ],
    ids=" ".join,
)
def test_a_push_after_the_walk_is_refused(words, tmp_path, capsys, monkeypatch):
    """It would seem to be withstood; without a time it comes at 4 s."""
    monkeypatch.chdir(tmp_path)
    code, _, err = call(capsys, *words)
    assert code == 2
    assert "--push: one begins at 4 s, the last command ends at" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_length_is_refused_where_the_schedule_has_one(capsys):
    """The JSON told the default length of a schedule of another one, too."""
    words = "trial", "res", "--schedule", "0.3,0,0@4", "--runs", "1", "--workers", "1"
    code, _, err = call(capsys, *words, "--seconds", "9")
    assert (code, "--seconds: of random schedules" in err) == (2, True)
    code, out, _ = call(capsys, *words, "--json", "-")
    assert (code, json.loads(out)["seconds"]) == (0, None)


@pytest.mark.parametrize("number", ["nan", "inf", "1001"])
@pytest.mark.parametrize("at", range(3))
def test_a_way_point_with_a_number_that_is_none_is_refused(number, at, capsys):
    words = ["1", "0", "0"]
    words[at] = number
    code, _, err = call(capsys, "walk", "res", "--waypoints", ",".join(words))
    assert code == 2
    assert f"--waypoints '{','.join(words)}': expected x,y,yaw" in err


@pytest.mark.slow
def test_a_push_after_the_way_is_refused(tmp_path, capsys):
    """Only the walk shows how long the way takes."""
    words = "walk", "res", "--waypoints", "0.1,0,0", "--out", tmp_path
    code, _, err = call(capsys, *words, "--push", "9@90@500")
    assert code == 2
    assert "--push: one begins at 500 s, the way took" in err
    assert not (tmp_path / "walk.json").exists()
    code, _, err = call(capsys, *words, "--push", "1@90@1")
    assert code == 0, err


@pytest.mark.slow
def test_a_robot_that_stands_at_the_end_is_pushed_there(tmp_path, capsys):
    code, _, err = call(
        capsys, "walk", "res", "--schedule", "0.3,0,0@2;0,0,0@3", "--push",
        "60@90@4", "--out", tmp_path,
    )  # fmt: skip
    assert code == 1, err
    assert load_record(tmp_path / "walk.rec").fell_at_s > 4.0


def test_a_schedule_out_of_range_is_refused(library_path, tmp_path, capsys):
    code, _, err = call(
        capsys, "walk", library_path, "--schedule", "0.5@2",
        "--out", tmp_path / "walk",
    )  # fmt: skip
    assert code == 2
    assert "0.5 m/s" in err
    assert not (tmp_path / "walk").exists()


def test_a_folder_that_cannot_be_made_is_named(
    library, library_path, tmp_path, capsys, monkeypatch
):
    """Before the walk, not after it."""
    monkeypatch.setattr("gaitchain.cli.walk.run_schedule", None)
    (tmp_path / "file").write_text("in the way")
    folder = tmp_path / "file" / "walk"
    schedule = f"{middle_speed(library)}@1"
    code, _, err = call(
        capsys, "walk", library_path, "--out", folder,
        "--schedule", schedule,
    )  # fmt: skip
    assert code == 2
    assert err.startswith(f"gaitchain: {folder}: no such folder can be made")
    assert err.count("\n") == 1


def test_a_robot_file_with_a_bad_number_names_key_value_and_range(tmp_path, capsys):
    text = (resources.files("gaitchain") / "data" / "res.toml").read_text()
    path = tmp_path / "heavy.toml"
    path.write_text(text.replace("value = 16.0", "value = 1600.0"))
    code, _, err = call(capsys, "inspect", path)
    assert code == 2
    assert "trunk_mass" in err
    assert "1600" in err
    assert "500 kg" in err


@pytest.mark.slow
def test_a_librarys_name_works_wherever_a_library_does(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("--schedule", "0.1,0,0@1", "--quiet", "--json", "-")
    code, out, err = call(capsys, "trial", "res", "--runs", 1, *words)
    assert (code, err) == (0, "")
    assert json.loads(out)["survived"] == 1
    code, out, err = call(capsys, "walk", "res", "--out", "here", *words)
    assert (code, err) == (0, "")
    written = json.loads((tmp_path / "here" / "walk.json").read_text())
    assert json.loads(out) == written
    assert written["feedback"] is True
    (tmp_path / "res").write_text("a file of that name goes first")
    code, _, err = call(capsys, "trial", "res")
    assert code == 2
    assert "not a gait library" in err


def test_quiet_prints_nothing_and_json_has_it_all(library_path, tmp_path, capsys):
    path = tmp_path / "found.json"
    for words in (["inspect", library_path], ["inspect", "res"], ["robots"]):
        code, out, err = call(capsys, *words, "--quiet", "--json", path)
        assert (code, out, err) == (0, "", "")
        whole = json.loads(path.read_text())
        assert call(capsys, *words, "--json", "-")[1] == path.read_text()
        assert whole
    assert call(capsys, "inspect", "nobody", "--quiet")[2].startswith("gaitchain: ")


def test_progress_is_plain_lines_where_there_is_no_terminal(library_path, capsys):
    words = ("trial", library_path, "--runs", 2, "--schedule", "0.05@half")
    _, out, err = call(capsys, *words, "--workers", 1)
    told = [f"walking the schedule: {n} of 2" for n in range(3)]
    assert [line.lstrip().partition(" ")[2] for line in err.splitlines()] == told
    assert all(re.match(r" {2}\d:[0-5]\d ", line) for line in err.splitlines())
    assert "survived" in out


def shown_on_terminal(code, *words, **settings):
    """Run Python code with words and settings on a terminal; return what it shows."""
    terminal, end = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdout=end,
        stderr=end,
        env={**os.environ, "TERM": "xterm-256color", **settings},
    )
    os.close(end)
    shown = b""
    with contextlib.suppress(OSError):  # a terminal that all have closed
        while more := os.read(terminal, 4096):
            shown += more
    os.close(terminal)
    assert process.wait(timeout=60) == 0
    return shown


def test_a_bar_grows_with_its_stage():
    """The walks of a search become more where its first ones fall."""
    code = (
        "from gaitchain.cli.console import progress\n"
        "with progress() as tell:\n"
        "    tell('searching', 1, 100); tell('searching', 180, 180)\n"
    )
    assert b"180/180" in shown_on_terminal(code)


def test_no_colour_where_none_is_wanted():
    for words in (["robots"], ["walk", "--help"]):
        shown = shown_on_terminal(MAIN, *words, NO_COLOR="1")
        assert shown.strip()
        assert not re.search(rb"\x1b\[[0-9;]*3[0-9]", shown)


def test_a_kept_library_is_of_this_config_and_this_code(
    library, tmp_path, capsys, monkeypatch
):
    """One version of the package may build different things as it is worked on."""
    path, built = tmp_path / "res.gait", []

    def build(config, tell, workers, robot):
        built.append(config)
        report = SimpleNamespace()
        return replace(library, config=config), report

    monkeypatch.setattr("gaitchain.cli.build.build_library", build)
    monkeypatch.setattr("gaitchain.cli.build.print_report", lambda *_: None)
    config = BuildConfig(seed=1)
    for _ in range(2):
        cached_library(config, path)
    assert built == [config]
    assert "built earlier from this config" in capsys.readouterr().out
    cached_library(replace(config, seed=2), path)
    assert len(built) == 2
    assert "is of another config" in capsys.readouterr().out
    monkeypatch.setattr("gaitchain.cli.library_cache.code_digest", lambda: "edited")
    cached_library(replace(config, seed=2), path)
    assert len(built) == 3
    assert "was built by other code" in capsys.readouterr().out
    save_library(replace(library, config=replace(config, seed=2)), path)
    path.write_bytes(path.read_bytes())
    cached_library(replace(config, seed=2), path)
    assert len(built) == 3  # the same bytes
    judged = replace(library, config=replace(config, seed=2), version="as qualified")
    save_library(judged, path)
    assert cached_library(replace(config, seed=2), path)[0].version == "as qualified"
    mine = path.read_bytes()
    with pytest.raises(LibraryError, match="or robot; it is not as it was"):
        cached_library(config, path)
    path.with_name("res.gait.made-by").unlink()
    for content in (mine, mine[:-1], b"mine"):
        path.write_bytes(content)
        with pytest.raises(LibraryError, match="so it stays: name it as the library"):
            cached_library(replace(config, seed=2), path)
        assert path.read_bytes() == content
    assert len(built) == 3
    path.write_bytes(mine)
    note = path.with_name("res.gait.made-by")
    note.write_bytes(b"\xff\xfe" * 40)
    with pytest.raises(LibraryError, match="so it stays: name it as the library"):
        cached_library(config, path)
    note.unlink()
    note.mkdir()
    with pytest.raises(LibraryError, match="so it stays: name it as the library"):
        cached_library(config, path)
    path.unlink()
    with pytest.raises(CommandError, match="made-by: cannot be written: Is a dir"):
        cached_library(config, path)


@pytest.mark.parametrize(
    "words",
    [
        "walk ring",
        "walk --out ring",
        "walk res --json ring",
        "inspect ring",
        "explain ring",
        "replay ring",
        "serve ring",
        "serve res --log ring.mcap",
        "export res --to c -o ring",
        "build res -o ring",
    ],
)
@pytest.mark.skipif(os.name == "nt", reason="links of POSIX")
def test_a_ring_of_links_is_one_line(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("ring", "ring.mcap"):
        Path(name).symlink_to(name)
    code, _, error = call(capsys, *words.split())
    assert code == 2
    (line,) = error.splitlines()
    name = "ring.mcap" if "ring.mcap" in words else "ring"
    assert line.startswith(f"gaitchain: {name}: cannot be ")
    assert "Too many levels of symbolic links" in line


@pytest.mark.parametrize("verb", ["walk", "serve", "trial", "qualify", "push"])
def test_a_device_is_no_library(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    output = ["-o", "x.gait"] if verb == "qualify" else []
    code, _, error = call(capsys, verb, os.devnull, *output)
    assert code == 2
    (line,) = error.splitlines()
    assert line.startswith(f"gaitchain: {os.devnull}: cannot be read: it is no regular")


def test_the_code_that_builds_has_a_digest_of_its_own(tmp_path, monkeypatch):
    def digest():
        code_digest.cache_clear()
        return code_digest()

    package = tmp_path / "gaitchain"
    shutil.copytree(Path(gaitchain.__file__).parent, package)
    monkeypatch.setattr("gaitchain.build.journal.files", lambda _: package)
    first = digest()
    for name in ("cli/walk.py", "service/settings.py", "backends/ros/link.py"):
        (package / name).write_text("# other")
        assert digest() == first
    found = {first}
    for name in ("build/grid.py", "backends/mujoco.py", "data/res.toml", "new.py"):
        (package / name).write_text("# other")
        found.add(digest())
    assert len(found) == 5
    for name in ("mujoco", "numpy", "numba", "scipy", "cmaes"):
        monkeypatch.setattr(
            "gaitchain.build.journal.version",
            lambda asked, other=name: "99" if asked == other else version(asked),
        )
        found.add(digest())
    assert len(found) == 10, "engines of another version may give other results"
    monkeypatch.undo()
    code_digest.cache_clear()


def test_a_build_begins_anew_where_the_file_has_other_contacts(
    tmp_path, monkeypatch, capsys
):
    """The robot that walks is the same, the verdict in its own model is not."""

    def interrupt(*unused):
        raise KeyboardInterrupt

    monkeypatch.setattr("gaitchain.cli.build.build_library", interrupt)
    file, library = tmp_path / "toy.xml", tmp_path / "toy.gait"
    headers, said = [], []
    for second, friction in enumerate((1.0, 1.0, 0.2)):
        geom = f'<default><geom friction="{friction}"/>'
        file.write_text(toy().replace("<default>", geom), "utf-8")
        os.utime(file, (second, second))
        code, out, _ = call(capsys, "build", file, "-o", library, "--workers", 1)
        assert code == 130
        said.append(" ".join(out.split()))
        headers.append((tmp_path / "toy.gait.build.jsonl").read_bytes())
    assert headers[0] == headers[1] != headers[2]
    assert not re.search("going on|starting anew", said[0])
    assert "kept here until the end" in said[1], "nothing of it was finished"
    assert "of other work or code; starting anew" in said[2]


def test_a_build_goes_on_when_a_full_disk_has_room_again(tmp_path, monkeypatch, capsys):
    """It ended in a traceback."""

    def build(*unused):
        numbers = [(float(n),) for n in range(400)]
        with full_disk(4000):
            list(run_jobs(math.sqrt, numbers, float, 1))

    monkeypatch.setattr("gaitchain.cli.build.build_library", build)
    said = []
    for _ in range(2):
        code, out, err = call(capsys, "build", "res", "-o", tmp_path / "a.gait")
        assert code == 2
        assert "a.gait.build.jsonl: cannot be written" in err
        said.append(" ".join(out.split()))
    assert "what is finished; the same command goes on from there" in said[0]
    assert re.search("going on after [1-9][0-9]+ finished pieces", said[1])


@pytest.mark.slow
def test_interrupt_is_quiet(tmp_path):
    # Only on a terminal is the bar drawn while the work goes on.
    terminal, stderr = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "build", "res", "-o", str(tmp_path / "res.gait")],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "200"},
        start_new_session=True,
    )
    os.close(stderr)
    # As soon as a walk is done, physics has begun and most of it is to come; there are
    # rounds of walks.
    err = b""
    while not re.search(rb"training in physics[^\r\n]*\b[1-9]\d*/\d+", err):
        err += os.read(terminal, 4096)
    os.kill(process.pid, signal.SIGINT)
    with contextlib.suppress(OSError):  # a terminal that all have closed
        while more := os.read(terminal, 4096):
            err += more
    os.close(terminal)
    assert process.wait(timeout=30) == 130
    assert b"gaitchain: interrupted" in err
    assert b"Traceback" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["res.gait.build.jsonl"]


def test_a_library_for_another_robot_is_refused(library_path, tmp_path, capsys):
    text = (resources.files("gaitchain") / "data" / "res.toml").read_text()
    path = tmp_path / "heavy.toml"
    path.write_text(text.replace("value = 16.0", "value = 18.0"))
    code, _, err = call(
        capsys, "walk", library_path, "--robot", path, "--out", tmp_path
    )
    assert code == 2
    assert "trunk_mass 16 / 18" in err


def test_an_output_that_cannot_be_written_is_told_before_the_walk(
    library_path, tmp_path, capsys
):
    (tmp_path / "walk.html").mkdir()
    code, _, err = call(
        capsys, "walk", library_path, "--out", tmp_path
    )  # fmt: skip
    assert code == 2
    assert "walk.html" in err
    assert not (tmp_path / "walk.json").exists()


def test_version(capsys):
    code, out, _ = call(capsys, "--version")
    assert code == 0
    assert out.startswith("gaitchain 0.")
