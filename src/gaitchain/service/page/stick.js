// Sticks that a finger or a mouse pulls; they spring back when let go.

const DEAD = 0.08; // of the way; a resting thumb is no command

/** A source of the wheel. */
export class Stick {
  #pulled = null;
  #at = [0, 0]; // to the right, up, each in [-1, 1]

  /**
   * element: what is pulled, with a `.knob` in it.
   * flat: whether it only goes sideways.
   * toParts: from (to the right, up) to the parts of vx, vy, yaw rate.
   */
  constructor(element, flat, toParts, changed) {
    Object.assign(this, { element, flat, toParts, changed });
    this.knob = element.querySelector(".knob");
    element.addEventListener("pointerdown", (event) => this.#pull(event));
    element.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(name, (event) => this.#end(event));
    }
  }

  parts() {
    const [right, up] = this.#at.map((part) => (Math.abs(part) < DEAD ? 0 : part));
    return this.toParts(right, up);
  }

  release() {
    this.#pulled = null;
    this.#put(0, 0);
  }

  #pull(event) {
    if (event.button !== 0) return;
    event.preventDefault();
    this.#pulled = event.pointerId;
    this.element.setPointerCapture(event.pointerId);
    this.#move(event);
  }

  #move(event) {
    if (event.pointerId !== this.#pulled) return;
    const box = this.element.getBoundingClientRect();
    const knob = this.knob.getBoundingClientRect().width;
    const across = (box.width - knob) / 2;
    const right = (event.clientX - box.left - box.width / 2) / across;
    const up = this.flat ? 0 : (box.top + box.height / 2 - event.clientY) / across;
    const reach = Math.max(1, Math.hypot(right, up));
    this.#put(right / reach, up / reach);
    this.changed();
  }

  #end(event) {
    if (event.pointerId !== this.#pulled) return;
    this.release();
    this.changed();
  }

  #put(right, up) {
    this.#at = [right, up];
    const box = this.element;
    const across = (box.clientWidth - this.knob.offsetWidth) / 2;
    this.knob.style.transform = `translate(${right * across}px, ${-up * across}px)`;
    box.classList.toggle("pulled", right !== 0 || up !== 0);
  }
}
