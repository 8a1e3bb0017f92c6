"""`gaitchain qualify --bound`: verdict, table, exit code, and going on."""

import json

import pytest

from gaitchain.build.journal import Journal
from gaitchain.cli import run
from gaitchain.gait.library_file import load_library

WORDS = ["--bound", "0.03", "--seconds", "4", "--workers", "1"]


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    folder = tmp_path_factory.mktemp("proof")
    out, report = folder / "P.gait", folder / "p.json"
    words = ["qualify", "res", *WORDS, "-o", str(out), "--json", str(report)]
    return run(words), out, json.loads(report.read_text())


def test_the_verdict_is_in_the_library_and_the_report(proven):
    code, out, facts = proven
    proof = load_library(out).qualification.proof
    assert code == 0
    assert (proof.verdict, facts["verdict"]) == ("below", "below")
    assert facts["total"]["falls"] == 0
    assert facts["bound"] == 0.03
    assert not list(out.parent.glob("*.jsonl")), "the journal is removed"


def test_inspect_shows_it(proven, capsys):
    assert run(["inspect", str(proven[1])]) == 0
    words = capsys.readouterr().out.replace("│", " ").split()
    assert "fewer than 0.03 falls per step" in " ".join(words)


def test_it_goes_on_after_an_interrupt(proven, tmp_path, monkeypatch, capsys):
    out, keep, kept = tmp_path / "P.gait", Journal.add, []

    def stop(self, finished):
        keep(self, finished)
        kept.append(finished)
        if len(kept) == 5:
            raise KeyboardInterrupt

    words = ["qualify", "res", *WORDS, "-o", str(out)]
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", stop)
        assert run(words) == 130
    assert "goes on from there" in capsys.readouterr().out
    assert not out.exists()
    assert run(words) == 0
    assert "going on after 5 finished pieces" in capsys.readouterr().out
    assert out.read_bytes() == proven[1].read_bytes()


def test_without_a_verdict_the_exit_code_is_1(tmp_path, capsys):
    words = ["qualify", "res", *WORDS, "-o", str(tmp_path / "P.gait")]
    assert run([*words, "--most-steps", "10"]) == 1
    assert "neither fewer nor more than 0.03 falls" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--bound", "0.03", "--quick"], "--quick: of the grid of worlds"),
        (["--bound", "0.03", "--map", "m.png"], "--map: of the grid of worlds"),
        (["--bound", "0.03", "--seeds", "2"], "--seeds: of the grid of worlds"),
        (["--most-steps", "9"], "--most-steps: of a bound on falls; give --bound"),
        (["--confidence", "0.9"], "--confidence: of a bound on falls"),
        (["--bound", "0.05"], "a walk may have less than 1 / bound, 20 steps"),
        (["--bound", "0"], "bound"),
        (["--bound", "0.03", "--confidence", "1"], "confidence"),
    ],
)
def test_what_makes_no_sense_is_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["qualify", "res", *words, "-o", str(tmp_path / "P.gait")]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
