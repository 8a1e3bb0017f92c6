// The page: its parts, and what passes between them.

import { Actions } from "./actions.js";
import { Balance } from "./balance.js";
import { Chain } from "./chain.js";
import { Crouch } from "./crouch.js";
import { Disturb } from "./disturb.js";
import { Driver } from "./driver.js";
import { Floor } from "./floor.js";
import { Keys } from "./keys.js";
import { readLibrary } from "./library.js";
import { Link } from "./link.js";
import { Log } from "./log.js";
import { Pad } from "./pad.js";
import { Push } from "./push.js";
import { Replay } from "./replay.js";
import { Sliders } from "./sliders.js";
import { Status } from "./status.js";
import { Stick } from "./stick.js";
import { Traces } from "./traces.js";
import { View } from "./view.js";
import { Wheel, whyNot } from "./wheel.js";
import { Why } from "./why.js";
import { say, speaker } from "./words.js";

const HZ = 25;
const RETRY = 2000; // ms between two tries to get the library

const at = (id) => document.getElementById(id);
const camel = (id) => id.replace(/-./g, ([, letter]) => letter.toUpperCase());

/** Return elements by their ids in camel case. */
function named(...ids) {
  return Object.fromEntries(ids.join(" ").split(" ").map((id) => [camel(id), at(id)]));
}

const notice = speaker(at("notice"));
const disturbNotice = speaker(at("disturb-notice"));

const link = new Link(HZ);
const wheel = new Wheel(link);
const status = new Status(
  named(
    "robot-name robot-kind library-facts mode mode-words reason connection connection-fact",
    "pace pace-fact robot-link link-fact signin fall fall-title fall-sentence",
    "asked carried note support steps tilt sensors",
  ),
);
const actions = new Actions(
  link, wheel, notice, named("start stop rest reset get-up estop unconfirmed"),
);

function moved() {
  if (wheel.pulled && !wheel.wanted) notice(idle());
  wheel.tick();
}

/** Say why a pull does nothing. */
function idle() {
  return whyNot(link.isOpen && { replay: replay.isOn }, wheel) || "Take the wheel first.";
}

const emergency = () => actions.emergency();
const keys = new Keys(moved, emergency);
const sliders = new Sliders(at("sliders"), at("hold"), wheel, moved);
const crouch = new Crouch(at("crouch-row"), wheel, moved);
wheel.sources = [
  keys,
  sliders,
  new Stick(at("stick"), false, (right, up) => [up, -right, 0], moved),
  new Stick(at("turn-stick"), true, (right) => [0, 0, -right], moved),
  new Pad(moved, emergency, () => actions.stop(), (text) => say(at("pad"), text)),
];

const push = new Push(link, wheel, disturbNotice, named("dial impulse body elevation push-why"));
const disturb = new Disturb(
  link, wheel, disturbNotice,
  named("punches punches-most punches-every arms payload payload-part disturbed"),
);
const replay = new Replay(link, notice, {
  box: at("replay"), play: at("replay-play"),
  bar: at("replay-at"),
  time: at("replay-time"),
  speed: at("replay-speed"),
});
const log = new Log(at("events"), (number) => link.get(`/events?after=${number}`));
const balance = new Balance(at("balance"), at("margin"));
const traces = new Traces(named("angles loads joint-list"));
const why = new Why(new Chain(at("chain"), (text) => say(at("pose-text"), text)), {
  title: at("why-title"),
  now: at("chain-now"),
  body: at("why").tBodies[0],
  freeze: at("freeze"),
  sizes: at("sizes"),
});
const view = new View({
  box: at("view-box"), frame: at("viewer"),
  toggle: at("view-toggle"), stale: at("view-stale"),
}, (inside) => {
  keys.listen(inside);
  wheel.watch(inside);
});
const floor = new Floor(wheel, notice, {
  canvas: at("floor"), form: at("place"), going: at("going"),
  x: at("place-x"), y: at("place-y"), yaw: at("place-yaw"),
  nearer: at("nearer"), further: at("further"),
});

const driver = new Driver(
  link, wheel, notice, named("drive wheel-state take let-go share share-out"),
);

const UNHEARD = 1000; // ms
let silence = false; // as the notice tells

link.addEventListener("state", ({ detail: { name, text } }) => {
  status.connection(name, text);
  if (name === "open") void catchUp();
  if (name === "live" && silence) {
    notice("");
    silence = false;
  }
  if (name !== "live") {
    driver.show();
    view.doubt(name);
  }
});
link.addEventListener("fault", (event) => {
  silence = link.unheard >= UNHEARD;
  notice(event.detail);
  wheel.goal = null; // it may have been refused
});
link.addEventListener("frame", (event) => {
  const frame = event.detail;
  for (const part of [status, wheel, sliders, crouch, actions, push, disturb, replay, why, balance, traces, view, floor, log]) {
    try {
      part.hear(frame);
    } catch (error) {
      console.warn("a part of the page could not show a frame", error);
    }
  }
});

let known = ""; // the library, as it came

/** Get what frames do not carry: events from before, and the library. */
async function catchUp() {
  await log.fill();
  const raw = await link.get("/library");
  if (!raw) {
    setTimeout(() => link.isOpen && void catchUp(), RETRY);
    return;
  }
  if (JSON.stringify(raw) === known) return; // another robot may have taken the place
  known = JSON.stringify(raw);
  const library = readLibrary(raw);
  for (const part of [status, sliders, crouch, why, traces, push, disturb]) part.library(library);
}

link.open();
