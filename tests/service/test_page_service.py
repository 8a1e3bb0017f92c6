"""The page with the service's own API between it and a loop."""

import threading
from contextlib import contextmanager

import pytest
from page_browser import Watched, chromium
from page_server import CHOICE, VIEWER, served
from planned_library import planned_res
from telemetry_factory import told

from gaitchain.live.messages import Drive, EmergencyStop, LetGo, Mode
from gaitchain.service.api import make_app
from gaitchain.service.channel import LoopEnd
from gaitchain.service.settings import Settings

pytestmark = pytest.mark.browser
LIBRARY = planned_res()
FASTEST = LIBRARY.command_range.vx[1]
PERIOD_S, TICKS = 0.02, 5000


class Loop:
    """Publishes telemetry, and does what a loop does with the wheel alone."""

    def __init__(self, folder):
        self._end, self._ended = LoopEnd(folder), threading.Event()
        self.asked, self.driver, self.mode = [], "", Mode.STANDING
        self.command = 0.0, 0.0, 0.0

    def run(self):
        for tick in range(TICKS):
            for request in self._end.requests():
                self._take(request)
            walks = self.mode is Mode.WALKING
            self._end.publish(
                told(
                    LIBRARY.robot,
                    tick * PERIOD_S,
                    mode=self.mode,
                    driver=self.driver,
                    asked=self.command,
                    choice=CHOICE if walks else None,
                )
            )
            if self._ended.wait(PERIOD_S):
                break
        self._end.close()

    def _take(self, request):
        self.asked.append(request)
        if isinstance(request, Drive):
            self.driver = request.driver
            self.command = request.vx, request.vy, request.yaw_rate
            if self.mode is not Mode.STOPPED:  # one sent before the stop may come after
                self.mode = Mode.WALKING if request.vx else Mode.STANDING
        elif isinstance(request, LetGo):
            self.driver = ""
        elif isinstance(request, EmergencyStop):
            self.mode = Mode.STOPPED

    @contextmanager
    def running(self):
        thread = threading.Thread(target=self.run)
        thread.start()
        try:
            yield self
        finally:
            self._ended.set()
            thread.join()


def test_the_page_drives_and_stops_a_loop_through_the_api(tmp_path):
    see = pytest.importorskip("playwright.sync_api").expect
    app = make_app(Settings(library="", viewer_port=1), tmp_path, LIBRARY)
    loop = Loop(tmp_path)
    with loop.running(), served(app) as address, chromium() as browser:
        visitor = Watched(browser, address)
        visitor.context.route(
            "**/viewer/**",
            lambda route: route.fulfill(body=VIEWER, content_type="text/html"),
        )
        page = visitor.open()
        see(page.locator("#robot-name")).to_have_text(LIBRARY.robot.name)
        see(page.locator("#mode")).to_have_text("Standing")
        page.click("#take")
        see(page.locator("#wheel-state")).to_have_text("You drive.")
        page.keyboard.down("w")
        see(page.locator("#mode")).to_have_text("Walking")
        see(page.locator(".node.now")).to_have_count(1)
        see(page.locator("#vx-out")).to_have_text(f"{0.6 * FASTEST:.2f} m/s")
        see(page.locator("#asked")).to_contain_text(f"{0.6 * FASTEST:.2f}, 0.00 m/s")
        page.keyboard.up("w")
        see(page.locator("#mode")).to_have_text("Standing")
        see(page.locator("#vx-out")).to_have_text("0.00 m/s")
        page.keyboard.press("Space")
        see(page.locator("#mode")).to_have_text("Stopped")
        see(page.locator("#unconfirmed")).to_be_hidden()
        page.click("#let-go")
        see(page.locator("#wheel-state")).to_have_text("Nobody drives.")
        visitor.context.close()
        visitor.check()
    stops = [r for r in loop.asked if isinstance(r, EmergencyStop)]
    assert len(stops) == 2  # by the socket and by REST
    assert {stop.driver for stop in stops} == {
        next(r for r in loop.asked if isinstance(r, Drive)).driver
    }
    fastest = max(r.vx for r in loop.asked if isinstance(r, Drive))
    assert fastest == pytest.approx(0.6 * FASTEST)
