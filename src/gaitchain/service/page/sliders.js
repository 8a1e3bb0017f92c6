// Sliders for each axis alone, over all that the library walks that way.

import { fixed, say } from "./words.js";

const UNITS = ["m/s", "m/s", "rad/s"];
const DEAD = 0.02; // of the most
const WORDS = [
  ["back", "ahead"],
  ["right", "left"],
  ["right", "left"],
];

/** Three sliders that show what the driver asks for, and ask for it when moved. */
export class Sliders {
  #grabbed = -1;

  constructor(root, hold, wheel, changed) {
    this.rows = [...root.querySelectorAll(".slider")];
    this.inputs = this.rows.map((row) => row.querySelector("input"));
    this.hold = hold;
    this.wheel = wheel;
    this.changed = changed;
    hold.addEventListener("click", () => this.#toggle());
    this.inputs.forEach((input, axis) => this.#wire(input, axis));
    this.library({ limits: [[0, 0], [0, 0], [0, 0]] });
  }

  get holds() {
    return this.hold.getAttribute("aria-checked") === "true";
  }

  /** Take the library's limits. */
  library({ limits }) {
    this.inputs.forEach((input, axis) => {
      const [low, high] = limits[axis];
      input.min = low < 0 ? "-1" : "0";
      input.max = high > 0 ? "1" : "0";
      input.step = "any";
      input.disabled = input.min === input.max;
      const ends = this.rows[axis].querySelectorAll(".ends span");
      const [less, more] = WORDS[axis];
      const none = input.disabled ? "this library does not walk so" : "";
      const least = low < 0 ? `${less} ${fixed(-low)}` : low > 0 ? `least ${fixed(low)}` : "";
      say(ends[0], none || least);
      say(ends[1], none ? "" : `${more} ${fixed(high)}`);
    });
    this.hear({ asked: [0, 0, 0], askedParts: [0, 0, 0] });
  }

  /** Show what is asked for; what is held here stays where it was put. */
  hear({ asked, askedParts }) {
    this.inputs.forEach((input, axis) => {
      const part = (this.wheel.wanted && this.wheel.held[axis]) || askedParts[axis] || 0;
      if (this.#grabbed !== axis) input.value = String(part);
      fill(input, 0);
      const words = `${fixed(asked[axis])} ${UNITS[axis]}`;
      say(this.rows[axis].querySelector("output"), words);
      input.setAttribute("aria-valuetext", words);
    });
  }

  /** Go back to zero, and hold no more. */
  release() {
    this.#grabbed = -1;
    this.hold.setAttribute("aria-checked", "false");
  }

  parts() {
    return [0, 0, 0];
  }

  #wire(input, axis) {
    input.addEventListener("input", () => {
      this.#grabbed = axis;
      fill(input, 0);
      this.#ask(axis, snapped(Number(input.value)));
    });
    for (const name of ["pointerup", "pointercancel", "keyup", "blur"]) {
      input.addEventListener(name, () => this.#end(axis));
    }
  }

  #ask(axis, part) {
    this.wheel.held = this.wheel.held.map((old, i) => (i === axis ? part : old));
    this.changed();
  }

  #end(axis) {
    if (this.#grabbed !== axis) return;
    this.#grabbed = -1;
    if (this.holds && this.wheel.wanted) return;
    // At once, not with the next frame: a slider at its end would not hear the End key.
    this.inputs[axis].value = "0";
    fill(this.inputs[axis], 0);
    this.#ask(axis, 0);
  }

  #toggle() {
    const holds = !this.holds;
    this.hold.setAttribute("aria-checked", String(holds));
    if (holds) return;
    this.wheel.held = [0, 0, 0];
    this.wheel.tick();
  }
}

/** Let a slider rest at its zero. */
function snapped(part) {
  return Math.abs(part) < DEAD ? 0 : part;
}

/** Colour a slider's track from its zero to its value. */
export function fill(input, zero) {
  const [low, high] = [Number(input.min), Number(input.max)];
  const part = (value) => (high > low ? (100 * (value - low)) / (high - low) : 0);
  const [from, to] = [part(zero), part(Number(input.value))].sort((a, b) => a - b);
  const long = Math.min(to - from, 99.9);
  const turned = getComputedStyle(input).direction === "rtl";
  const start = turned ? 100 - to : from;
  // A background's position in per cent leaves its own length out.
  input.style.setProperty("--from", `${(100 * start) / (100 - long)}%`);
  input.style.setProperty("--long", `${long}%`);
  if (low < 0) input.style.setProperty("--zero", `${turned ? 100 - part(0) : part(0)}%`);
}
