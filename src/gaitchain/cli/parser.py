"""Parse the command line into a verb's options, dataclasses read by tyro."""

import contextlib
import difflib
import io
import os
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal, TextIO, cast, get_args, get_origin

import tyro

from gaitchain.cli.option_name import is_positional, option_name
from gaitchain.cli.options import VERBS, Options
from gaitchain.cli.streams import written_to
from gaitchain.errors import CommandError
from gaitchain.gait.limits import Limits, declared, exact

# What tyro says of a word that is no number, with Python's own words.
_NO_NUMBER = re.compile(
    r"Error parsing (--\S+): .*?(int\(\) with base 10|string to float): '(.*?)'"
)
# Of the choices that tyro names the order changes, and one is None.
_NO_CHOICE = re.compile(
    r"invalid choice '(?P<word>.*?)' for argument '(?P<option>--\S+)'"
    r"|parsing (?P<of>--\S+): no type matching \S+ could be .*? \['(?P<none>.*?)'\]"
)
_HELPTEXT = re.compile(r"\.? For full helptext, run gaitchain --help")
_DESCRIPTION = (
    "Online humanoid walking from a Markov chain of key poses, checked by physics. "
    "`gaitchain --version` says which version this is."
)


def parse(arguments: Sequence[str]) -> Options:
    """Parse the words after `gaitchain`.

    Raises:
        CommandError: the words are no command; the message is one line.
    """
    words = list(arguments) or ["--help"]
    _check_names(words)
    complaint, answer = io.StringIO(), io.StringIO()
    # tyro checks only the terminal, not NO_COLOR, before it colours its help.
    plain = answer if os.environ.get("NO_COLOR") else sys.stdout
    try:
        with written_to(sys.stdout), contextlib.redirect_stderr(complaint):
            options = _read(words, plain)
            _check_numbers(options)
            _check_port(options)
            return options
    except SystemExit as stop:
        if stop.code:
            raise CommandError(_complaint(complaint.getvalue(), words[0])) from None
        with written_to(sys.stdout):
            print(answer.getvalue(), end="")
    raise SystemExit(0)  # after help


def _read(words: Sequence[str], shown: TextIO) -> Options:
    """Let tyro read the words, or write its help to a stream."""
    with contextlib.redirect_stdout(shown):
        options = tyro.extras.subcommand_cli_from_dict(
            {**VERBS},
            prog="gaitchain",
            description=_DESCRIPTION,
            args=words,
            config=(tyro.conf.DisallowNone,),  # what is left out is not given
        )
    return cast(Options, options)


def _check_names(words: Sequence[str]) -> None:
    """Refuse unknown verbs and options, and flags with a value.

    The message has the nearest names.
    """
    verb = words[0]
    if verb.startswith("-"):
        return
    if verb not in VERBS:
        raise CommandError(f"{verb}: no such verb{_nearest(verb, VERBS)}")
    known = _types(VERBS[verb])
    for word in words[1:]:
        option, valued, _ = word.partition("=")
        option = option.replace("_", "-")
        if valued and bool in get_args(known.get(option)):
            raise CommandError(
                f"{word}: it takes no value; give {option}, or leave it out"
            )
        if not option.startswith("--") or option in {*known, "--help"}:
            continue
        if option == "--library":
            raise CommandError(
                f"--library: give the library itself: gaitchain {verb} FILE.gait"
            )
        raise CommandError(f"{option}: no option of {verb}{_nearest(option, known)}")


def _types(options: Any) -> dict[str, Any]:
    """Return the types of a verb's options, those of its groups too, by `--name`."""
    found: dict[str, Any] = {}
    for option in fields(options):
        if is_dataclass(option.default):
            found |= _types(option.default)
            continue
        if not is_positional(option):
            found[option_name(option)] = option.type
    return found


def _choices(kind: Any) -> list[str]:
    """Return the words that an option's type allows, in the order it declares."""
    parts = get_args(kind)
    if get_origin(kind) is Literal:
        return [str(word) for word in parts]
    return [word for part in parts for word in _choices(part)]


def _nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the nearest known words, or with all of them."""
    near = difflib.get_close_matches(word, known, n=2, cutoff=0.5)
    if near:
        return f"; did you mean {' or '.join(near)}?"
    return f"; there are {', '.join(sorted(known))}"


def _check_numbers(options: Any) -> None:
    """Refuse a number outside the limits that its option declares."""
    own = {field.name: field for field in fields(options)}
    for name, limits in declared(type(options), Limits).items():
        value = getattr(options, name)
        if value is not None and not limits.hold(value):
            raise CommandError(
                f"{option_name(own[name])} {exact(value)}: give {limits}"
            )


def _check_port(options: Any) -> None:
    """Refuse an empty port, as of a variable that is not set."""
    if getattr(options, "port", None) == "":
        raise CommandError("--port '': give a serial port, as /dev/ttyUSB0")


def _complaint(box: str, verb: str) -> str:
    """Return what is wrong, of a word that is no number or choice what would do."""
    said = _HELPTEXT.sub(f"; see gaitchain {verb} --help", _one_line(box))
    if verb in VERBS and (found := _NO_CHOICE.search(said)):
        option, word = found["option"] or found["of"], found["word"] or found["none"]
        kind = _types(VERBS[verb])[option]
        if choices := ", ".join(_choices(kind)):
            return f"{option} {word}: give one of {choices}"
    found = _NO_NUMBER.search(said)
    if found is None or verb not in VERBS:
        return said
    option, kind, word = found.groups()
    own = {option_name(field): field.name for field in fields(VERBS[verb])}
    limits = declared(VERBS[verb], Limits).get(own.get(option, ""))
    what = "a whole number" if kind.startswith("int") else "a number"
    span = f", {replace(limits, whole=False)}" if limits else ""
    return f"{option} {word}: give {what}{span}"


def _one_line(box: str) -> str:
    """Extract the text of tyro's framed message, without title and rulers."""
    without_colour = re.sub(r"\x1b\[[0-9;]*m", "", box)
    # Without Unicode, and for NO_COLOR, the frame is a title with a ruler below it.
    untitled = re.sub(r"(?m)^ \S.*\n -+ *$", "", without_colour)
    lines = [line.strip("│ ") for line in untitled.splitlines()]
    return " ".join(line for line in lines if line.strip("-") and line[0] not in "╭╰─")
