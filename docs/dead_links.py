"""Look for dead links and anchors in the built site: `python docs/dead_links.py SITE`.

Links between pages, to pictures, styles and frames; nothing is fetched from elsewhere.
"""

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from bs4 import BeautifulSoup, Tag


def dead_links(site: Path) -> Iterator[str]:
    """Yield "page: link" for each that leads nowhere within the site."""
    for page in sorted(site.glob("*.html")):
        for link in sorted(_links(page)):
            parts = urlsplit(link)
            if not parts.scheme and not parts.netloc and not _leads(page, link):
                yield f"{page.name}: {link}"


@cache
def _parsed(page: Path) -> BeautifulSoup:
    return BeautifulSoup(page.read_text("utf-8"), "html.parser")


def _tags(page: Path) -> Iterator[Tag]:
    yield from (tag for tag in _parsed(page).find_all() if isinstance(tag, Tag))


def _links(page: Path) -> set[str]:
    given = [tag.get(name) for tag in _tags(page) for name in ("href", "src")]
    return {str(link) for link in given if link}


@cache
def _anchors(page: Path) -> set[str]:
    return {str(tag["id"]) for tag in _tags(page) if tag.get("id")}


def _leads(page: Path, link: str) -> bool:
    parts = urlsplit(link)
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if not target.is_file():
        return False
    anchor = unquote(parts.fragment)
    return target.suffix != ".html" or not anchor or anchor in _anchors(target)


if __name__ == "__main__":
    built = Path(sys.argv[1])
    if not (built / "index.html").is_file():
        sys.exit(f"{built}: no built site; first `sphinx-build -W docs {built}`")
    dead = list(dead_links(built.resolve()))
    print(*dead, f"{len(dead)} dead links", sep="\n")
    sys.exit(bool(dead))
