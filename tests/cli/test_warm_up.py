"""`warm-up` as a user calls it, and as he ends it."""

import json
import os
import signal
from threading import Event

import pytest

from gaitchain.cli import run, warm_up
from gaitchain.cli.endings import ended_as_by_hand
from gaitchain.errors import WorkerError


@pytest.fixture(autouse=True)
def heard():
    """Tests that run in the background are told to ignore Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_it_says_where_the_machine_code_is(capsys):
    run(["warm-up"])
    capsys.readouterr()
    assert run(["warm-up", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bytes"] > 0
    assert "numba-" in found["folder"]


def test_ctrl_c_waits_for_no_compiler(monkeypatch, capsys):
    """It may have minutes to go."""
    never, begun = Event(), Event()

    def compiles(library, feedback):
        begun.set()
        never.wait()

    def pressed(seconds):
        begun.wait()
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(warm_up, "Walker", compiles)
    monkeypatch.setattr(warm_up.time, "sleep", pressed)
    assert run(["warm-up"]) == 130
    assert not never.is_set()
    assert "interrupted" in capsys.readouterr().err
    never.set()


def test_an_error_of_the_compiler_is_no_silence(monkeypatch):
    def fails(library, feedback):
        raise ZeroDivisionError

    monkeypatch.setattr(warm_up, "Walker", fails)
    with pytest.raises(ZeroDivisionError):
        run(["warm-up"])


@pytest.mark.parametrize("lacks", ["folder", "room"])
def test_machine_code_that_is_not_kept_is_an_error(lacks, monkeypatch, capsys):
    """Nothing else is asked of this command."""
    if lacks == "folder":
        monkeypatch.setattr(warm_up, "cache_folder", lambda: None)
    monkeypatch.setattr(warm_up, "cache_trouble", lambda: "set XDG_CACHE_HOME")
    assert run(["warm-up"]) == 2
    assert "set XDG_CACHE_HOME" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "ends"),
    [(RuntimeError, KeyboardInterrupt), (WorkerError, WorkerError)],
)
def test_an_interrupt_that_a_compiler_loses_is_one_all_the_same(error, ends):
    """Its callback has no caller to raise it in; what it was to make is missing."""

    def compiles():
        try:
            os.kill(os.getpid(), signal.SIGINT)
            Event().wait()
        except KeyboardInterrupt:
            pass
        raise error("no compiled object yet")

    with pytest.raises(ends), ended_as_by_hand(once=False):
        compiles()


def test_without_an_interrupt_an_error_is_what_it_is():
    with pytest.raises(RuntimeError, match="lost"), ended_as_by_hand(once=False):
        raise RuntimeError("lost")
