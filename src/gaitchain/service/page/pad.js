// Gamepads: left stick walks, right stick turns, one button of each stops at once.

const DEAD = 0.15;
const EMERGENCY = 1; // B, or the circle
const STOP = 0; // A, or the cross

/** A source of the wheel. */
export class Pad {
  #parts = [0, 0, 0];
  #pressed = { [EMERGENCY]: [], [STOP]: [] }; // on which gamepads
  #polling = false;
  #spent = false; // what was pulled before a release counts no more, until it is let go

  constructor(changed, emergency, stop, told) {
    Object.assign(this, { changed, emergency, stop, told });
    window.addEventListener("gamepadconnected", () => this.#begin());
    window.addEventListener("gamepaddisconnected", () => this.#begin());
  }

  parts() {
    return this.#parts;
  }

  release() {
    this.#spent ||= this.#parts.some(Boolean);
    this.#parts = [0, 0, 0];
  }

  #begin() {
    if (this.#polling) return;
    this.#polling = true;
    requestAnimationFrame(() => this.#poll());
  }

  #poll() {
    const pads = [...navigator.getGamepads()].filter((one) => one?.connected);
    const known = pads.filter(isKnown);
    this.told(pads.map(words).join("; ") || "none; press a button of it");
    this.#watch(known, EMERGENCY, this.emergency);
    this.#watch(known, STOP, this.stop);
    const [x, y, turn] = [0, 1, 2].map((i) => dull(known[0]?.axes[i] ?? 0));
    const pulled = [-y, -x, -turn];
    this.#spent &&= pulled.some(Boolean);
    this.#set(this.#spent ? [0, 0, 0] : pulled);
    this.#polling = pads.length > 0;
    if (this.#polling) requestAnimationFrame(() => this.#poll());
  }

  /** Act once for each press, also where another gamepad's button is held. */
  #watch(pads, button, act) {
    const pressed = pads.filter((pad) => pad.buttons[button]?.pressed).map((pad) => pad.index);
    if (pressed.some((index) => !this.#pressed[button].includes(index))) act();
    this.#pressed[button] = pressed;
  }

  #set(parts) {
    const before = this.#parts;
    this.#parts = parts;
    if (parts.some((part, i) => Math.abs(part - before[i]) > 0.02)) this.changed();
  }
}

/** Whether axes and buttons are where this file has them: elsewhere a trigger may rest at -1. */
function isKnown(pad) {
  return pad.mapping === "standard";
}

function words(pad) {
  const what = isKnown(pad)
    ? "B or circle is the emergency stop"
    : "not read, as this browser does not know its layout";
  return `${pad.id.slice(0, 40)}: ${what}`;
}

function dull(value) {
  const size = Math.abs(value);
  return size < DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}
