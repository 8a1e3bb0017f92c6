"""The page's files: whole, small, and nothing in them that its policy forbids."""

import re
from html.parser import HTMLParser

import pytest
from page_server import PAGE

NAMESPACE = "http://www.w3.org/2000/svg"
SCRIPTS = sorted(PAGE.glob("*.js"))


class Markup(HTMLParser):
    """Collects ids, references to ids, links, and what runs or styles inline."""

    def __init__(self):
        super().__init__()
        self.ids, self.refers, self.links, self.inline = [], [], [], []

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            elif name in {"for", "aria-labelledby", "aria-describedby"}:
                self.refers += value.split()
            elif name in {"src", "href"}:
                self.links.append(value)
            elif name == "style" or name.startswith("on"):
                self.inline.append((tag, name))
        if tag == "script" and not any(name == "src" for name, _ in attrs):
            self.inline.append((tag, "text"))
        if tag == "style":
            self.inline.append((tag, "text"))


@pytest.fixture(scope="module")
def markup():
    parser = Markup()
    parser.feed((PAGE / "index.html").read_text("utf-8"))
    return parser


def test_nothing_runs_or_styles_inline(markup):
    assert markup.inline == []


def test_each_id_is_there_once_and_what_is_referred_to_is_there(markup):
    assert len(set(markup.ids)) == len(markup.ids)
    assert set(markup.refers) <= set(markup.ids)
    asked = re.findall(r'\bat\("([^"]+)"\)', (PAGE / "main.js").read_text("utf-8"))
    assert asked
    assert set(asked) <= set(markup.ids)


def test_every_file_that_is_asked_for_is_there(markup):
    for link in markup.links:
        if link.startswith("/page/"):
            assert (PAGE / link.removeprefix("/page/")).is_file(), link
        else:
            assert link.startswith(("#", "/")), link
    for script in SCRIPTS:
        for name in re.findall(r'from "\./([^"]+)"', script.read_text("utf-8")):
            assert (PAGE / name).is_file(), f"{script.name} asks for {name}"


def test_nothing_comes_from_elsewhere():
    for path in PAGE.iterdir():
        text = path.read_text("utf-8").replace(NAMESPACE, "")
        assert not re.search(r"(?:https?:)?//[a-z0-9.-]+\.[a-z]{2,}", text), path.name
        assert "eval(" not in text
        assert ".innerHTML" not in text


def test_the_page_is_light_and_its_modules_are_small():
    assert sum(path.stat().st_size for path in PAGE.iterdir()) < 136_000
    long = {
        path.name: lines
        for path in SCRIPTS
        if (lines := len(path.read_text("utf-8").splitlines())) > 200
    }
    assert not long


def test_text_is_readable_on_its_ground_in_both_schemes():
    light, dark = re.findall(
        r":root \{(.*?)\n *\}", (PAGE / "style.css").read_text("utf-8"), re.DOTALL
    )[:2]
    same = re.findall(r"--([a-z0-9-]+): var\(--([a-z0-9-]+)\);", light)
    for scheme in (light, dark):
        colours = dict(re.findall(r"--([a-z0-9-]+): (#[0-9a-f]{6});", scheme))
        colours |= {name: colours[other] for name, other in same}
        for name in ("ink", "muted", "accent", "good", "warn", "bad"):
            assert contrast(colours[name], colours["card"]) >= 4.5, name
        for name in ("off", "rising", "standing", "walking", "safe", "stopped"):
            assert contrast(colours[name], colours["card"]) >= 4.5, name
        for name in (*(f"trace-{i}" for i in range(1, 7)), "line-strong"):
            assert contrast(colours[name], colours["card"]) >= 3.0, name
        assert contrast("#ffffff", colours["stop"]) >= 4.5
        assert contrast(colours["accent-ink"], colours["accent"]) >= 4.5


def contrast(one, other):
    """Contrast ratio of WCAG 2."""
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour):
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [
        p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
