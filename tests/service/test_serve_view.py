"""A real Chromium and service: the 3-D view is killed; a click sends the robot."""

import math

import pytest
from page_browser import NOT_OURS, Driver
from running_service import Service

pytestmark = pytest.mark.browser
# What a browser says while a part of the service is dead.
_LOST = ("Failed to load resource", "WebSocket connection to")
_PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}
_DESK = {"viewport": {"width": 1440, "height": 900}, "device_scale_factor": 0.5}


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    service = Service("--rate", "100", folder=tmp_path_factory.mktemp("view"))
    yield service
    service.kill_all()


@pytest.fixture
def address(service):
    return service.address


def viewers(service):
    """How many browsers the 3-D view draws for."""
    return service.client.get("api/v1/health").json()["viewers"]


def connected(service):
    state = service.state
    return state is not None and state["view"] is not None and viewers(service) == 1


@pytest.mark.slow
@pytest.mark.parametrize("part", ["viewer", "api"])
def test_the_view_comes_back_by_itself(service, visit, see, part):
    page = visit(foreseen=(*NOT_OURS, *_LOST), **_DESK)
    page.locator("#take").focus()  # viser itself would only retry with the focus
    service.until(lambda: connected(service))
    killed = service.kill(part)
    service.until(lambda: service.part(part) not in (None, killed))
    drawn = service.part("viewer")
    service.until(lambda: (service.state or {}).get("view") == drawn)
    service.until(lambda: connected(service))
    see(page.locator("#view-stale")).to_be_hidden()
    see(page.locator("#mode")).to_have_text("Standing")


@pytest.mark.slow
def test_on_a_phone_the_views_own_panel_does_not_hide_the_robot(service, visit, see):
    page = visit(foreseen=NOT_OURS, **_PHONE)
    page.click("#view-toggle")
    service.until(lambda: viewers(service) >= 1)
    view = page.frame_locator("#viewer")
    label = view.get_by_text("Follow the robot")
    see(label).to_have_count(1)
    see(label).to_be_hidden()
    see(view.locator("canvas").first).to_be_visible()


@pytest.mark.slow
def test_a_click_on_the_floor_sends_the_robot_there(service, visit, see):
    page = visit(foreseen=NOT_OURS, **_DESK)
    page.click("#view-toggle")  # drawing in software would take the processor
    service.until(lambda: service.mode("standing"))
    person, goals = Driver(page), []

    def send():
        box = page.locator("#floor").bounding_box()
        metre = min(box["width"], box["height"]) / 4.0  # 2 m from the robot to the edge
        middle = box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0
        page.mouse.click(middle[0] - 0.2 * metre, middle[1] - 0.4 * metre)

    def arrived():
        going = (service.state or {}).get("going")
        goals.extend([going["goal"]] if going else [])
        return "arrived" in page.locator("#going").inner_text()

    person.until(service, send, arrived)
    assert goals[0][:2] == pytest.approx((0.4, 0.2), abs=0.03)
    goal = goals[-1]
    x, y = service.state["scene"]["trunk"][:2]  # as the simulator knows it
    assert math.hypot(x - goal[0], y - goal[1]) < 0.06
    page.keyboard.press("w")
    service.until(lambda: service.state["going"] is None)
