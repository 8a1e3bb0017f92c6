"""Parts of a page in one file, which takes nothing from elsewhere."""

import base64
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

_SMALLEST = 0.43  # of a picture's pixels, at which letters of 8 points can be read
_PNG_WIDTH = slice(16, 20)  # bytes of a PNG


def picture(parent: Any, file: Path, alt: str) -> None:
    """Append a PNG, its bytes in the page itself.

    Where a screen is narrow, it is to be scrolled (class "wide"), not shrunk.
    """
    png = file.read_bytes()
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    least = round(_SMALLEST * int.from_bytes(png[_PNG_WIDTH], "big"))
    frame = ElementTree.SubElement(parent, "div", {"class": "wide"})
    style = f"min-width:{least}px"
    ElementTree.SubElement(frame, "img", src=source, alt=alt, style=style)


def add(parent: Any, tag: str, text: str) -> Any:
    """Append an element with text; return it."""
    element = ElementTree.SubElement(parent, tag)
    element.text = text
    return element


def bullets(parent: Any, items: Iterable[str]) -> None:
    """Append a list."""
    own = ElementTree.SubElement(parent, "ul")
    for item in items:
        add(own, "li", item)


def table(parent: Any, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Append a table; without heads the first cell of a row names the second.

    Where a screen is narrow, a table with heads (class "wide") is to be scrolled within
    itself; in one of names and values (class "pairs") values are to be broken.
    """
    kind = "wide" if heads else "pairs"
    frame = ElementTree.SubElement(parent, "div", {"class": kind})
    own = ElementTree.SubElement(frame, "table")
    if heads:
        row = ElementTree.SubElement(own, "tr")
        for head in heads:
            add(row, "th", head)
    for cells in rows:
        row = ElementTree.SubElement(own, "tr")
        for cell in cells:
            add(row, "td", cell)
