"""`export` as a user calls it."""

import json

import pytest
from commands import call

from gaitchain.errors import ExportError
from gaitchain.export import compiler


def test_export_writes_and_tries_the_code(capsys, tmp_path):
    code, out, _ = call(capsys, "export", "res", "--to", "c", "-o", tmp_path / "c")
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "c").iterdir()) == [
        "demo.c",
        "gait.c",
        "gait.h",
    ]
    assert "one control period" in out
    assert "state of a robot" in out


def test_export_says_what_it_measured(capsys, tmp_path):
    code, out, _ = call(
        capsys, "export", "res", "--to", "c", "-o", tmp_path, "--json", "-"
    )
    found = json.loads(out)
    assert code == 0
    assert 0.0 < found["period_us"] < 1e4
    assert 1000 < found["state_bytes"] < found["code_bytes"]


def test_without_a_compiler_it_only_writes(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_COMPILERS", ("no-such-compiler",))
    monkeypatch.delenv("CC", raising=False)
    code, out, _ = call(capsys, "export", "res", "--to", "c", "-o", tmp_path)
    assert code == 0
    assert "not tried: no C compiler here" in out


def test_the_variable_cc_may_have_flags(monkeypatch):
    monkeypatch.setattr(compiler.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setenv("CC", "ccache gcc -DNAME='a b'")
    assert compiler.find_compiler() == ["/usr/bin/ccache", "gcc", "-DNAME=a b"]


@pytest.mark.parametrize(
    ("value", "why"),
    [("no-such-cc -O2", "no program 'no-such-cc' here"), ("cc 'x", "No closing")],
)
def test_a_variable_cc_that_names_no_program_is_refused(monkeypatch, value, why):
    monkeypatch.setenv("CC", value)
    with pytest.raises(ExportError, match=why):
        compiler.find_compiler()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("nobody", "--to", "c"), "no such file"),
        (("res", "--to", "fortran"), "fortran"),
    ],
)
def test_what_cannot_be_exported_is_refused(capsys, tmp_path, words, why):
    code, _, err = call(capsys, "export", *words, "-o", tmp_path)
    assert code == 2
    assert why in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("c --grid 1,1,1", "--grid: of motions, which --to c does not walk"),
        ("c --seconds 5", "--seconds: of motions, which --to c does not walk"),
        (
            "c --own-model res.xml",
            "--own-model: of motions, which --to c does not walk",
        ),
        ("c --rate 100", "--rate: of motions, which --to c does not walk"),
        ("npz --no-try", "--no-try: of --to c, and no option of --to npz"),
    ],
)
def test_options_of_another_format_are_refused(capsys, tmp_path, words, why):
    out = tmp_path / "out.npz"
    code, _, err = call(capsys, "export", "res", "--to", *words.split(), "-o", out)
    assert (code, err) == (2, f"gaitchain: {why}\n")
    assert not out.exists()


def test_a_folder_that_cannot_be_made_is_refused(capsys, tmp_path):
    (tmp_path / "file").write_text("", "utf-8")
    code, _, err = call(
        capsys, "export", "res", "--to", "c", "-o", tmp_path / "file" / "c"
    )
    assert code == 2
    assert "no such folder can be made" in err
