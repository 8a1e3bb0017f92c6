// Sliders for exact speeds, within the library's limits.

import { fixed, say } from "./words.js";

const UNITS = ["m/s", "m/s", "rad/s"];
const WORDS = [
  ["back", "ahead"],
  ["right", "left"],
  ["right", "left"],
];

/** Three sliders that show what is asked for, and ask for it when they are moved. */
export class Sliders {
  #grabbed = -1;

  constructor(root, hold, wheel) {
    this.rows = [...root.querySelectorAll(".slider")];
    this.inputs = this.rows.map((row) => row.querySelector("input"));
    this.hold = hold;
    this.wheel = wheel;
    hold.addEventListener("click", () => this.#toggle());
    this.inputs.forEach((input, axis) => this.#wire(input, axis));
    wheel.addEventListener("drive", (event) => this.show(event.detail));
    this.fit(wheel.limits);
  }

  get holds() {
    return this.hold.getAttribute("aria-checked") === "true";
  }

  /** Take the library's limits. */
  fit(limits) {
    this.inputs.forEach((input, axis) => {
      const [low, high] = limits[axis];
      const span = Math.max(high, 0) - Math.min(low, 0);
      input.min = String(Math.min(low, 0));
      input.max = String(Math.max(high, 0));
      input.step = "any";
      input.disabled = span === 0;
      const ends = this.rows[axis].querySelectorAll(".ends span");
      const [less, more] = WORDS[axis];
      const none = span === 0 ? "this library does not walk so" : "";
      const least = low < 0 ? `${less} ${fixed(-low)}` : low > 0 ? `least ${fixed(low)}` : "";
      say(ends[0], none || least);
      say(ends[1], none ? "" : `${more} ${fixed(high)}`);
    });
    this.show([0, 0, 0]);
  }

  /** Show a command. */
  show(command) {
    this.inputs.forEach((input, axis) => {
      if (this.#grabbed !== axis) input.value = String(command[axis]);
      fill(input, 0);
      const words = `${fixed(command[axis])} ${UNITS[axis]}`;
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
      this.#ask(axis, snapped(Number(input.value), this.wheel.limits[axis]));
    });
    for (const name of ["pointerup", "pointercancel", "keyup", "blur"]) {
      input.addEventListener(name, () => this.#end(axis));
    }
  }

  #ask(axis, value) {
    this.wheel.held = this.wheel.held.map((old, i) => (i === axis ? value : old));
    this.wheel.tick();
    if (!this.wheel.wanted) this.show(this.wheel.held);
  }

  #end(axis) {
    if (this.#grabbed !== axis) return;
    this.#grabbed = -1;
    if (this.holds && this.wheel.wanted) this.show(this.wheel.held);
    else this.#ask(axis, 0);
  }

  #toggle() {
    const holds = !this.holds;
    this.hold.setAttribute("aria-checked", String(holds));
    if (holds) return;
    this.wheel.held = [0, 0, 0];
    this.wheel.tick();
  }
}

/** Take a value into the limits; the paper's walk has a least speed above 0. */
function snapped(value, [low, high]) {
  const inside = Math.min(Math.max(value, Math.min(low, 0)), high);
  if (Math.abs(inside) < 0.02 * Math.max(high, -low)) return 0;
  return low > 0 && inside < low ? low : inside;
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
