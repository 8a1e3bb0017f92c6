"""The page of a log that is played: its plots."""

import json

import pytest
from page_server import PageServer
from planned_library import planned_res

from gaitchain.live.messages import Mode

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
