"""What `gaitchain serve` refuses before it starts a part or makes a log."""

import sys

import pytest
from commands import call

import gaitchain.cli.serve


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
