"""Refuse options that belong to another way of running the same verb."""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

from gaitchain.cli.option_name import option_name
from gaitchain.errors import CommandError


def refuse(options: Any, names: Iterable[str], why: str) -> None:
    """Refuse options that are not as they are by default.

    Args:
        options: the verb's, as they were given.
        names: fields of them.
        why: what they are of, after the option and a colon.

    Raises:
        CommandError: one of them was set.
    """
    known = {field.name: field for field in fields(options)}
    for name in names:
        if getattr(options, name) != known[name].default:
            raise CommandError(f"{option_name(known[name])}: {why}")
