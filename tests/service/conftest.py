"""What tests of the page have in common: a browser, and pages that may not complain."""

import pytest
from page_browser import Watched, chromium
from page_server import served


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture
def address(server):
    """Where the module's `server` of the page listens."""
    with served(server.app) as found:
        yield found


@pytest.fixture
def visit(browser, address):
    """Open pages; in the end none may have complained or asked another server.

    What a test makes a page complain of begins with one of `foreseen`; `prepare` is
    called with the browser's context before the page is opened.
    """
    visitors = []

    def come(*, foreseen=(), prepare=None, **options):
        visitor = Watched(browser, address, **options)
        visitors.append((visitor, foreseen))
        if prepare is not None:
            prepare(visitor.context)
        return visitor.open()

    yield come
    for visitor, _ in visitors:
        visitor.context.close()
    for visitor, foreseen in visitors:
        visitor.check(foreseen)


@pytest.fixture(scope="module")
def see():
    return pytest.importorskip("playwright.sync_api").expect
