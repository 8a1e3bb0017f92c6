"""The page of a log that is played: bar, plots, and what a screen reader says."""

import json

import pytest
from page_server import PageServer
from planned_library import planned_res

from gaitchain.live.messages import Going, Mode, ReplayState
from gaitchain.walker.place import Place

pytestmark = pytest.mark.browser
LIBRARY = planned_res()
DESK = {"viewport": {"width": 1440, "height": 900}}
SEEN = "new Promise((on) => requestAnimationFrame(() => requestAnimationFrame(on)))"
# How often each canvas strokes in one picture, and where the ends of its lines are.
DRAWN = """globalThis.drawn = {};
for (const name of ["clearRect", "stroke", "lineTo"]) {
  const real = CanvasRenderingContext2D.prototype[name];
  CanvasRenderingContext2D.prototype[name] = function (...where) {
    const fresh = { strokes: 0, ends: [] };
    if (name === "clearRect") drawn[this.canvas.id] = fresh;
    if (name === "stroke") drawn[this.canvas.id].strokes += 1;
    if (name === "lineTo") drawn[this.canvas.id].ends.push(where[0]);
    return real.apply(this, where);
  };
}"""


@pytest.fixture
def server():
    return PageServer(LIBRARY)


@pytest.fixture
def played(visit, server, see):
    """A page of which a test sends each frame, by its time; returns what is drawn."""
    server.set(mode=Mode.WALKING, scene={"zmp": [0.0, 0.05]}, reason="the log")
    server.silent = True
    page = visit(prepare=lambda context: context.add_init_script(DRAWN), **DESK)
    see(page.locator("#joint-list button").first).to_be_visible()
    page.locator("#balance").scroll_into_view_if_needed()  # beside the joints

    def play(*times):
        for time_s in times:
            server.send_raw(json.dumps({**server.frame, "time_s": time_s}))
        last = f"at {times[-1]} s, after {len(times)}"
        end = {**server.frame, "time_s": times[-1], "reason": last}
        server.send_raw(json.dumps(end))
        see(page.locator("#reason")).to_have_text(last)
        page.evaluate(SEEN)
        return page.evaluate("drawn")

    return play


def test_the_plots_of_a_paused_log_stay_as_they_are(played):
    before = played(*(0.04 * i for i in range(300)))
    paused = played(*[0.04 * 299] * 600)
    assert paused["balance"]["strokes"] == before["balance"]["strokes"]
    assert min(paused["angles"]["ends"]) == pytest.approx(
        min(before["angles"]["ends"]), abs=2.0
    )
    assert len(paused["angles"]["ends"]) <= len(before["angles"]["ends"]) + 8


def test_a_log_played_slowly_shows_ten_seconds_of_its_joints(played):
    live = played(*(0.04 * i for i in range(300)))["angles"]["ends"]
    slow = played(*(0.005 * i for i in range(2400)))["angles"]["ends"]
    assert min(slow) == pytest.approx(min(live), abs=2.0)
    assert len(slow) <= 2.5 * len(live)


def replay(**changes):
    return ReplayState(**{"at_s": 1.0, "length_s": 9.0, "speed": 1.0, **changes})


def test_a_speed_that_the_page_does_not_offer_is_shown(visit, server, see):
    server.set(replay=replay(speed=1.5, playing=True))
    page = visit()
    speed, offered = page.locator("#replay-speed"), page.locator("#replay-speed option")
    see(speed).to_have_value("1.5")
    see(page.locator("#replay-speed option:checked")).to_have_text("1.5 x")
    server.set(replay=replay(speed=0.7, playing=True))
    see(speed).to_have_value("0.7")
    see(offered).to_have_text(
        ["0.1 x", "0.25 x", "0.5 x", "0.7 x", "1 x", "2 x", "5 x", "10 x"]
    )
    server.set(replay=replay(speed=2.0, playing=True))
    see(speed).to_have_value("2")


def told_as(texts, first=1):
    """Events of a log as the server numbers them."""
    return [
        {"number": n, "time_s": n, "stamp_ns": n, "kind": "world", "text": text}
        for n, text in enumerate(texts, start=first)
    ]


def test_a_log_that_is_sought_shows_the_events_up_to_there_alone(visit, server, see):
    """Also where a frame has no room for all of them."""
    before = [f"change {n}" for n in range(1, 31)]
    server.events = told_as(before)
    server.set(replay=replay(playing=False, jumps=1), events=server.events[-10:])
    page = visit()
    shown = page.locator("#events li > :last-child")
    see(shown).to_have_text(before[::-1])
    server.events = told_as(before[:12], first=31)  # sought back: numbered anew
    server.set(replay=replay(playing=False, jumps=2), events=server.events[-10:])
    see(shown).to_have_text(before[11::-1])
    server.events = []
    server.set(replay=replay(playing=False, jumps=3))
    see(shown).to_have_count(0)
    server.events = told_as(before[:1], first=43)
    server.set(replay=replay(playing=True, jumps=3), events=server.events)
    see(shown).to_have_text(before[:1])


def test_a_play_that_is_not_sent_says_so(visit, server, see):
    server.set(replay=replay(playing=False))
    page = visit(foreseen=("WebSocket connection to",))
    see(page.locator("#replay-play")).to_have_text("Play")
    server.hangs = True
    server.drop()
    see(page.locator("#connection")).to_contain_text("reconnecting")
    page.click("#replay-play")
    see(page.locator("#notice")).to_have_text("Not sent: there is no connection.")
    server.hangs = False


def test_a_screen_reader_speaks_of_modes_and_not_of_the_time(visit, server, see):
    server.set(mode=Mode.STANDING, reason="link lost")
    page = visit()
    see(page.locator("#reason")).to_have_text("link lost")
    assert spoken(page, "Standing", "link lost") == ["polite", "polite"]
    now = "replay of walk.mcap, 3.0 s"
    server.set(mode=Mode.STANDING, replay=replay(playing=True, where=now))
    see(page.locator("#reason")).to_have_text(now)
    assert spoken(page, "Standing", now) == ["polite", None]
    server.set(mode=Mode.STANDING, reason="link lost")
    see(page.locator("#replay")).to_be_hidden()
    assert spoken(page, "link lost") == ["polite"]


def test_a_screen_reader_speaks_of_the_arrival_and_not_of_the_way(visit, server, see):
    place, goal = Place(0.0, 0.0), Place(1.0, 0.0)
    known = {"place": place, "feet": (Place(0.0, 0.1), Place(0.0, -0.1))}
    arrived = Going(goal, 1, 0, 0.0, 0.0, arrived=True)
    server.set(going=arrived, **known)  # before the page was opened: no news
    page = visit()
    notice, going = page.locator("#notice"), page.locator("#going")
    see(going).to_contain_text("arrived")
    see(notice).to_have_text("")
    on_its_way = Going(goal, 1, 0, 1.0, 0.0, arrived=False)
    server.set(mode=Mode.WALKING, going=on_its_way, **known)
    see(going).to_contain_text("1.00 m and 0° left")
    server.set(going=arrived, **known)
    see(notice).to_have_text("The robot has arrived.")
    see(going).to_contain_text("arrived")
    said = "The robot has arrived.", "arrived, at 0.00, 0.00 m, 0°"
    assert spoken(page, *said) == ["polite", None]


def spoken(page, *texts):
    """How a screen reader is to speak of what comes in place of each of these texts.

    None where it does not: none of what they are in is a live region.
    """
    tools = page.context.new_cdp_session(page)
    nodes = tools.send("Accessibility.getFullAXTree")["nodes"]
    named = {node["nodeId"]: node for node in nodes}

    def live(node):
        told = {p["name"]: p["value"].get("value") for p in node.get("properties", ())}
        within = named.get(node.get("parentId"))
        return told.get("live") or (live(within) if within else None)

    def said(text):
        return next(n for n in nodes if n.get("name", {}).get("value") == text)

    return [live(said(text)) for text in texts]
