// The keyboard: hold to walk, release to stop; Space and Esc stop at once, always.

const DRIVE = {
  KeyW: [0, 1],
  KeyS: [0, -1],
  KeyA: [1, 1],
  KeyD: [1, -1],
  KeyQ: [2, 1],
  KeyE: [2, -1],
};
const EMERGENCY = ["Space", "Escape"];
const UNHEARD = ["MetaLeft", "MetaRight"]; // macOS tells of no key that is lifted meanwhile
const TYPED = "input[type=number], input[type=text], input[type=password], textarea, select";

/** A source of the wheel that reads the keyboard of this page and of its frames. */
export class Keys {
  #down = new Set();

  constructor(changed, emergency) {
    this.changed = changed;
    this.emergency = emergency;
    this.listen(window);
  }

  /** Listen before anything else in a window does. */
  listen(view) {
    view.addEventListener("keydown", (event) => this.#press(event), true);
    view.addEventListener("keyup", (event) => this.#lift(event), true);
    for (const name of ["blur", "contextmenu"]) view.addEventListener(name, () => this.#forget());
  }

  parts() {
    const parts = [0, 0, 0];
    for (const code of this.#down) parts[DRIVE[code][0]] += DRIVE[code][1];
    return parts;
  }

  release() {
    this.#down.clear();
  }

  #press(event) {
    if (EMERGENCY.includes(event.code)) {
      // Space on a focused button would press it; here it must stop the robot.
      this.#take(event);
      if (!event.repeat) this.emergency();
      return;
    }
    if (UNHEARD.includes(event.code)) this.#forget();
    // A frame's elements are of classes of their own, so `instanceof` would not do.
    if (event.target.matches?.(TYPED) || event.ctrlKey || event.altKey || event.metaKey) return;
    if (!(event.code in DRIVE)) return;
    this.#take(event);
    if (event.repeat) return;
    this.#down.add(event.code);
    this.changed();
  }

  /** Count no key as held whose lifting may not be heard. */
  #forget() {
    if (!this.#down.size) return;
    this.release();
    this.changed();
  }

  #lift(event) {
    if (EMERGENCY.includes(event.code)) this.#take(event);
    if (this.#down.delete(event.code)) this.changed();
  }

  #take(event) {
    event.preventDefault();
    event.stopImmediatePropagation();
  }
}
