// Who drives; and what this page asks for, ten times a second while it has the wheel.

import { LOST } from "./words.js";

const PERIOD = 100; // ms
const TAKEN = 500; // ms after which another driver in the frames means that it is theirs
const ZERO = [0, 0, 0];
const AT_REST = ["off", "safe", "stopped", "getting_up"]; // a key held since before counts no more

/** Say why nobody asks the robot for anything here just now, or "". */
export function whyNot(frame, { taken, driver }) {
  if (!frame) return LOST;
  if (frame.replay) return "This is a replay: what happened, happened.";
  return taken ? `${driver} drives; you watch.` : "";
}

/**
 * Asks for parts of the most that the library walks, each in [-1, 1]; the server knows
 * what command they make together. Event: `change` (who drives).
 */
export class Wheel extends EventTarget {
  #wanted = false;
  #since = 0;
  #sent = 0;
  #last = ZERO;
  #mode = "";
  #goes = false; // whether the robot has said that it goes to the goal

  constructor(link) {
    super();
    this.link = link;
    this.driver = "";
    this.share = 0.6; // of the most, at full stick
    this.held = ZERO; // parts from the sliders
    this.goal = null; // place to go to: x, y, yaw
    this.crouch = 0; // part of the lowest; no motion, so a stop leaves it
    this.sources = []; // give parts of the most, each in [-1, 1]
    setInterval(() => this.tick(true), PERIOD);
    this.watch(window);
    window.addEventListener("pagehide", () => this.letGo());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.letGo();
    });
    link.addEventListener("state", (event) => {
      // The server took the wheel away with the socket; taking it again is deliberate.
      if (event.detail.name === "waiting") this.#drop("");
    });
  }

  get mine() {
    return this.#wanted && this.driver === this.link.driver;
  }

  get wanted() {
    return this.#wanted;
  }

  get taken() {
    return this.driver !== "" && this.driver !== this.link.driver;
  }

  take() {
    if (this.taken || !this.link.isOpen) return;
    this.release();
    this.#wanted = true;
    this.#since = performance.now();
    this.tick();
    this.#changed();
  }

  /** Ask for the way to a place, until anything else is asked for. */
  go(goal) {
    this.release();
    this.tick(true); // a zero: after a stop the robot takes no place before one
    this.goal = goal;
    this.#goes = false;
    this.tick(true);
  }

  letGo() {
    if (!this.#wanted) return;
    this.release();
    this.link.send("let_go");
    this.#drop(this.driver);
  }

  /** Release when the focus leaves this page; within it, it may wander. */
  watch(view) {
    view.addEventListener("blur", () => {
      setTimeout(() => document.hasFocus() || this.release());
    });
  }

  /** Stop asking for a motion, whatever asked for it. */
  release() {
    this.held = ZERO;
    this.goal = null;
    for (const source of this.sources) source.release();
    this.tick();
  }

  /** Take note of who drives. */
  hear(frame) {
    if (frame.driver !== this.driver) {
      this.driver = frame.driver;
      this.#changed();
    }
    if (frame.mode !== this.#mode && AT_REST.includes(frame.mode)) {
      this.crouch = 0;
      this.release();
    }
    this.#mode = frame.mode;
    if (this.#goes && !frame.going) this.goal = null; // somebody stopped it
    this.#goes = this.goal !== null && frame.going !== null;
    if (this.#wanted && this.taken && performance.now() - this.#since > TAKEN) {
      this.#drop(this.driver);
    }
  }

  /** Whether anything is pulled or held. */
  get pulled() {
    return [...this.#pulls(), ...this.held, this.crouch].some(Boolean);
  }

  /** Ask for what is pulled now, if this page has the wheel: on the beat or at once. */
  tick(beat = false) {
    const pulls = this.#pulls().map((part) => part * this.share);
    const parts = this.#wanted ? pulls.map((part, i) => part || this.held[i]) : ZERO;
    const changed = parts.some((part, i) => part !== this.#last[i]);
    if (parts.some(Boolean)) this.goal = null;
    // Sliders ask beyond the share of keys and sticks.
    const most = parts.some((part, i) => part && !pulls[i]) ? 1 : this.share;
    if (this.#wanted && (beat || changed)) this.#send(parts, most, beat);
    this.#last = parts;
  }

  #send(parts, most, beat) {
    if (this.goal) return void (beat && this.link.send("go_to", { ...this.goal, crouch: this.crouch }));
    const stops = !parts.some(Boolean);
    const now = performance.now();
    // A stick that is pulled changes with every pixel; only a stop cannot wait.
    if (!beat && !stops && now - this.#sent < PERIOD) return;
    this.#sent = now;
    const [ahead, left, turn] = parts;
    this.link.send("steer", { ahead, left, turn, most, crouch: this.crouch });
  }

  /** The strongest pull of each axis. */
  #pulls() {
    return [0, 1, 2].map((axis) =>
      this.sources
        .map((source) => source.parts()[axis])
        .reduce((most, part) => (Math.abs(part) > Math.abs(most) ? part : most), 0),
    );
  }

  #drop(driver) {
    this.#wanted = false;
    this.crouch = 0;
    this.driver = driver === this.link.driver ? "" : driver;
    this.release();
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}
