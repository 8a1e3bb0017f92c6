"""`gaitchain qualify --bound --splitting`: the table, the verdict and the exit code."""

import json
from dataclasses import replace

import pytest

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
