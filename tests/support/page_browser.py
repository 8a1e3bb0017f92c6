"""A real headless Chromium for tests, with what it complains of."""

from contextlib import contextmanager
from pathlib import Path

import pytest
from patience import PATIENCE_S

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [  # software WebGL, and none of the browser's own network traffic
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
WAIT_MS = 1000.0 * PATIENCE_S
# What the 3-D view's library warns of, and WebGL without a graphics card.
NOT_OURS = ("THREE.", "[.WebGL")
# A 3-D view in software draws as often as it can, and takes a core by itself: page and
# robot then come too late to drive by. The view is the page's frame, and the view only
# draws four times a second here.
SPARING = """if (window !== top) {
  const soon = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => setTimeout(() => soon(draw), 250);
  window.cancelAnimationFrame = clearTimeout;
}"""


@contextmanager
def chromium():
    """Run the browser; skip the test where there is none."""
    api = pytest.importorskip("playwright.sync_api")
    if not CHROMIUM.exists():
        pytest.skip(f"no {CHROMIUM}")
    with api.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        api.expect.set_options(timeout=WAIT_MS)
        yield browser
        browser.close()


class Watched:
    """A page, what it asked for, and what went wrong in it."""

    def __init__(self, browser, address, heard=("error", "warning"), **options):
        self.address, self._heard = address, heard
        self.context = browser.new_context(**options)
        self.context.add_init_script(SPARING)
        self.page = self.context.new_page()
        self.page.set_default_timeout(WAIT_MS)
        self.wanted, self.errors = [], []
        page = self.page
        page.on("request", lambda request: self.wanted.append(request.url))
        page.on("websocket", lambda socket: self.wanted.append(socket.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._note)

    def _note(self, message):
        if message.type in self._heard:
            self.errors.append(message.text)

    def open(self):
        """Load the page; return it."""
        self.page.goto(self.address)
        return self.page

    def check(self, foreseen=()):
        """Refuse complaints, but those that begin as foreseen, and foreign requests."""
        complaints = [text for text in self.errors if not text.startswith(foreseen)]
        assert not complaints, complaints
        ws, blob = self.address.replace("http", "ws", 1), f"blob:{self.address}"
        ours = self.address, ws, blob
        foreign = [url for url in self.wanted if not url.startswith(ours)]
        assert not foreign, foreign


class Driver:
    """A person who drives by a page, and takes the wheel again after a lost connection.

    A page that stood still for seconds, as on a busy machine, loses both, and leaves
    taking the wheel again to the person.
    """

    def __init__(self, page):
        self.page, self.again, self.takes, self.drove = page, 0, 0, False
        page.on("websocket", self.connects)

    def connects(self, _):
        self.again += 1

    def drives(self):
        """Whether the page has the wheel, which is taken where it has not."""
        drove = self.drove
        self.drove = self.page.locator("#wheel-state").inner_text() == "You drive."
        self.takes += self.drove and not drove
        if not self.drove and self.page.locator("#take").is_visible():
            self.page.locator("#take").dispatch_event("click")
        return self.drove

    def holds(self, key):
        """Whether a key is held while the page drives; pressed anew after a loss."""
        if self.drives():
            self.page.keyboard.down(key)
            return True
        self.page.keyboard.up(key)
        return False

    def until(self, service, act, seen):
        """Act while the page drives, and again after a lost connection, until seen."""
        acted = None

        def done():
            nonlocal acted
            if seen():
                return True
            if self.drives() and acted != self.again:
                acted = self.again
                act()
            return False

        service.until(done)
