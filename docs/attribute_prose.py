"""Attributes' docstrings as prose: napoleon takes what is before a colon for a type."""

from sphinx.application import Sphinx

_COLON = "\0"
_BEFORE, _AFTER = 499, 501  # napoleon reads docstrings at 500
_KINDS = ("attribute", "data", "property")


def setup(app: Sphinx) -> dict[str, bool]:
    """Hide the colons from napoleon."""
    app.connect("autodoc-process-docstring", _hide, _BEFORE)
    app.connect("autodoc-process-docstring", _show, _AFTER)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _hide(*event: object) -> None:
    _replace(event, ":", _COLON)


def _show(*event: object) -> None:
    _replace(event, _COLON, ":")


def _replace(event: tuple[object, ...], old: str, new: str) -> None:
    _app, kind, _name, _object, _options, lines = event
    if kind in _KINDS and isinstance(lines, list) and lines:
        lines[0] = lines[0].replace(old, new)
