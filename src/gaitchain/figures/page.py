"""Parts of a page in one file, which takes nothing from elsewhere."""

import base64
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree


def picture(parent: Any, file: Path, alt: str) -> None:
    """Append a PNG, its bytes in the page itself."""
    data = base64.b64encode(file.read_bytes()).decode()
    source = f"data:image/png;base64,{data}"
    ElementTree.SubElement(parent, "img", src=source, alt=alt)


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
