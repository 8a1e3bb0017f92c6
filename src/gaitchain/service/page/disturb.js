// What disturbs a simulated robot all the while: punches, swinging arms, a payload.

import { limited, readNumber, whyCalm } from "./push.js";
import { LOST, say, short } from "./words.js";

const SOFT = 0.3; // m/s by which the hardest punch changes the robot's speed, to begin with
const PERCENT = 100;

/** Three switches with their numbers; they show what the robot says. */
export class Disturb {
  #why = LOST;
  #on = { punches: false, arms: false, payload: false };

  constructor(link, wheel, notice, page) {
    Object.assign(this, { link, wheel, notice, page });
    const asks = {
      punches: () => this.#punches(),
      arms: () => "random",
      payload: () => this.#number("payloadPart", "payload", " %", PERCENT),
    };
    for (const [name, ask] of Object.entries(asks)) {
      page[name].addEventListener("click", () => this.#send(name, this.#on[name] ? null : ask()));
    }
    const change = (name) => this.#on[name] && this.#send(name, asks[name]());
    for (const name of ["punchesMost", "punchesEvery"]) {
      page[name].addEventListener("change", () => change("punches"));
    }
    page.payloadPart.addEventListener("change", () => change("payload"));
  }

  /** Take the library: how hard a punch is depends on how heavy the robot is. */
  library({ mass, disturb }) {
    if (!disturb) return;
    limited(this.page.punchesMost, [0.1, Math.floor(10 * disturb.impulse) / 10]);
    limited(this.page.punchesEvery, disturb.every);
    limited(this.page.payloadPart, disturb.payload.map((part) => PERCENT * part));
    this.page.punchesMost.value = Math.max(0.1, SOFT * mass).toFixed(1);
  }

  hear(frame) {
    const { page } = this;
    this.#why = whyCalm(frame, this.wheel);
    const { punches, swings, payload } = frame.disturbances;
    this.#on = { punches: punches !== null, arms: swings, payload: payload > 0 };
    for (const [name, on] of Object.entries(this.#on)) {
      page[name].setAttribute("aria-checked", String(on));
      page[name].setAttribute("aria-disabled", String(this.#why !== ""));
    }
    if (punches) {
      show(page.punchesMost, punches.most);
      show(page.punchesEvery, punches.every);
    }
    if (payload > 0) show(page.payloadPart, PERCENT * payload);
    say(page.disturbed, words(frame.disturbances));
  }

  #punches() {
    const most_ns = this.#number("punchesMost", "largest punch", " N s");
    const every_s = this.#number("punchesEvery", "interval", " s");
    return [most_ns, every_s].includes(undefined) ? undefined : { most_ns, every_s };
  }

  /** Read a number; undefined, and a notice, if it is beyond its limits. */
  #number(name, what, unit, scale = 1) {
    const [value, wrong] = readNumber(this.page[name], what, unit);
    if (wrong) this.notice(this.#why || wrong);
    return wrong ? undefined : value / scale;
  }

  #send(name, value) {
    if (value === undefined) return;
    if (this.#why) return void this.notice(this.#why);
    const sent = this.link.send("disturb", { [name]: value });
    this.notice(sent ? "" : LOST);
  }
}

/** Show what the robot says, unless somebody is typing. */
function show(input, value) {
  const text = short(value);
  if (document.activeElement !== input && input.value !== text) input.value = text;
}

function words({ punches, swings, payload }) {
  const parts = [
    punches && `punches of up to ${short(punches.most)} N s every ${short(punches.every)} s`,
    swings && "arms that swing",
    payload > 0 && `a payload of ${short(PERCENT * payload)} % of the mass`,
  ];
  return parts.filter(Boolean).join(", ") || "nothing but pushes";
}
