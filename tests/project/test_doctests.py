"""What docstrings show of a call is what it gives."""

import doctest
import importlib
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src"
# Of hundreds of modules few have any; pytest's own search would import them all, in
# each of its processes.
SHOWING = [
    ".".join(file.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")
    for file in sorted(SOURCE.rglob("*.py"))
    if ">>>" in file.read_text("utf-8")
]


def test_some_docstrings_show_calls():
    assert SHOWING


@pytest.mark.parametrize("name", SHOWING)
def test_calls_give_what_docstrings_say(name):
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried
    assert not failed
