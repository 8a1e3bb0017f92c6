"""What the page looks like in a real Chromium: room, contrast, roles, no old news."""

import re
from itertools import pairwise

import pytest
from msgspec.structs import replace
from page_server import CHOICE, PageServer
from planned_library import planned_library, planned_res
from telemetry_factory import PACE

from gaitchain.live.messages import Mode
from gaitchain.robot.box_robot import load_box_robot

pytestmark = pytest.mark.browser
DESK = {"viewport": {"width": 1440, "height": 900}}
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True}
GRAPHICS, TEXT = 3.0, 4.5  # least contrasts of WCAG 2.2 AA
LOOKED_AT = {
    ".stick": ("borderTopColor", GRAPHICS),
    ".knob": ("backgroundColor", GRAPHICS),
    ".mark": ("color", TEXT),
    ".edges": ("stroke", GRAPHICS),
    ".node .dot": ("stroke", GRAPHICS),
    ".node .number": ("fill", TEXT),
    "#mode": ("color", TEXT),
    "#why .muted": ("color", TEXT),
    "#view-stale": ("color", TEXT),
}
# Contrast of a colour on what is behind its element, with the opacity of both.
CONTRAST = """([selector, property]) => {
  const element = document.querySelector(selector);
  const numbers = (text) => {
    const [r, g, b, a = 1] = text.match(/[\\d.]+/g).map(Number);
    return [r, g, b, a];
  };
  const over = ([r, g, b, a], ground) =>
    [r, g, b].map((c, i) => a * c + (1 - a) * ground[i]);
  const chain = [];
  const isText = property === "color" || property === "fill";
  const inside = isText ? element : element.parentElement;
  for (let e = inside; e; e = e.parentElement) chain.unshift(e);
  let ground = [255, 255, 255];
  for (const e of chain) {
    ground = over(numbers(getComputedStyle(e).backgroundColor), ground);
  }
  let opacity = 1;
  for (let e = element; e; e = e.parentElement) opacity *= getComputedStyle(e).opacity;
  const [r, g, b, a] = numbers(getComputedStyle(element)[property]);
  const seen = over([r, g, b, a * opacity], ground);
  const light = (colour) => colour
    .map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const [dark, bright] = [light(seen), light(ground)].sort((p, q) => p - q);
  return (bright + 0.05) / (dark + 0.05);
}"""


def many_poses():
    """Less than a line of text apart in the drawing of the chain."""
    return planned_library(load_box_robot("res"), count=40)


@pytest.fixture
def server(request):
    return PageServer(getattr(request, "param", planned_res)())


def test_driving_view_status_and_why_fit_on_one_screen(visit, server, see):
    server.set(mode=Mode.WALKING, choice=CHOICE, driver="browser-ffff")
    page = visit(**DESK)
    see(page.locator(".node.now")).to_have_count(1)
    seen = ("#take", "#stop", "#reset", "#stick", "#turn-stick", "#vx", "#crouch")
    why = (
        "#chain svg",
        "#why",
        "#why tbody tr:last-child",
        "#sizes",
        "#mode",
        "#estop",
    )
    for name in (*seen, *why, "#viewer", "#floor", "#go", "#carried"):
        box = page.locator(name).bounding_box()
        assert box["y"] >= 0.0, name
        assert box["y"] + box["height"] <= 900.0, name
        assert box["x"] + box["width"] <= 1440.0, name
    for card in (".drive", ".chain"):  # and nothing in them has to be scrolled to
        hidden = "c => c.scrollHeight - c.clientHeight"
        assert page.locator(card).evaluate(hidden) <= 1, card


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_graphics_and_texts_have_contrast_also_for_who_watches(
    visit, server, see, scheme
):
    server.set(mode=Mode.WALKING, choice=CHOICE, driver="browser-ffff", view=None)
    page = visit(**DESK, color_scheme=scheme)
    see(page.locator(".node.now")).to_have_count(1)
    see(page.locator("#drive")).to_have_class(re.compile("watching"))
    found = {
        name: page.evaluate(CONTRAST, [name, prop])
        for name, (prop, _) in LOOKED_AT.items()
    }
    low = {n: c for n, c in found.items() if c < LOOKED_AT[n][1]}
    assert not low
    page.evaluate("document.body.classList.add('stale')")
    assert page.evaluate(CONTRAST, [".mark", "color"]) >= TEXT


def test_lists_are_lists_and_what_scrolls_can_be_focused(visit, see):
    page = visit(**PHONE)
    for name in ("#events", ".legend"):
        see(page.locator(name)).to_have_attribute("role", "list")
    see(page.get_by_role("log", name="Events").locator("#events")).to_have_count(1)
    table = page.get_by_role("region", name="Why this pose")
    table.focus()
    see(table).to_be_focused()


def test_costs_have_digits_parts_and_a_unit_and_nodes_have_numbers(visit, server, see):
    ends, expected = ((2, 0.03124), (1, 0.03131), (3, 0.0401)), (0.0212, 0.031, 0.0101)
    choice = replace(
        CHOICE, layer=1, pose=0, key_moment="kp_2", ends=ends, expected=expected
    )
    server.set(mode=Mode.WALKING, choice=choice)
    page = visit(**DESK)
    rows = page.locator("#why tbody tr")
    see(rows.nth(0)).to_contain_text("0.03120.02120.0100")
    see(rows.nth(1)).to_contain_text("0.0313+0.00010.03100.0003")
    see(page.locator("#why thead")).to_contain_text("of walking")
    see(page.locator(".chain")).to_contain_text("Costs have no unit")
    see(page.locator(".cost.best")).to_have_text("0.0312")
    count = len(page.locator(".node").all())
    numbers = page.locator(".node .number").all_text_contents()
    assert len(numbers) == count
    assert numbers[:3] == ["0", "1", "2"]


def test_a_foots_speed_does_not_read_like_a_risk(visit, see):
    page = visit(**DESK)
    node = page.locator(".node[aria-label^='kp_3']").first
    see(node).to_have_attribute(
        "aria-label", re.compile(r"foot lowering speed [0-9.]+ lifts a swing")
    )
    assert "fall rate" not in page.locator("#chain").inner_html()


def test_the_rate_is_the_loops_own_and_amber_means_something(visit, server, see):
    def tell(rate_hz):
        pace = replace(PACE, ticks=server_ticks.pop(), rate_hz=rate_hz)
        server.set(pace=pace)

    server_ticks = [50, 900, 150]  # which come in bursts, and say nothing of the rate
    tell(249.9)
    page = visit(**DESK)
    see(page.locator("#pace")).to_contain_text("250 Hz")
    tell(246.0)
    see(page.locator("#pace")).to_contain_text("246 Hz")
    see(page.locator("#pace-fact")).to_have_attribute("data-level", "good")
    tell(240.0)
    see(page.locator("#pace-fact")).to_have_attribute("data-level", "warn")


def test_the_supply_of_the_motors_is_beside_the_link(visit, server, see):
    server.set(link_sent=100, link_lost=1, supply_v=11.94)
    page = visit(**DESK)
    see(page.locator("#robot-link")).to_have_text("1 of 100 lost, 11.9 V")
    server.set(link_note="left_knee does not answer", supply_v=11.94)
    see(page.locator("#robot-link")).to_have_text("left_knee does not answer")
    server.set(link_sent=100, link_lost=1)
    see(page.locator("#robot-link")).to_have_text("1 of 100 lost")


def test_what_was_heard_last_is_not_shown_as_news(visit, server, see):
    server.set(mode=Mode.STANDING)
    page = visit(**DESK)
    see(page.locator("#mode")).to_have_text("Standing")
    server.silent = True
    see(page.locator("#mode")).to_have_text("Unknown")
    see(page.locator("#mode-words")).to_have_text(
        "No news of the robot. It was: Standing."
    )
    see(page.locator("#view-stale")).to_contain_text("no news of the robot")
    for fact, shown in (("#pace-fact", "#pace"), ("#link-fact", "#robot-link")):
        see(page.locator(shown)).to_have_text("\N{EN DASH}")
        assert page.locator(fact).get_attribute("data-level") is None
    server.send_raw('{"type":"error","detail":"the loop is silent"}')
    see(page.locator("#notice")).to_have_text("the loop is silent")
    server.silent = False
    see(page.locator("#mode")).to_have_text("Standing")
    see(page.locator("#notice")).to_have_text("", timeout=2000)
    see(page.locator("#view-stale")).to_be_hidden()
    see(page.locator("#pace-fact")).to_have_attribute("data-level", "good")


def test_what_was_said_of_a_short_silence_ends_with_it(visit, server, see):
    """One that the page itself did not call a silence yet."""
    page = visit(prepare=lambda context: context.clock.install(), **DESK)
    see(page.locator("#mode")).to_have_text("Standing")
    page.clock.pause_at(page.evaluate("1e-3 * Date.now() + 2.0"))  # notices stay 8 s
    server.silent = True
    server.send_raw('{"type":"error","detail":"after the last frame"}')
    see(page.locator("#notice")).to_have_text("after the last frame")
    page.clock.run_for(1100)
    server.send_raw('{"type":"error","detail":"the loop is silent"}')
    see(page.locator("#notice")).to_have_text("the loop is silent")
    server.silent = False
    see(page.locator("#notice")).to_have_text("")
    server.send_raw('{"type":"error","detail":"the wheel is taken"}')
    see(page.locator("#notice")).to_have_text("the wheel is taken")


@pytest.mark.parametrize("server", [many_poses], indirect=True)
def test_costs_of_poses_side_by_side_do_not_lie_on_each_other(visit, server, see):
    ends = tuple((pose, 0.2 + 0.01 * pose) for pose in (20, 21, 19, 5))
    choice = replace(CHOICE, layer=1, pose=0, key_moment="kp_2", ends=ends)
    server.set(mode=Mode.WALKING, choice=choice)
    page = visit(**DESK)
    see(page.locator(".costs .cost")).to_have_count(4)
    lines = {
        cost.text_content(): float(cost.get_attribute("y"))
        for cost in page.locator(".costs .cost").all()
    }
    far, *near = (lines[text] for text in ("0.2500", "0.3900", "0.4000", "0.4100"))
    apart = [under - over for over, under in pairwise(near)]
    assert apart == pytest.approx([13.0, 13.0])
    assert near[0] - far > 50.0
    pose = page.locator(".node[aria-label^='kp_4 pose 19:']")
    place = re.findall(r"[0-9.]+", pose.get_attribute("transform"))
    assert near[0] == pytest.approx(float(place[1]) - 5.0, abs=0.1)


def test_the_view_is_loaded_again_for_another_process_or_a_new_way(visit, server, see):
    page, loads = visit(**DESK), []
    see(page.frame_locator("#viewer").get_by_role("button")).to_be_visible()
    page.on("request", lambda r: "/viewer/" in r.url and loads.append(r.url))
    server.set(view=None)
    see(page.locator("#view-stale")).to_have_text(
        "This view is stale: its part does not answer. It comes back by itself."
    )
    assert not loads
    with page.expect_request("**/viewer/"):
        server.set(view=2)
    see(page.locator("#view-stale")).to_be_hidden()
    with page.expect_request("**/viewer/"):
        server.drop()
    see(page.locator("#connection")).to_have_text("connected")
    assert len(loads) == 2
