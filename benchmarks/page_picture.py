"""Take the picture of the page in docs/images/page.png, of RES as it walks to a place.

Usage: python benchmarks/page_picture.py [--out FILE]. It needs Playwright, a Chromium
(`--chromium`), and time: a picture in which the loop does not keep its rate is not
taken, but it says that the computer is too busy.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "page.png"
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 1440, "height": 900}
WARNING = "Software WebGL rendering detected"  # of viser, where there is no GPU
TRIES = 40


@contextmanager
def service() -> Iterator[str]:
    """Serve RES in simulation; yield the page's address."""
    command = [sys.executable, "-m", "gaitchain", "serve", "--port", "0"]
    with tempfile.TemporaryDirectory() as folder:
        served = subprocess.Popen(
            [*command, "--log", f"{folder}/walk.mcap"],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            for line in served.stdout or ():
                if found := re.search(r"(http://\S+) \(Ctrl-C", line):
                    yield found.group(1)
                    return
            raise SystemExit("the service ended")
        finally:
            served.terminate()
            served.wait()


def walk(page: Page) -> None:
    """Let the robot walk to a place that is far enough."""
    page.wait_for_selector("#mode[data-mode=standing]", timeout=300_000)
    close = page.frame_locator("#viewer").get_by_role("alert").get_by_role("button")
    close.first.click(timeout=60_000)
    page.click("#take")
    page.get_by_text("You drive.").wait_for()
    page.fill("#place-x", "1.6")
    page.fill("#place-y", "0.5")
    page.click("#go")
    page.wait_for_selector("#mode[data-mode=walking]")


def picture(page: Page, out: Path) -> str:
    """Take the picture when all is green; return what the page says of the loop."""
    green = page.locator("#pace-fact[data-level=good]")
    for _ in range(TRIES):
        page.wait_for_timeout(1500)
        told = page.locator("#pace").inner_text()
        if green.count() and page.locator("#why .chosen-row").count():
            page.screenshot(path=out)
            if green.count():
                return told
    raise SystemExit(f"the computer is too busy for a picture: {told}")


def main() -> None:
    """Take it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PICTURE)
    parser.add_argument("--chromium", default="/usr/bin/chromium")
    options = parser.parse_args()
    with service() as address, sync_playwright() as tools:
        browser = tools.chromium.launch(
            executable_path=options.chromium, args=list(FLAGS)
        )
        page = browser.new_page(viewport=SIZE)
        page.goto(address)
        walk(page)
        told = picture(page, options.out)
        browser.close()
    Image.open(options.out).convert("RGB").save(options.out, optimize=True)
    print(f"{options.out}: {told}")


if __name__ == "__main__":
    main()
