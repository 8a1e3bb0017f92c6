// Who drives; and what this page asks for, ten times a second while it has the wheel.

const PERIOD = 100; // ms
const TAKEN = 500; // ms after which another driver in the frames means that it is theirs
const ZERO = [0, 0, 0];
const AT_REST = ["off", "safe", "stopped"]; // a key held since before counts no more

/** Bring parts of the most, each in [-1, 1], into what the library walks together. */
export function together(parts) {
  const sum = parts.reduce((total, part) => total + Math.abs(part), 0);
  return sum > 1 ? parts.map((part) => part / sum) : parts;
}

/** Turn a part of the most into a speed; 0 where the library has none that way. */
export function speedOf(part, [low, high]) {
  if (part > 0 && high > 0) return Math.max(part * high, low);
  return part < 0 && low < 0 ? -part * low : 0;
}

/** Events: `change` (who drives), `drive` (detail: the command). */
export class Wheel extends EventTarget {
  #wanted = false;
  #since = 0;
  #sent = 0;
  #last = ZERO;
  #mode = "";

  constructor(link) {
    super();
    this.link = link;
    this.driver = "";
    this.limits = [[0, 0], [0, 0], [0, 0]];
    this.share = 0.6; // of the most, at full stick
    this.held = ZERO; // [m/s, m/s, rad/s] from the sliders
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
    for (const source of this.sources) source.release();
    this.tick();
  }

  /** Take note of who drives. */
  hear(frame) {
    if (frame.driver !== this.driver) {
      this.driver = frame.driver;
      this.#changed();
    }
    if (frame.mode !== this.#mode && AT_REST.includes(frame.mode)) this.release();
    this.#mode = frame.mode;
    if (this.#wanted && this.taken && performance.now() - this.#since > TAKEN) {
      this.#drop(this.driver);
    }
  }

  /** Ask for the present command, if this page has the wheel: on the beat or at once. */
  tick(beat = false) {
    const command = this.#wanted ? this.#command() : ZERO;
    const changed = command.some((value, i) => value !== this.#last[i]);
    if (this.#wanted && (beat || changed)) this.#send(command, beat);
    if (!changed) return;
    this.#last = command;
    this.dispatchEvent(new CustomEvent("drive", { detail: command }));
  }

  #send(command, beat) {
    const stops = !command.some(Boolean);
    const now = performance.now();
    // A stick that is pulled changes with every pixel; only a stop cannot wait.
    if (!beat && !stops && now - this.#sent < PERIOD) return;
    this.#sent = now;
    const [vx, vy, yaw_rate] = command;
    this.link.send("drive", { vx, vy, yaw_rate });
  }

  #command() {
    const strongest = [0, 1, 2].map((axis) =>
      this.sources
        .map((source) => source.parts()[axis])
        .reduce((most, part) => (Math.abs(part) > Math.abs(most) ? part : most), 0),
    );
    const parts = together(strongest).map((part) => part * this.share);
    return parts.map((part, i) => (part ? speedOf(part, this.limits[i]) : this.held[i]));
  }

  #drop(driver) {
    this.#wanted = false;
    this.driver = driver === this.link.driver ? "" : driver;
    this.release();
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}
