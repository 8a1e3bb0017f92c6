"""What `gaitchain serve` refuses before it starts a part or makes a log."""

import io
import json
import os
import re
import sys
from pathlib import Path

import pytest
from commands import call

import gaitchain.cli.serve
from gaitchain.backends.mujoco import count_steps
from gaitchain.gait.library_file import save_library
from gaitchain.sim.world import World


@pytest.fixture
def begun(monkeypatch, tmp_path):
    """What was served; nothing is started."""
    served = []

    def serve(settings, **options):
        served.append(settings)
        return 0

    monkeypatch.setattr(gaitchain.cli.serve, "serve", serve)
    monkeypatch.chdir(tmp_path)
    return served


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--ros", "foo"], "zenoh, zenoh:tcp/HOST:7447 and ws://HOST:9090 are"),
        (["--ros", ""], "zenoh, zenoh:tcp/HOST:7447 and ws://HOST:9090 are"),
        (["--ros", "zenoh:tcp/robot"], "tcp/localhost:7447 works"),
        (["--ros", "ws://"], "ws://localhost:9090 works"),
        (["--ros-stamped"], "give --ros as well"),
        (["--backend", "ros:foo"], "zenoh, zenoh:tcp/HOST:7447 and ws://HOST:9090 are"),
        (["--backend", "ros-effort:ws:robot"], "ws://localhost:9090 works"),
        (["--backend", "dynamixel:/dev/ttyX"], "--port /dev/ttyX -o robot.toml"),
        (["--backend", "feetech:/dev/ttyX"], "--make feetech --port /dev/ttyX"),
        (["--calibration", "robot.toml"], "--backend mujoco has none"),
        (["--backend", "ros", "--calibration", "r.toml"], "--backend ros has none"),
        (["--log", "a.mcap", "--no-log"], "--log and --no-log: give one of them"),
        (["--no-log", "--log-size", "100"], "--log-size: of a log; leave out --no-log"),
        (["--no-log", "--log-files", "2"], "--log-files: of a log; leave out"),
        (["--backend", "ros", "--seed", "3"], "--seed: of a simulated world, which"),
        (["--log", "walk.log"], "walk.log: logs are MCAP; name it walk.mcap"),
        (["--log", "/proc/walk.mcap"], "/proc/walk.mcap: cannot be written"),
    ],
)
def test_what_no_part_could_open_is_refused_in_one_line(
    options, says, begun, tmp_path, capsys
):
    code, out, error = call(capsys, "serve", *options)
    assert (code, out) == (2, "")
    assert says in error
    assert len(error.splitlines()) == 1
    assert begun == []
    assert list(tmp_path.iterdir()) == []


def test_a_link_without_its_packages_is_refused_with_the_extra(
    begun, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, "zenoh", None)
    link = "gaitchain.backends.ros.zenoh_link"
    monkeypatch.delitem(sys.modules, link, raising=False)
    code, _, error = call(capsys, "serve", "--ros", "zenoh")
    assert code == 2
    assert "gaitchain[ros]" in error
    assert begun == []


@pytest.mark.parametrize(
    "options",
    [
        ["--ros", "zenoh"],
        ["--ros", "zenoh:tcp/robot:7447"],
        ["--ros", "ws://robot:9090"],
        ["--backend", "ros"],
        ["--backend", "ros-effort:wss://robot:9090"],
        ["--backend", "dynamixel:emulated"],
        ["--backend", "feetech:emulated"],
    ],
)
def test_what_can_be_opened_is_served(options, begun, capsys):
    code, _, error = call(capsys, "serve", *options)
    assert (code, error) == (0, "")
    (settings,) = begun
    assert options[1] in (settings.ros, settings.backend)


def test_logs_that_are_there_stay_and_the_next_one_is_named(begun, tmp_path, capsys):
    """Who explains `walk.mcap` after a second run would read the first one."""
    results = tmp_path / "results.json"
    words = "serve", "--log", "walk.mcap", "--json", results
    for name, stay in (
        ("walk.mcap", ""),
        ("walk-2.mcap", "walk.mcap: stays as it is"),
        ("walk-3.mcap", "walk.mcap and walk-2.mcap: stay as they are"),
        ("walk-4.mcap", "walk.mcap to walk-3.mcap: stay as they are"),
    ):
        code, out, _ = call(capsys, *words)
        assert code == 0
        assert out == (f"{stay}; this log is {name}\n" if stay else "")
        assert json.loads(results.read_text())["log"] == str(tmp_path / name)
        (tmp_path / name).write_bytes(b"a log")


def test_a_log_begins_above_files_whose_first_ones_have_gone(begun, tmp_path, capsys):
    for name in ("walk-9", "walk-10", "walk-x", "walker-99"):
        (tmp_path / f"{name}.mcap").touch()
    code, out, _ = call(capsys, "serve", "--log", "walk.mcap")
    assert (code, out) == (
        0,
        "walk-9.mcap and walk-10.mcap: stay as they are; this log is walk-11.mcap\n",
    )


def test_the_browser_is_not_given_a_token_that_was_kept_out_of_sight(
    monkeypatch, tmp_path, capsys
):
    given = []

    def serve(settings, *, shows_token, **options):
        given.append((settings.token, shows_token))
        return 0

    monkeypatch.setattr(gaitchain.cli.serve, "serve", serve)
    monkeypatch.setenv("GAITCHAIN_TOKEN", "of-the-variable")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "token"
    file.write_text("of-the-file\n")
    for words in ([], ["--token-file", str(file)], ["--token", "of-the-line"]):
        assert call(capsys, "serve", "--no-log", "--browser", *words)[0] == 0
    assert given == [
        ("of-the-variable", False),
        ("of-the-file", False),
        ("of-the-line", True),
    ]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--token", ""], "--token is empty"),
        (["--token-file", "empty"], "the first line of empty is empty"),
        (["--token-file", "blank"], "the first line of blank is empty"),
        (["--token-file", "-"], "the first line of standard input is empty"),
        ([], "the variable GAITCHAIN_TOKEN is empty"),
    ],
)
def test_an_empty_token_is_no_leave_to_serve_without_one(
    options, says, begun, monkeypatch, tmp_path, capsys
):
    """A secret that failed to arrive must not open the robot to everybody."""
    (tmp_path / "empty").touch()
    (tmp_path / "blank").write_text(" \nthe-second-line\n")
    monkeypatch.setenv("GAITCHAIN_TOKEN", "")
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    code, _, error = call(capsys, "serve", "--no-log", *options)
    assert code == 2
    assert f"the token: {says}; give 8 or more ASCII characters" in error
    assert begun == []


@pytest.mark.parametrize("line", [b"a" * 5000, bytes(5000), b"a\tb\tc\td\te"])
def test_a_token_is_a_short_line_of_what_can_be_typed(
    line, begun, monkeypatch, tmp_path, capsys
):
    """A device or a wrong file has no end, or no line."""
    (tmp_path / "token").write_bytes(line)
    monkeypatch.setattr(sys, "stdin", io.StringIO(line.decode()))
    for file in "token", "-":
        code, _, error = call(capsys, "serve", "--no-log", "--token-file", file)
        assert code == 2
        assert "the token: 8 to 256 printable ASCII characters, no blanks" in error
    assert begun == []


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="files of POSIX")
def test_a_token_may_come_through_a_pipe(begun, capsys):
    """As from a store of passwords, in a shell by `<(pass show robot)`."""
    end, begins = os.pipe()
    os.write(begins, b"a-long-secret\n")
    os.close(begins)
    words = "--token-file", f"/dev/fd/{end}"
    assert call(capsys, "serve", "--no-log", *words)[0] == 0
    os.close(end)
    assert begun[0].token == "a-long-secret"


@pytest.mark.parametrize("rate", ["99", "30", "20.1", "333", "499"])
def test_every_rate_that_a_message_names_is_served(rate, begun, capsys):
    code, _, error = call(capsys, "serve", "--no-log", "--rate", rate)
    assert code == 2
    named = re.findall(r"[\d.]+(?= or | Hz would do)", error)
    assert len(named) == 2
    for each in named:
        assert call(capsys, "serve", "--no-log", "--rate", each)[0] == 0
        period_s = 1.0 / begun.pop().rate_hz
        assert period_s / 0.002 == pytest.approx(round(period_s / 0.002), rel=1e-14)
        assert count_steps(1.0 / float(each), 0.002) == round(period_s / 0.002)


def test_a_rate_out_of_limits_is_not_named(begun, capsys, monkeypatch):
    monkeypatch.setattr(World, "timestep", 0.0004)
    error = call(capsys, "serve", "--no-log", "--rate", "950")[2]
    assert "0.4 ms; 833.3333 Hz would do" in error


@pytest.mark.parametrize(
    ("rate", "would"), [("130", "166.6667 or 125"), ("900", "500")]
)
def test_a_rate_that_its_own_model_cannot_keep_is_refused_with_one_that_it_can(
    rate, would, begun, toy_library, toy_path, tmp_path, capsys
):
    save_library(toy_library, tmp_path / "toy.gait")
    words = [str(tmp_path / "toy.gait"), "--no-log", "--own-model", str(toy_path)]
    code, _, error = call(capsys, "serve", *words, "--rate", rate)
    assert code == 2
    assert f"--rate {rate}: a control period" in error
    assert f"{would} Hz would do" in error
    assert begun == []
    assert call(capsys, "serve", *words, "--rate", "125")[0] == 0
    (settings,) = begun
    assert settings.rate_hz == 125.0
