"""The page in a real Chromium: what it shows of a robot, and what it sends to it."""

import itertools
import json
import math
import queue
import re

import pytest
from msgspec.structs import replace
from page_server import CHOICE, PageServer
from patience import PATIENCE_S
from planned_library import planned_res

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.gait.command_range import inward
from gaitchain.live.messages import Mode, ReplayState, TroubleKind
from gaitchain.service.schemas import SteerMessage
from gaitchain.sim.bodies import body_names

pytestmark = pytest.mark.browser
LIBRARY = planned_res()
FASTEST = LIBRARY.command_range.vx[1]
STILL = (0, 0, 0)
SEEN = "new Promise((on) => requestAnimationFrame(() => requestAnimationFrame(on)))"
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}
NAMELESS = re.compile(
    r"^\s*- (button|switch|slider|spinbutton|textbox|checkbox|link|combobox|img|table)"
    r"(?: \[[^]]*\])*:?\s*$",
    re.MULTILINE,
)


@pytest.fixture
def server():
    return PageServer(LIBRARY)


def drive(server, page, see):
    """Take the wheel; return who this page is."""
    page.click("#take")
    driver, _ = server.next_message("steer")
    server.set(mode=Mode.WALKING, driver=driver)
    see(page.locator("#wheel-state")).to_have_text("You drive.")
    return driver


def commands(server):
    """Yield the commands that come: vx, vy, yaw rate."""
    while True:
        _, message = server.next_message("steer")
        asked = SteerMessage.model_validate_json(json.dumps(message))
        parts = asked.ahead, asked.left, asked.turn
        yield LIBRARY.command_range.steer(parts, asked.most).motion


def until(server, wanted):
    """Wait for a command; there are ten a second."""
    came = list(itertools.takewhile(lambda c: not wanted(c), some(server, 300)))
    assert len(came) < 300, f"300 commands, such as {came[-1]}, and none as wanted"


def until_message(server, **fields):
    """Wait for a message with these fields, and return it."""
    came = (server.next_message("steer")[1] for _ in range(300))
    return next(m for m in came if fields.items() <= m.items())


def some(server, count):
    """Return the next commands."""
    return itertools.islice(commands(server), count)


def test_the_page_shows_the_robot_and_asks_nobody_else(visit, server, see):
    server.set(mode=Mode.SAFE, reason="link lost; reset when that is mended")
    page = visit()
    see(page.locator("#robot-name")).to_have_text(LIBRARY.robot.name)
    see(page.locator("#mode")).to_have_text("Safe")
    see(page.locator("#mode-box")).to_contain_text("link lost; reset when that is")
    see(page.locator("#connection")).to_have_text("connected")
    see(page.locator("#vx-ends")).to_contain_text(f"ahead {FASTEST:.2f}")
    see(page.locator("#library-facts")).to_contain_text("qualified in physics")


def test_a_held_key_drives_and_its_release_stops(visit, server, see):
    page = visit()
    drive(server, page, see)
    page.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    again = list(some(server, 5))  # repeated, for the lease
    assert again == [pytest.approx((0.6 * FASTEST, 0.0, 0.0))] * 5
    page.keyboard.up("w")
    until(server, STILL.__eq__)
    assert set(some(server, 5)) == {STILL}
    page.click("#let-go")
    server.next_message("let_go")


def test_space_stops_even_on_a_button_and_by_two_ways(visit, server, see):
    server.set(mode=Mode.WALKING, driver="browser-ffff")  # a watcher may stop it, too
    page = visit()
    see(page.locator("#wheel-state")).to_have_text("browser-ffff drives, you watch.")
    page.locator("#rest").focus()
    page.keyboard.press("Space")
    driver, _ = server.next_message("emergency_stop")
    assert server.posts.get(timeout=PATIENCE_S) == ("emergency-stop", driver)
    see(page.locator("#unconfirmed")).to_be_visible()  # the robot has said nothing
    page.locator("#estop").click()
    server.next_message("emergency_stop")
    server.set(mode=Mode.STOPPED, reason="emergency stop")
    see(page.locator("#unconfirmed")).to_be_hidden()
    see(page.locator("#mode")).to_have_text("Stopped")
    assert server.messages.empty()  # nothing was pressed besides


def test_the_page_says_what_kind_of_robot_it_is(visit, server, see):
    server.set()
    kind = visit().locator("#robot-kind")
    see(kind).to_have_text("simulation")
    for name, words in (
        ("mock", "mock robot"),
        ("emulated", "emulated servos"),
        ("real", "real robot"),
    ):
        server.set(simulated=False, kind=name)
        see(kind).to_have_text(words)


def test_a_stop_that_left_motors_on_is_not_confirmed(visit, server, see):
    server.set(mode=Mode.STANDING)
    page = visit()
    see(page.locator("#mode")).to_have_text("Standing")
    page.keyboard.press("Space")
    server.next_message("emergency_stop")
    note = "a (id 1) NOT known to have let go: switch the supply off"
    server.set(mode=Mode.STOPPED, link_note=note, link_holds=True, simulated=False)
    see(page.locator("#mode")).to_have_text("Stopped")
    see(page.locator("#mode-words")).to_contain_text("torque may be ON")
    see(page.locator("#unconfirmed")).to_be_visible()
    server.set(mode=Mode.STOPPED, simulated=False)
    see(page.locator("#mode-words")).to_have_text("Torque is off until Reset.")
    see(page.locator("#unconfirmed")).to_be_hidden()


def test_a_log_is_not_driven_and_no_robot_is_missed_where_it_stops(visit, server, see):
    server.set(mode=Mode.STANDING, replay=ReplayState(1.0, 9.0, 1.0, playing=True))
    page = visit(**PHONE)
    see(page.locator("#replay")).to_be_visible()
    drives = "#estop, #take, #let-go, #rest, #stop, #stick, #vx, #crouch, #go, #place-x"
    assert page.locator(drives).count() == len(drives.split(", "))
    see(page.locator(drives).filter(visible=True)).to_have_count(0)
    see(page.locator("#carried")).to_be_visible()
    see(page.locator("#floor")).to_be_visible()
    page.keyboard.press("w")
    see(page.locator("#notice")).to_have_text(re.compile("This is a replay"))
    page.clock.install()
    page.keyboard.press("Space")  # pauses the log
    server.next_message("emergency_stop")
    page.clock.run_for(2000)  # ms; a robot would have to say that it stopped
    see(page.locator("#unconfirmed")).to_be_hidden()
    server.set(mode=Mode.STANDING)  # a robot, as who is there again after the log
    see(page.locator("#estop")).to_be_visible()
    see(page.locator("#take")).to_be_visible()


def test_who_watches_cannot_drive(visit, server, see):
    server.set(mode=Mode.STANDING, driver="browser-ffff")
    page = visit()
    see(page.locator("#wheel-state")).to_have_text("browser-ffff drives, you watch.")
    see(page.locator("#take")).to_have_attribute("aria-disabled", "true")
    page.keyboard.press("w")
    see(page.locator("#notice")).to_have_text("browser-ffff drives; you watch.")
    page.locator("#take").click(force=True)
    page.locator("#start").click(force=True)
    see(page.locator("#notice")).to_contain_text("only stopping is for everybody")
    page.keyboard.press("Escape")
    _, first = server.messages.get(timeout=PATIENCE_S)
    assert first == {"type": "emergency_stop"}


def falls_and_stands_still(server, page, driver, see):
    """Let the robot fall and stand again; it has to be sent nothing else."""
    server.set(mode=Mode.STOPPED, driver=driver, fall="The robot fell: too fast.")
    see(page.locator("#fall-sentence")).to_have_text("The robot fell: too fast.")
    server.set(mode=Mode.STANDING, driver=driver)
    see(page.locator("#fall")).to_be_hidden()
    until(server, STILL.__eq__)
    assert set(some(server, 5)) == {STILL}


def test_a_fallen_robot_does_not_walk_on_by_a_key_that_is_held(visit, server, see):
    page = visit()
    driver = drive(server, page, see)
    page.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    falls_and_stands_still(server, page, driver, see)


@pytest.mark.parametrize("end", ["contextmenu", "Meta"])
def test_a_key_whose_lifting_may_not_be_heard_is_let_go(visit, server, see, end):
    """A menu takes keys; macOS tells of none that is lifted while Command is down."""
    page = visit()
    drive(server, page, see)
    page.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    if end == "Meta":
        page.keyboard.down("Meta")
    else:
        page.dispatch_event("#drive", end)
    until(server, STILL.__eq__)
    assert set(some(server, 5)) == {STILL}


def test_sliders_spring_back_unless_they_are_held(visit, server, see):
    page = visit()
    drive(server, page, see)
    slider = page.locator("#vx")
    see(slider).to_be_enabled()
    slider.focus()
    see(slider).to_be_focused()
    page.keyboard.down("End")
    until(server, lambda command: command[0] == pytest.approx(FASTEST))
    page.keyboard.up("End")
    assert slider.input_value() == "0"  # without a frame between
    until(server, STILL.__eq__)
    page.click("#hold")
    slider.focus()
    page.keyboard.press("End")
    until(server, lambda command: command[0] == pytest.approx(FASTEST))
    kept = list(some(server, 4))
    assert kept == [pytest.approx((FASTEST, 0.0, 0.0))] * 4
    see(slider).to_have_js_property("value", "1")
    page.click("#stop")
    until(server, STILL.__eq__)


def test_sliders_show_what_the_server_says_is_asked(visit, server, see):
    asked = 0.25 * FASTEST
    server.set(mode=Mode.WALKING, driver="ros", asked=(asked, 0.0, 0.0))
    page = visit()
    see(page.locator("#vx-out")).to_have_text(f"{asked:.2f} m/s")
    see(page.locator("#vx")).to_have_js_property("value", "0.25")
    page.locator("#vx").focus()
    page.keyboard.press("End")
    see(page.locator("#notice")).to_have_text("ros drives; you watch.")
    see(page.locator("#vx")).to_have_js_property("value", "0.25")
    assert server.messages.empty()


def test_sliders_are_not_bound_to_the_speed_of_keys(visit, server, see):
    page = visit()
    drive(server, page, see)
    page.keyboard.down("w")
    page.keyboard.down("q")
    assert until_message(server, turn=0.6) == {
        "type": "steer",
        **{"ahead": 0.6, "left": 0, "turn": 0.6, "most": 0.6, "crouch": 0},
    }
    page.keyboard.up("w")
    page.click("#hold")
    page.locator("#vx").focus()
    page.keyboard.press("End")
    assert until_message(server, ahead=1)["most"] == 1


def test_a_crouch_stays_until_the_wheel_is_let_go(visit, server, see):
    most, fast = LIBRARY.command_range.crouch
    page = visit()
    slider, shown = page.locator("#crouch"), page.locator("#crouch-out")
    see(page.locator("#crouch-ends")).to_have_text(
        f"at full speed {inward(fast):.3f}most {inward(most):.3f}"
    )
    drive(server, page, see)
    slider.focus()
    page.keyboard.press("End")
    until_message(server, crouch=1)
    server.set(crouch_asked=most)
    see(shown).to_have_text(f"{inward(most):.3f} m")
    page.keyboard.press("w")
    until_message(server, crouch=1, ahead=0)  # no motion; a key's release leaves it
    see(slider).to_have_js_property("value", "1")
    see(page.locator("#asked")).to_contain_text(f"{inward(most):.3f} m lower")
    page.click("#let-go")
    server.set(driver="", crouch_asked=0.0)
    see(slider).to_have_js_property("value", "0")


def test_a_stick_is_pulled_and_springs_back(visit, server, see):
    page = visit()
    drive(server, page, see)
    box = page.locator("#stick").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0], box["y"] - 40.0, steps=20)
    until(server, lambda command: command[0] == pytest.approx(0.6 * FASTEST))
    page.mouse.up()
    until(server, STILL.__eq__)


@pytest.fixture
def gamepad(visit, see):
    """A page with a gamepad, whose axes and buttons a test sets."""
    pad = (
        "globalThis.made = (id, index) => ({id, index, mapping: 'standard',"
        "  connected: true, axes: [0, 0, 0, 0],"
        "  buttons: [{pressed: false}, {pressed: false}]});"
        "globalThis.pad = made('pad', 1);"
        "globalThis.second = null;"
        "navigator.getGamepads = () => [null, pad, second];"
    )
    page = visit(prepare=lambda context: context.add_init_script(pad))
    see(page.locator("#mode")).to_have_text("Standing")
    page.evaluate("dispatchEvent(new Event('gamepadconnected'))")
    see(page.locator("#pad")).to_contain_text("pad: B or circle")
    return page


def test_a_gamepad_drives_and_stops(gamepad, server, see):
    drive(server, gamepad, see)
    gamepad.evaluate("pad.axes[1] = -1")
    until(server, lambda command: command[0] == pytest.approx(0.6 * FASTEST))
    gamepad.evaluate("pad.buttons[1].pressed = true")
    server.next_message("emergency_stop")


def test_a_gamepad_of_an_unknown_layout_is_not_read(gamepad, server, see):
    """Its third axis may be a trigger, which rests at -1, and its B any button."""
    drive(server, gamepad, see)
    gamepad.evaluate("pad.mapping = ''")
    see(gamepad.locator("#pad")).to_have_text(
        "pad: not read, as this browser does not know its layout"
    )
    gamepad.evaluate("pad.axes[2] = -1; pad.buttons[1].pressed = true")
    gamepad.evaluate(SEEN)
    gamepad.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    came = [server.messages.get(timeout=PATIENCE_S)[1] for _ in range(5)]
    assert {(m["type"], m.get("turn")) for m in came} == {("steer", 0)}


def test_each_gamepad_stops_and_the_first_drives(gamepad, server, see):
    drive(server, gamepad, see)
    gamepad.evaluate("pad.mapping = ''; second = made('second', 2)")
    see(gamepad.locator("#pad")).to_contain_text("; second: B or circle")
    gamepad.evaluate("second.axes[1] = -1")
    until(server, lambda command: command[0] == pytest.approx(0.6 * FASTEST))
    gamepad.evaluate("pad.mapping = 'standard'; pad.axes[2] = 1")
    until_message(server, ahead=0, turn=-0.6)
    for name in ("pad", "second"):  # the first is held down
        gamepad.evaluate(f"{name}.buttons[1].pressed = true")
        server.next_message("emergency_stop")
    gamepad.evaluate("second.buttons[0].pressed = true")
    server.next_message("stop")


def test_a_gamepads_stick_that_is_still_pulled_does_not_walk_on(gamepad, server, see):
    driver = drive(server, gamepad, see)
    gamepad.evaluate("pad.axes[1] = -1")
    until(server, lambda command: command[0] > 0.0)
    falls_and_stands_still(server, gamepad, driver, see)
    gamepad.evaluate("pad.axes[1] = 0")
    gamepad.evaluate(SEEN)
    gamepad.evaluate("pad.axes[1] = -1")
    until(server, lambda command: command[0] > 0.0)


def test_a_page_that_is_left_stops_the_robot(visit, server, see):
    page = visit()
    drive(server, page, see)
    page.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    page.evaluate("document.hasFocus = () => false; dispatchEvent(new Event('blur'))")
    until(server, STILL.__eq__)
    page.evaluate(
        "Object.defineProperty(document, 'hidden', {value: true});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )
    server.next_message("let_go")
    see(page.locator("#wheel-state")).to_have_text("Nobody drives.")


def test_keys_count_inside_the_view(visit, server, see):
    page = visit()
    see(page.locator("#mode")).to_have_text("Standing")
    page.frame_locator("#viewer").get_by_role("button").focus()
    page.keyboard.press("Space")
    server.next_message("emergency_stop")


def test_the_chain_shows_where_the_robot_goes_and_why(visit, server, see):
    server.set(mode=Mode.WALKING, choice=CHOICE)
    page = visit()
    now = page.locator(".node.now")
    see(now).to_have_count(1)
    see(now).to_have_attribute("aria-label", re.compile("^kp_4 pose 2: length 0.*"))
    see(page.locator(".node.candidate")).to_have_count(2)
    see(page.locator(".cost.best")).to_have_text("0.2500")
    rows = page.locator("#why tbody tr")
    see(rows.nth(0)).to_contain_text("2 (chosen)")
    see(rows.nth(1)).to_contain_text("+0.250")
    see(page.locator("#sizes")).to_have_text(
        "Disturbed: a step of 50 % of the range, expected cost 0.0200; 75 % 0.0210; "
        "100 % 0.0350 (a fall costs 1)"
    )
    server.set(mode=Mode.WALKING, choice=replace(CHOICE, sizes=()))
    see(page.locator("#sizes")).to_contain_text("Not disturbed")
    page.locator(".node[tabindex='0']").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowDown")
    see(page.locator("#pose-text")).to_contain_text("kp_1 pose 1: length")
    page.get_by_role("switch", name="Freeze").click()
    server.set(mode=Mode.STANDING)
    see(page.locator("#mode")).to_have_text("Standing")
    see(now).to_have_attribute("aria-label", re.compile("^kp_4 pose 2"))
    page.get_by_role("switch", name="Freeze").press("Enter")
    see(now).to_have_attribute("aria-label", re.compile("^kp_1 pose 0"))


def test_of_a_walk_by_strides_it_shows_where_a_step_may_end(visit, server, see):
    """Between the strides nothing is chosen; the command and their costs decide."""
    ends = ((2, 0.25), (1, 0.75), (3, 1.5))
    begun = replace(
        CHOICE, layer=1, pose=0, key_moment="kp_2", runners_up=(), ends=ends
    )
    server.set(mode=Mode.WALKING, choice=begun)
    page = visit()
    see(page.locator(".node.now")).to_have_attribute("aria-label", re.compile("^kp_2"))
    see(page.locator(".node.candidate")).to_have_count(2)
    see(page.locator(".cost.best")).to_have_text("0.2500")
    see(page.locator("#why")).to_contain_text("Why kp_4 pose 2, by expected cost and")
    rows = page.locator("#why tbody tr")
    see(rows.nth(0)).to_contain_text("2 (chosen)")
    see(rows.nth(0)).to_contain_text("length")
    see(rows.nth(1)).to_contain_text("+0.500")
    landed = replace(begun, layer=3, pose=2, key_moment="kp_4")
    server.set(mode=Mode.WALKING, choice=landed)
    see(page.locator(".node.now")).to_have_attribute("aria-label", re.compile("^kp_4"))
    see(page.locator("#why")).to_contain_text("by expected cost and distance")


def test_an_edge_is_drawn_once_the_step_before_it_is_known(visit, server, see):
    page = visit()
    see(page.locator("#mode")).to_have_text("Standing")
    for layer in (1, 2, 3):
        choice = replace(
            CHOICE,
            key_moment=f"kp_{layer + 1}",
            layer=layer,
            pose=CHOICE.pose if layer == 3 else 0,
        )
        server.set(mode=Mode.WALKING, choice=choice)
        see(page.locator("#chain-now")).to_contain_text(f"to kp_{layer + 1} pose")
    see(page.locator(".marks .chosen")).to_have_count(1)
    see(page.locator(".marks .walked")).to_have_count(2)
    see(page.locator(".marks .candidate")).to_have_count(2)


def test_a_robot_that_lies_there_can_be_let_get_up(visit, server, see):
    """Nobody saw it fall, so no cause of a fall is known."""
    lies = "lies there: the trunk leans by 90 deg, limit 50; let it get up"
    server.set(
        mode=Mode.STOPPED, trouble=TroubleKind.LYING, reason=lies, can_get_up=True
    )
    page = visit()
    see(page.locator("#fall-title")).to_have_text("It lies there")
    see(page.locator("#fall-sentence")).to_have_text(lies)
    page.click("#get-up")
    server.next_message("get_up")
    server.set(mode=Mode.STOPPED, fall="The robot fell: too fast.", can_get_up=True)
    see(page.locator("#fall-title")).to_have_text("Why it fell")
    see(page.locator("#fall-sentence")).to_have_text("The robot fell: too fast.")
    see(page.locator("#get-up")).to_be_visible()
    server.set(mode=Mode.STANDING)
    see(page.locator("#fall")).to_be_hidden()


def test_it_comes_back_when_the_socket_is_dropped(visit, server, see):
    page = visit(foreseen=("WebSocket connection to",))
    drive(server, page, see)
    server.set(mode=Mode.STANDING)
    server.drop()
    see(page.locator("#connection")).to_contain_text("reconnecting")
    see(page.locator("#connection")).to_have_text("connected")
    see(page.locator("#wheel-state")).to_have_text("Nobody drives.")


def test_a_page_that_stood_still_keeps_its_connection_and_the_wheel(visit, server, see):
    page = visit()
    page.clock.install()
    page.reload()
    see(page.locator("#connection")).to_have_text("connected")
    driver = drive(server, page, see)
    reopened = []
    page.on("websocket", lambda socket: reopened.append(socket.url))
    page.clock.fast_forward(20_000)
    page.keyboard.down("w")
    until(server, lambda command: command[0] > 0.0)
    assert server.next_message("steer")[0] == driver
    see(page.locator("#wheel-state")).to_have_text("You drive.")
    assert not reopened
    page.keyboard.up("w")


def test_a_connection_that_nobody_answers_is_given_up(visit, server, see):
    page = visit(foreseen=("WebSocket connection to",))
    page.clock.install()
    page.reload()
    shown = page.locator("#connection")
    see(shown).to_have_text("connected")
    server.hangs = True
    server.drop()
    see(shown).to_contain_text("lost; reconnecting")
    page.clock.run_for(2000)  # ms; the wait is 0.6 s at most
    see(shown).to_have_text("reconnecting…")
    page.clock.run_for(6000)
    see(shown).to_contain_text("lost; reconnecting")
    server.hangs = False
    page.clock.run_for(2000)
    see(shown).to_have_text("connected")


def test_a_server_that_says_that_the_loop_is_silent_is_not_left(visit, server, see):
    page = visit()
    page.clock.install()
    page.reload()
    see(page.locator("#connection")).to_have_text("connected")
    drive(server, page, see)
    reopened = []
    page.on("websocket", lambda socket: reopened.append(socket.url))
    server.silent = True
    for second in range(10):
        server.send_raw(json.dumps({"type": "error", "detail": f"silent {second}"}))
        see(page.locator("#notice")).to_have_text(f"silent {second}")
        page.clock.run_for(1000)
    see(page.locator("#connection")).to_contain_text("connected; robot silent for")
    server.silent = False
    see(page.locator("#connection")).to_have_text("connected")
    see(page.locator("#wheel-state")).to_have_text("You drive.")
    assert not reopened


def test_a_browser_without_the_token_is_told_so(visit, server, see):
    server.refuses = True
    page = visit(foreseen=("WebSocket connection to", "Failed to load resource"))
    see(page.locator("#signin")).to_be_visible()
    server.refuses = False
    see(page.locator("#mode")).to_have_text("Standing")
    see(page.locator("#signin")).to_be_hidden()


def test_bad_frames_do_not_break_it(visit, server, see):
    page = visit()
    see(page.locator("#mode")).to_have_text("Standing")
    whole = json.dumps(server.frame)
    for name in server.frame:
        for bad in (None, "x", -1, [], {}, [None], [[None]], math.inf):
            frame = {**json.loads(whole), "type": "frame", name: bad}
            server.send_raw(json.dumps(frame))
    for text in ("", "{", "null", "[]", "7", '{"type":"frame"}', '{"type":"news"}'):
        server.send_raw(text)
    server.send_raw('{"type":"error","detail":"vx 9 m/s: this library walks less"}')
    see(page.locator("#notice")).to_have_text("vx 9 m/s: this library walks less")
    server.set(mode=Mode.WALKING, scene={"zmp": [None, None], "region": []})
    see(page.locator("#mode")).to_have_text("Walking")
    see(page.locator("#margin")).to_have_text("ZMP not known")


def test_events_are_in_order_and_are_no_markup(visit, server, see):
    late = "<img src=/none onerror=alert(1)>"
    event = {"time_s": 61.5, "kind": "link", "text": late}
    server.events = [{**event, "number": 1, "stamp_ns": 10**18, "text": "first"}]
    newest = {**event, "number": 2, "stamp_ns": 2 * 10**18}
    server.set(events=[newest])
    page = visit()
    items = page.locator("#events li")
    see(items).to_have_count(2)
    see(items.nth(0)).to_have_text(f"1:01.5link{late}")
    see(items.nth(1)).to_contain_text("first")


def test_an_event_is_there_once_though_another_server_counts_anew(visit, server, see):
    event = {"time_s": 1.5, "stamp_ns": 10**18, "kind": "part", "text": "the api died"}
    server.set(events=[{**event, "number": 9}])
    page = visit()
    items = page.locator("#events li")
    see(items).to_have_text(["0:01.5partthe api died"])
    later = {**event, "number": 2, "stamp_ns": 2 * 10**18, "text": "and came back"}
    server.set(events=[{**event, "number": 1}, later])
    see(items).to_have_text(["0:01.5partand came back", "0:01.5partthe api died"])


def test_events_that_no_frame_had_room_for_are_asked_for(visit, server, see):
    events = [
        {"number": n, "stamp_ns": n, "time_s": 0.1 * n, "kind": "push", "text": f"{n}"}
        for n in range(1, 31)
    ]
    server.events = events[:1]
    server.set(events=events[:1])
    page = visit()
    items = page.locator("#events li")
    see(items).to_have_count(1)
    server.events = events
    server.set(events=events[-10:])
    see(items).to_have_count(30)
    assert items.locator("span:last-child").all_text_contents() == [
        str(n) for n in range(30, 0, -1)
    ]


@pytest.mark.parametrize(
    ("time_s", "shown"),
    [(59.94, "0:59.9"), (59.96, "1:00.0"), (119.97, "2:00.0"), (3599.99, "60:00.0")],
)
def test_seconds_are_rounded_up_to_a_minute(visit, server, see, time_s, shown):
    event = {"time_s": time_s, "stamp_ns": 1, "kind": "link", "text": "lost"}
    server.set(events=[{**event, "number": 1}])
    see(visit().locator("#events time")).to_have_text(shown)


def test_a_push_is_for_a_simulated_robot(visit, server, see):
    page = visit()
    see(page.locator("#robot-name")).to_have_text(LIBRARY.robot.name)
    see(page.locator("#push-why")).to_contain_text("pushes last 0.1 s")
    see(page.locator("#impulse")).to_have_attribute("max", "62")
    page.fill("#impulse", "4.25")
    page.get_by_role("button", name="Push to the left", exact=True).click()
    _, push = server.next_message("push")
    usual = {"elevation_deg": 0, "body": "trunk"}
    assert push == {
        "type": "push",
        "impulse_ns": 4.25,
        "direction_deg": 90,
        **usual,
    }
    page.fill("#impulse", "900")
    page.get_by_role("button", name="Push back", exact=True).click()
    see(page.locator("#disturb-notice")).to_have_text(
        "The impulse must be 0.1 to 62 N s."
    )
    server.set(simulated=False)
    see(page.locator("#push-why")).to_contain_text("which this one is not")
    page.get_by_role("button", name="Push back", exact=True).click(force=True)
    page.click("#rest")
    see(page.locator("#notice")).to_contain_text("then press Rest again")
    page.click("#rest")
    _, said = server.messages.get(timeout=PATIENCE_S)
    assert said == {"type": "rest"}


def test_a_push_names_a_body_and_an_elevation(visit, server, see):
    page = visit()
    bodies = page.locator("#body option")
    see(bodies).to_have_text(
        [name.replace("_", " ") for name in (*body_names(LIBRARY.robot), "any")]
    )
    page.locator("#body").focus()
    page.keyboard.type("w")  # a letter finds a body here, and drives nothing
    see(page.locator("#notice")).to_have_text("")
    page.select_option("#body", "left_foot")
    page.fill("#elevation", "-20.5")
    page.get_by_role("button", name="Push forward", exact=True).press("Enter")
    _, push = server.next_message("push")
    assert (push["body"], push["elevation_deg"]) == ("left_foot", -20.5)
    page.select_option("#body", "any")
    page.fill("#elevation", "91")
    page.get_by_role("button", name="Push forward", exact=True).press("Enter")
    see(page.locator("#disturb-notice")).to_have_text(
        "The elevation must be -90 to 90°."
    )
    page.fill("#elevation", "90")
    page.get_by_role("button", name="Push forward", exact=True).press("Enter")
    assert server.next_message("push")[1]["body"] == "any"


def test_disturbances_are_switched_by_keys_and_show_what_the_robot_says(
    visit, server, see
):
    page = visit()
    now, notice = page.locator("#disturbed"), page.locator("#disturb-notice")
    switches = {
        name: page.get_by_role("switch", name=name)
        for name in ("Punches", "Payload", "Arms swing")
    }
    see(page.locator("#punches-most")).to_have_attribute("max", "62")
    server.set(disturbances=Disturbances(None, "still", 0.0))
    see(now).to_have_text("nothing but pushes")
    page.fill("#punches-most", "20")
    page.fill("#payload-part", "12.5")
    for switch in switches.values():
        switch.press("Enter")
    asked = [server.next_message("disturb")[1] for _ in range(3)]
    assert [message.pop("type") for message in asked] == ["disturb"] * 3
    assert asked == [
        {"punches": {"most_ns": 20, "every_s": 5}},
        {"payload": 0.125},
        {"arms": "random"},
    ]
    see(switches["Punches"]).to_have_attribute("aria-checked", "false")
    server.set(disturbances=Disturbances(PunchesState(15.0, 2.5), "random", 0.2))
    for switch in switches.values():
        see(switch).to_have_attribute("aria-checked", "true")
    see(page.locator("#punches-most")).to_have_value("15")
    see(page.locator("#punches-every")).to_have_value("2.5")
    see(page.locator("#payload-part")).to_have_value("20")
    see(now).to_have_text(
        "punches of up to 15 N s every 2.5 s, arms that swing, "
        "a payload of 20 % of the mass"
    )
    page.fill("#punches-every", "0.05")
    page.keyboard.press("Enter")
    see(notice).to_have_text("The interval must be 0.1 to 1000000 s.")
    page.fill("#punches-every", "4")
    page.keyboard.press("Enter")
    changed = {"type": "disturb", "punches": {"most_ns": 15, "every_s": 4}}
    assert server.next_message("disturb")[1] == changed
    for switch in switches.values():
        switch.press("Enter")
    off = [server.next_message("disturb")[1] for _ in range(3)]
    assert off == [
        {"type": "disturb", name: None} for name in ("punches", "payload", "arms")
    ]


def test_who_watches_or_has_a_real_robot_disturbs_nothing(visit, server, see):
    server.set(driver="browser-ffff")
    page = visit()
    payload = page.get_by_role("switch", name="Payload")
    see(payload).to_have_attribute("aria-disabled", "true")
    payload.press("Enter")
    see(page.locator("#disturb-notice")).to_have_text("browser-ffff drives; you watch.")
    server.set(simulated=False)
    see(page.locator("#push-why")).to_contain_text("which this one is not")
    payload.press("Enter")
    see(page.locator("#disturb-notice")).to_contain_text("which this one is not")
    assert server.messages.empty()


def test_a_real_robot_is_reset_by_two_presses_of_the_same_button(visit, server, see):
    server.set(simulated=False, mode=Mode.SAFE)
    page = visit()
    see(page.locator("#mode")).to_have_text("Safe")
    page.click("#rest")
    page.click("#reset")
    see(page.locator("#notice")).to_have_text(
        "Reset lets the robot go, and it may sink: hold it, then press Reset again."
    )
    assert server.messages.empty()
    page.click("#reset")
    _, said = server.messages.get(timeout=PATIENCE_S)
    assert said == {"type": "reset"}
    see(page.locator("#notice")).to_have_text("")
    server.set(simulated=True, mode=Mode.STOPPED)
    see(page.locator("#mode")).to_have_text("Stopped")
    page.click("#reset")
    _, said = server.messages.get(timeout=PATIENCE_S)
    assert said == {"type": "reset"}


def test_plots_are_drawn_and_joints_chosen(visit, server, see):
    count = len(server.frame["joint_position"])
    server.set(
        joint_load=(5.0,) * count,
        scene={"zmp": [0.0, 0.0], "region": [[1, 1], [-1, 1], [-1, -1], [1, -1]]},
    )
    page = visit()
    see(page.locator("#margin")).to_have_text("ZMP 1000 mm inside the region")
    chip = page.get_by_role("button", name="left ankle roll")
    see(chip).to_have_attribute("aria-pressed", "false")
    chip.click()
    see(chip).to_have_attribute("aria-pressed", "true")
    see(chip).to_contain_text("5.0 N m")
    for name in ("balance", "angles", "loads"):
        page.locator(f"#{name}").scroll_into_view_if_needed()
        assert _drawn(page, name)


def test_a_plot_that_was_hidden_and_is_seen_again_is_drawn(visit, server):
    """A busy page hears of both at once, the older one first."""
    server.set(joint_load=(5.0,) * len(server.frame["joint_position"]))
    late = """const Real = IntersectionObserver;
    window.IntersectionObserver = class extends Real {
      constructor(tell) {
        super((news) => tell([{ isIntersecting: false }, ...news]));
      }
    };"""
    page = visit(prepare=lambda context: context.add_init_script(late))
    page.locator("#balance").scroll_into_view_if_needed()
    assert _drawn(page, "balance")


def _drawn(page, name):
    """Wait until a canvas is no longer empty."""
    differs = (
        "c => { const e = document.createElement('canvas');"
        "  e.width = c.width; e.height = c.height;"
        "  return e.toDataURL() !== c.toDataURL(); }"
    )
    return any(page.locator(f"#{name}").evaluate(differs) for _ in range(500))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_all_without_scrolling_sideways(visit, server, see, scheme):
    server.set(mode=Mode.WALKING, choice=CHOICE, reason="a" * 90)
    page = visit(**PHONE, color_scheme=scheme)
    see(page.locator(".node.now")).to_have_count(1)
    wide = "document.documentElement.scrollWidth"
    assert page.evaluate(wide) <= 390
    for top in (0, 700, 100_000):
        page.evaluate(f"scrollTo(0, {top})")
        box = page.locator("#estop").bounding_box()
        assert box["y"] + box["height"] <= 844.0
        assert box["height"] >= 72.0
    page.get_by_role("button", name="Show").click()
    see(page.locator("#viewer")).to_be_visible()
    assert page.evaluate(wide) <= 390


def test_a_phone_on_its_side_is_a_phone(visit, server, see):
    server.set(mode=Mode.WALKING, choice=CHOICE)
    page = visit(viewport={"width": 844, "height": 390}, has_touch=True)
    see(page.locator(".node.now")).to_have_count(1)
    see(page.locator("#view-box")).to_be_hidden()
    stop = page.locator("#estop").bounding_box()
    assert stop["y"] > 0.75 * 390.0
    assert stop["y"] + stop["height"] <= 390.0
    head = page.locator(".bar").bounding_box()
    assert head["height"] < 0.25 * 390.0
    page.locator("#stick").scroll_into_view_if_needed()
    stick = page.locator("#stick").bounding_box()
    assert stick["height"] < stop["y"] - head["height"]  # it can be seen whole
    assert page.evaluate("document.documentElement.scrollWidth") <= 844


def test_a_low_window_of_a_desk_is_none(visit, see):
    page = visit(viewport={"width": 844, "height": 390})
    see(page.locator("#view-box")).to_be_visible()
    assert page.locator("#estop").bounding_box()["y"] < 0.25 * 390.0


def test_every_control_has_a_name(visit, server, see):
    server.set(mode=Mode.WALKING, choice=CHOICE)
    page = visit()
    see(page.locator(".node.now")).to_have_count(1)
    tree = page.locator("body").aria_snapshot()
    assert 'button "Emergency stop' in tree
    assert not NAMELESS.findall(tree)
    assert NAMELESS.findall("- button\n  - slider [disabled]:\n") == [
        "button",
        "slider",
    ]


def test_no_message_is_sent_by_a_page_that_only_looks(visit, server, see):
    page = visit()
    see(page.locator("#mode")).to_have_text("Standing")
    page.mouse.wheel(0.0, 900.0)
    page.keyboard.press("Tab")
    with pytest.raises(queue.Empty):
        server.messages.get_nowait()
