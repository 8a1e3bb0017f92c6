// Pushes on a simulated robot, from eight sides.

import { LOST, say } from "./words.js";
import { whyNot } from "./wheel.js";

const SOFT = 0.1; // m/s; a push to begin with
const FAR = 4.3; // rem from the middle of the dial
const WAYS = [
  [0, "forward", "↑"],
  [-45, "forward and to the right", "↗"],
  [-90, "to the right", "→"],
  [-135, "back and to the right", "↘"],
  [180, "back", "↓"],
  [135, "back and to the left", "↙"],
  [90, "to the left", "←"],
  [45, "forward and to the left", "↖"],
];

const ANY = "any"; // body that the server draws by its mass

/** Say why a robot cannot be disturbed just now, or "". */
export function whyCalm(frame, wheel) {
  const real = frame && !frame.replay && !frame.simulated;
  return real ? "Only a simulated robot can be disturbed, which this one is not." : whyNot(frame, wheel);
}

/** Set the ends of a number's input. */
export function limited(input, [low, high]) {
  input.min = String(low);
  input.max = String(high);
}

/** Read a number, and say what is wrong with it, if anything. */
export function readNumber(input, what, unit) {
  const fits = input.value !== "" && input.checkValidity();
  const wrong = `The ${what} must be ${input.min} to ${input.max}${unit}.`;
  return [Number(input.value), fits ? "" : wrong];
}

/** Eight buttons round a robot that is seen from above. */
export class Push {
  #why = LOST;

  constructor(link, wheel, notice, { dial, impulse, body, elevation, pushWhy }) {
    Object.assign(this, { link, wheel, notice, impulse, body, elevation, pushWhy });
    this.buttons = WAYS.map(([degrees, words, arrow]) => {
      const button = document.createElement("button");
      const title = `Push ${words}`;
      Object.assign(button, { type: "button", textContent: arrow, title, ariaLabel: title });
      button.style.translate = [Math.sin, Math.cos]
        .map((part) => `${-FAR * part((degrees * Math.PI) / 180)}rem`)
        .join(" ");
      button.addEventListener("click", () => this.#push(degrees));
      dial.append(button);
      return button;
    });
  }

  /** Take the library: how hard a push is depends on how heavy the robot is. */
  library({ mass, disturb }) {
    if (!disturb) return;
    limited(this.impulse, [0.1, Math.floor(10 * disturb.impulse) / 10]);
    limited(this.elevation, disturb.elevation);
    this.impulse.value = Math.max(0.1, SOFT * mass).toFixed(1);
    const names = [...disturb.bodies, ANY];
    this.body.replaceChildren(...names.map((name) => new Option(name.replaceAll("_", " "), name)));
  }

  hear(frame) {
    this.#why = whyCalm(frame, this.wheel);
    say(this.pushWhy, this.#why || "pushes last 0.1 s; directions as the trunk faces");
    for (const button of this.buttons) {
      button.setAttribute("aria-disabled", String(this.#why !== ""));
    }
  }

  #push(direction_deg) {
    const [impulse_ns, hard] = readNumber(this.impulse, "impulse", " N s");
    const [elevation_deg, steep] = readNumber(this.elevation, "elevation", "°");
    const why = this.#why || hard || steep;
    if (why) return this.notice(why);
    const push = { impulse_ns, direction_deg, elevation_deg };
    if (this.body.value) push.body = this.body.value;
    return this.notice(this.link.send("push", push) ? "" : LOST);
  }
}
