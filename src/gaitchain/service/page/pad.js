// A gamepad: left stick walks, right stick turns, one button stops at once.

const DEAD = 0.15;
const EMERGENCY = 1; // B, or the circle
const STOP = 0; // A, or the cross

/** A source of the wheel. */
export class Pad {
  #parts = [0, 0, 0];
  #pressed = { [EMERGENCY]: false, [STOP]: false };
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
    const pad = [...navigator.getGamepads()].find((one) => one?.connected);
    if (!pad) {
      this.#polling = false;
      this.told("none; press a button of it");
      this.#set([0, 0, 0]);
      return;
    }
    this.told(`${pad.id.slice(0, 40)}: B or circle is the emergency stop`);
    this.#watch(pad, EMERGENCY, this.emergency);
    this.#watch(pad, STOP, this.stop);
    const [x, y, turn] = [0, 1, 2].map((i) => dull(pad.axes[i] ?? 0));
    const pulled = [-y, -x, -turn];
    this.#spent &&= pulled.some(Boolean);
    this.#set(this.#spent ? [0, 0, 0] : pulled);
    requestAnimationFrame(() => this.#poll());
  }

  #watch(pad, button, act) {
    const pressed = pad.buttons[button]?.pressed ?? false;
    if (pressed && !this.#pressed[button]) act();
    this.#pressed[button] = pressed;
  }

  #set(parts) {
    const before = this.#parts;
    this.#parts = parts;
    if (parts.some((part, i) => Math.abs(part - before[i]) > 0.02)) this.changed();
  }
}

function dull(value) {
  const size = Math.abs(value);
  return size < DEAD ? 0 : (Math.sign(value) * (size - DEAD)) / (1 - DEAD);
}
