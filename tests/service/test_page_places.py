"""Places on the page in a real Chromium: a click on the floor, and what came of it."""

import math

import pytest
from page_server import PageServer
from planned_library import planned_res

from gaitchain.live.messages import Going, Mode
from gaitchain.walker.place import Place

pytestmark = pytest.mark.browser
LIBRARY = planned_res()
HERE = Place(1.0, 0.5, math.radians(90.0))
FEET = Place(1.0, 0.4), Place(1.0, 0.6)
KNOWN = {"place": HERE, "feet": FEET}
REACH = 2.0  # m from the robot to the nearer edge of the map, at first


@pytest.fixture
def server():
    server = PageServer(LIBRARY)
    server.set(mode=Mode.STANDING, **KNOWN)
    return server


@pytest.fixture
def page(visit):
    return visit()


def drive(server, page, see):
    page.click("#take")
    driver, _ = server.next_message("steer")
    server.set(mode=Mode.STANDING, driver=driver, **KNOWN)
    see(page.locator("#wheel-state")).to_have_text("You drive.")
    return driver


def spot(page, ahead, left):
    """Where on the screen a place is that is so far from the robot [m]."""
    canvas = page.locator("#floor")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    size = min(box["width"], box["height"]) / 2.0 / REACH
    across = box["x"] + box["width"] / 2.0 - left * size
    return across, box["y"] + box["height"] / 2.0 - ahead * size


def test_a_click_sends_the_robot_and_its_progress_is_shown(server, page, see):
    driver = drive(server, page, see)
    see(page.locator("#going")).to_have_text("at 1.00, 0.50 m, 90°")
    page.mouse.click(*spot(page, 1.0, 0.75))
    # Repeated, as who is silent loses the wheel.
    sent = [
        server.next_message("go_to")[1] for _ in range(3)
    ]  # repeated, for the wheel
    assert sent[0] == sent[1] == sent[2]
    assert sent[0]["type"] == "go_to"
    assert sent[0]["x"] == pytest.approx(2.0, abs=0.03)
    assert sent[0]["y"] == pytest.approx(1.25, abs=0.03)
    assert sent[0]["yaw"] == pytest.approx(math.atan2(0.75, 1.0), abs=0.05)
    goal = Place(2.0, 1.25, 0.64)
    going = Going(goal, 1, 0, 1.25, math.radians(53.0), arrived=False)
    server.set(mode=Mode.WALKING, driver=driver, going=going, **KNOWN)
    see(page.locator("#going")).to_have_text(
        "1.25 m and 53° left, at 1.00, 0.50 m, 90°"
    )
    there = Going(goal, 1, 0, 0.0, 0.0, arrived=True)
    now = {"place": goal, "feet": FEET}
    server.set(mode=Mode.STANDING, driver=driver, going=there, **now)
    see(page.locator("#going")).to_contain_text("arrived, at 2.00, 1.25 m")


def test_a_place_that_jumps_begins_the_trail_anew(server, page, see):
    """A loop that is started again counts from where the robot is then."""

    def at(x):
        server.set(mode=Mode.STOPPED, place=Place(x, 0.0), feet=FEET)
        see(page.locator("#going")).to_contain_text(f"at {x:.2f}, 0.00 m")

    at(0.0)
    for step in range(1, 9):
        at(0.2 * step)
    see(page.locator("#mode")).to_have_text("Stopped")
    walked = page.locator("#floor").screenshot()
    at(0.0)
    at(1.6)
    assert page.locator("#floor").screenshot() != walked


def test_a_drag_gives_the_heading(server, page, see):
    drive(server, page, see)
    page.mouse.move(*spot(page, 1.0, 0.0))
    page.mouse.down()
    page.mouse.move(*spot(page, 1.0, 1.0), steps=5)
    page.mouse.up()
    _, sent = server.next_message("go_to")
    assert (sent["x"], sent["y"]) == pytest.approx((2.0, 0.5), abs=0.03)
    assert sent["yaw"] == pytest.approx(math.radians(90.0), abs=0.02)
    see(page.locator("#place-yaw")).to_have_value("90.0")


def test_fields_send_it_without_a_mouse(server, page, see):
    drive(server, page, see)
    for name, value in {"x": "-0.5", "y": "0.25", "yaw": "45"}.items():
        page.fill(f"#place-{name}", value)
    page.locator("#place-yaw").press("Enter")
    _, sent = server.next_message("go_to")
    assert (sent["x"], sent["y"]) == (-0.5, 0.25)
    assert sent["yaw"] == pytest.approx(math.radians(45.0))
    assert sent["crouch"] == 0


@pytest.mark.parametrize("name", ["x", "y", "yaw"])
def test_an_empty_field_sends_the_robot_nowhere(server, page, see, name):
    drive(server, page, see)
    field = page.locator(f"#place-{name}")
    field.fill("")
    page.click("#go")
    assert field.evaluate("field => field.validity.valueMissing")
    see(field).to_be_focused()
    later = [server.next_message("steer", "go_to")[1]["type"] for _ in range(5)]
    assert later == ["steer"] * 5


@pytest.mark.parametrize("end", ["key", "stop", "stopped by another"])
def test_a_key_a_stop_or_another_one_ends_it(server, page, see, end):
    driver = drive(server, page, see)
    page.mouse.click(*spot(page, 1.0, 0.0))
    server.next_message("go_to")
    going = Going(Place(2.0, 0.5), 1, 0, 1.0, 0.0, arrived=False)
    server.set(mode=Mode.WALKING, driver=driver, going=going, **KNOWN)
    see(page.locator("#going")).to_contain_text("1.00 m and 0° left")
    if end == "key":
        page.keyboard.press("w")
    elif end == "stop":
        page.click("#stop")
    else:
        server.set(mode=Mode.STANDING, driver=driver, **KNOWN)
    server.next_message("steer")
    later = [server.next_message("steer", "go_to")[1]["type"] for _ in range(5)]
    assert later == ["steer"] * 5


def test_who_has_not_the_wheel_sends_nothing(server, page, see):
    see(page.locator("#going")).to_contain_text("at 1.00")
    page.mouse.click(*spot(page, 1.0, 0.0))
    see(page.locator("#notice")).to_have_text("Take the wheel first.")
    assert server.messages.empty()


def test_a_robot_that_cannot_says_why(server, page, see):
    driver = drive(server, page, see)
    server.set(mode=Mode.OFF, driver=driver, **KNOWN)
    see(page.locator("#mode")).to_have_text("Off")
    page.click("#go")
    see(page.locator("#notice")).to_contain_text("from standing or walking")
    server.set(mode=Mode.STANDING, driver=driver)
    see(page.locator("#going")).to_contain_text("nothing measures where")
    page.click("#go")
    see(page.locator("#notice")).to_have_text("Nothing measures where this robot is.")


def test_a_place_that_a_person_gives_after_a_stop_ends_the_stop(server, page, see):
    """Somebody stopped it before it said that it goes, so that the page goes on asking.

    The robot takes no place of whom it stopped before a zero command.
    """
    drive(server, page, see)
    page.mouse.click(*spot(page, 1.0, 0.0))
    server.next_message("go_to")
    page.mouse.click(*spot(page, 1.0, 0.75))
    _, zero = server.next_message("steer")
    assert (zero["ahead"], zero["left"], zero["turn"]) == (0, 0, 0)
    later = [server.next_message("steer", "go_to")[1]["type"] for _ in range(5)]
    assert later == ["go_to"] * 5


def test_a_refusal_ends_the_asking(server, page, see):
    drive(server, page, see)
    page.click("#go")
    server.next_message("go_to")
    server.send_raw('{"type":"error","detail":"no such way"}')
    see(page.locator("#notice")).to_have_text("no such way")
    server.next_message("steer")
    later = [server.next_message("steer", "go_to")[1]["type"] for _ in range(5)]
    assert later == ["steer"] * 5
