"""The command line: `gaitchain` with its verbs."""

import sys
from collections.abc import Sequence
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any

import gaitchain
from gaitchain.cli.endings import (
    ended_as_by_hand,
    handlers_restored,
    ignore_later_ends,
)
from gaitchain.cli.options import verb_of
from gaitchain.cli.parser import parse
from gaitchain.cli.streams import open_missing, say_aside, told_of_lost, written_to
from gaitchain.errors import GaitchainError, needed_by, require

EXIT_OK, EXIT_FELL, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 0, 1, 2, 130
# What a verb needs beyond the core, checked before its modules are imported.
_ALWAYS = {
    "bench": ("sim",),
    "build": ("sim",),
    "explain": ("sim", "view", "serve"),
    "figures": ("sim", "view"),
    "get-up": ("sim",),
    "identify": ("sim",),
    "push": ("sim",),
    "qualify": ("sim",),
    "replay": ("sim", "view", "serve"),
    "serve": ("serve",),
    "trial": ("sim",),
    "walk": ("sim", "view"),
}
# Options that write a picture.
_PICTURES = {
    "push": ("output",),
    "qualify": ("map", "pages"),
    "identify": ("picture",),
    "get-up": ("replay",),
}
# Options that show a simulated robot in 3-D.
_VIEWS = {"calibrate": ("preview", "view"), "doctor": ("view",)}
_TALKS = "calibrate", "doctor"  # with a person beside the robot
_BACKENDS = {"mujoco": "sim", "dask": "dask", "ray": "ray"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one verb and exit: 0 done, 1 fell or not passed, 2 bad input, 130 Ctrl-C."""
    open_missing()
    code = _ended(sys.argv[1:] if arguments is None else list(arguments))
    ignore_later_ends()
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one verb.

    Args:
        arguments: the words after `gaitchain`.

    Returns:
        The exit code.
    """
    with handlers_restored():
        return _ended(arguments)


def _ended(arguments: Sequence[str]) -> int:
    """Run one verb and say how it ended, if not well; return the exit code."""
    try:
        with told_of_lost():
            return _run_verb(arguments)
    except GaitchainError as error:
        say_aside(f"gaitchain: {error}")
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        say_aside("gaitchain: interrupted")
        return EXIT_INTERRUPTED


def _run_verb(arguments: Sequence[str]) -> int:
    """Load a verb and run it; return the exit code."""
    if list(arguments) == ["--version"]:
        with written_to(sys.stdout):
            print(f"gaitchain {gaitchain.__version__}")
        return EXIT_OK
    options = parse(arguments)
    name = verb_of(type(options))
    require(f"`{name}`", extras_of(options))
    with needed_by(f"`{name}`"):
        # Imported here, so that each verb loads only its own heavy packages.
        console = import_module("gaitchain.cli.console")
        verb = import_module(f"gaitchain.cli.{name.replace('-', '_')}")
        if name != "warm-up":  # which fails of it
            _tell_of_compilation()
        talks = name in _TALKS
        with (
            ended_as_by_hand(once=talks),
            console.reporting(
                options.report, talks=talks, named=_named(options)
            ) as report,
        ):
            code, report.results = verb.run(options)
        return int(code)


def _tell_of_compilation() -> None:
    """Say on standard error if all is compiled anew each time, for a verb that does."""
    compiled = sys.modules.get("gaitchain.balance.compiled")
    if compiled is not None and (why := compiled.cache_trouble()):
        say_aside(f"gaitchain: {why}")


def extras_of(options: Any) -> list[str]:
    """Return the extras that a verb needs with these options.

    Extras for some robots only, such as `servos`, are checked when these are opened.
    """
    verb = verb_of(type(options))
    extras = [*_ALWAYS.get(verb, ())]
    if _any_given(options, _PICTURES.get(verb, ())):
        extras.append("view")
    if _any_given(options, _VIEWS.get(verb, ())):
        return ["sim", "view"]
    walks = getattr(options, "to", "c") != "c"  # motions are walked in physics
    if walks or getattr(options, "robot_hidden", None) is not None:
        extras.append("sim")
    backend = _BACKENDS.get(getattr(options, "backend", ""))
    return [*extras, backend] if backend else extras


def _named(options: Any) -> list[Path]:
    """Return all that may be a file among a verb's options: libraries are words."""
    values = vars(options).values()
    flat = chain.from_iterable(v if isinstance(v, tuple) else (v,) for v in values)
    return [Path(value) for value in flat if isinstance(value, str | Path)]


def _any_given(options: Any, names: Sequence[str]) -> bool:
    return any(getattr(options, name) is not None for name in names)
