"""`gaitchain qualify --bound --splitting`: the table, the verdict and the exit code."""

import json
from dataclasses import replace

import pytest

from gaitchain.build.journal import Journal
from gaitchain.cli import run, splitting
from gaitchain.proof.split_walks import SplitSize
from gaitchain.proof.splitting import Chance

SMALL = SplitSize(paths=4, repetitions=2, alone=4)


def asked(folder, *words):
    """Run the command; return its exit code and facts."""
    facts = folder / "facts.json"
    words = *words, "--workers", "1", "--json", str(facts)
    code = run(["qualify", "res", *words, "-o", str(folder / "S.gait")])
    return code, json.loads(facts.read_text())


def test_a_robot_that_always_falls_does_not_pass(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(splitting, "SplitSize", lambda: SMALL)
    code, facts = asked(tmp_path, "--bound", "0.01", "--splitting", "1.5")
    assert code == 1
    assert facts["per_walk"]["mean"] == 1.0
    assert facts["per_step"]["high"] > 0.01
    assert (facts["alone"], facts["agrees"]) == ([4, 4], True)
    said = capsys.readouterr().out
    assert "brute force, 4 other walks, 4 fell" in said
    assert "splitting and brute force agree" in said
    assert "not shown to be fewer than 0.01 falls" in said
    assert not list(tmp_path.glob("*.jsonl")), "the journal is removed"


@pytest.mark.parametrize("agrees", [True, False])
def test_what_brute_force_does_not_agree_with_does_not_pass(
    agrees, tmp_path, monkeypatch, capsys
):
    split = splitting.split_falls

    def seldom(*job):
        few = Chance(1e-6, 0.0, 2e-6)
        return replace(split(*job), per_step=few, agrees=agrees)

    monkeypatch.setattr(splitting, "SplitSize", lambda: SMALL)
    monkeypatch.setattr(splitting, "split_falls", seldom)
    code, _ = asked(tmp_path, "--bound", "0.01", "--splitting", "1.5")
    assert code == int(not agrees)
    assert ("do not agree" in capsys.readouterr().out) == (not agrees)


def test_another_bound_goes_on_and_says_by_what_the_walks_were_judged(
    tmp_path, monkeypatch, capsys
):
    """So does another confidence, on which no walk depends."""
    keep = Journal.add

    def stop(self, finished):
        keep(self, finished)
        raise KeyboardInterrupt

    monkeypatch.setattr(splitting, "SplitSize", lambda: SMALL)
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", stop)
        words = ["--bound", "0.001", "--splitting", "1.5", "--workers", "1"]
        words += ["-o", str(tmp_path / "S.gait")]
        assert run(["qualify", "res", *words]) == 130
    capsys.readouterr()
    other = "--bound", "0.01", "--splitting", "1.5", "--confidence", "0.9"
    _, facts = asked(tmp_path, *other)
    said = capsys.readouterr().out
    assert "going on after 1 finished pieces" in said
    assert "0.001 with 95 % confidence in walks of 10 s" in said
    assert facts["before"] == [{"bound": 0.001, "confidence": 0.95, "seconds": 10.0}]
    assert facts["confidence"] == 0.9
