"""From words to a verb's options: tyro reads the dataclasses."""

import contextlib
import io
import re
from collections.abc import Sequence
from typing import cast

import tyro

from gaitchain.cli.options import VERBS, Options
from gaitchain.cli.serve_options import SERVICE_VERBS, ServiceOptions
from gaitchain.errors import CommandError

_DESCRIPTION = (
    "Online humanoid walking from a Markov chain of key poses, checked by physics."
)


def parse(arguments: Sequence[str]) -> Options | ServiceOptions:
    """Read the words after `gaitchain`.

    Raises:
        CommandError: the words are no command; in one line.
    """
    words = list(arguments) or ["--help"]
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            options = tyro.extras.subcommand_cli_from_dict(
                {**VERBS, **SERVICE_VERBS},
                prog="gaitchain",
                description=_DESCRIPTION,
                args=words,
            )
    except SystemExit as stop:
        if not stop.code:
            raise
        raise CommandError(_one_line(complaint.getvalue())) from None
    return cast(Options | ServiceOptions, options)


def _one_line(box: str) -> str:
    """Take tyro's framed message out of its box."""
    without_colour = re.sub(r"\x1b\[[0-9;]*m", "", box)
    text = re.sub(r"[│╭╮╰╯─┌┐└┘]+", " ", without_colour)
    return re.sub(r"\s+", " ", text).strip()
