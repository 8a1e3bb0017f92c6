"""A real Chromium drives the real service: RES walks, turns, is pushed and stopped."""

import math
from functools import partial

import pytest
from page_browser import NOT_OURS, Driver
from running_service import Service

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.live.logs.reader import read_log

pytestmark = pytest.mark.browser
_PHONE = {"viewport": {"width": 390, "height": 844}}  # its 3-D view stays closed
# A 3-D view in software takes two cores by itself, and the page then sends its commands
# too late to drive by; a quarter of its pixels leaves them time.
_DESK = {"device_scale_factor": 0.5}


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    # At 100 Hz two cores have time for a browser that draws in software.
    service = Service("--rate", "100", folder=tmp_path_factory.mktemp("browser"))
    yield service
    service.kill_all()


@pytest.fixture
def address(service):
    return service.address


def yaw(service):
    w, x, y, z = service.state["scene"]["trunk"][3:]
    return math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


def chosen(service):
    """The node of the chain that was chosen last; poses are numbered in their layer."""
    choice = service.state["choice"]
    return choice["layer"], choice["pose"], choice["left_support"]


def turned(service, before):
    return abs(math.remainder(yaw(service) - before, math.tau))


def disturb(service, person, second, see):
    """Let a payload and punches come and go; the log tells all."""
    page = person.page
    page.fill("#punches-most", "1")
    page.fill("#punches-every", "0.2")
    switch(service, person, on=True)
    see(second.locator("#disturbed")).to_have_text(
        "punches of up to 1 N s every 0.2 s, a payload of 10 % of the mass"
    )
    see(page.locator("#events")).to_contain_text("punch: a push of")
    switch(service, person, on=False)
    see(second.locator("#disturbed")).to_have_text("nothing but pushes")
    told = Disturbances(PunchesState(1.0, 0.2), "still", 0.1)
    service.until(lambda: told in logged(service, lambda row: [row.disturbances]))

    def texts():  # the log is written in chunks
        return logged(service, lambda row: [event.text for event in row.events])

    asked = {"payload 10 %", "punches of up to 1 N s every 0.2 s"}
    service.until(lambda: asked <= set(texts()))
    service.until(lambda: any(t.startswith("punch: a push of") for t in texts()))


def switch(service, person, *, on):
    """Turn payload and punches on or off, and wait until the robot says so."""
    for name, number in (("Payload", "payload"), ("Punches", "punches")):
        press = partial(person.page.get_by_role("switch", name=name).press, "Enter")

        def turned_so(number=number):
            return bool(service.state["disturbances"][number]) == on

        person.until(service, press, turned_so)


def logged(service, part):
    """What the log, which is still being written, has of its rows."""
    return [found for row in read_log(service.log).telemetries() for found in part(row)]


@pytest.mark.slow
def test_one_drives_and_the_other_watches(service, visit, see):
    page, second = (visit(foreseen=NOT_OURS, **size) for size in (_DESK, _PHONE))
    service.until(lambda: service.mode("standing"))

    person = Driver(page)
    driven = second.locator("#wheel-state")
    service.until(lambda: person.drives() and "watch" in driven.inner_text())

    mode = page.locator("#mode")
    service.until(lambda: person.holds("w") and mode.inner_text() == "Walking")
    service.until(
        lambda: person.holds("w") and service.state["scene"]["trunk"][0] > 0.3
    )
    why, choice = page.locator("#why"), chosen(service)
    said = why.inner_text()
    service.until(lambda: person.holds("w") and chosen(service) != choice)
    service.until(lambda: person.holds("w") and why.inner_text() != said)
    page.keyboard.up("w")

    before = yaw(service)
    service.until(lambda: person.holds("q") and turned(service, before) > 0.2)
    page.keyboard.up("q")
    service.until(lambda: service.mode("standing"))

    assert person.takes <= 1 + person.again, "it was never lost but with the link"

    second.keyboard.down("w")
    assert service.state["command"] == [0.0, 0.0, 0.0]
    second.keyboard.up("w")

    def pushed(words):
        return any(words in text for text in service.events("push"))

    push = page.locator("#dial button").first.click
    person.until(service, push, lambda: pushed("a push of"))
    see(page.locator("#events")).to_contain_text("a push of")
    page.select_option("#body", "left_crus")
    person.until(service, push, lambda: pushed("on left_crus"))
    see(page.locator("#events")).to_contain_text("on left_crus")

    disturb(service, person, second, see)
    second.click("#estop")
    see(page.locator("#mode")).to_contain_text("Stopped")
    service.until(lambda: service.mode("stopped"))
    assert "emergency stop by" in service.state["reason"]
