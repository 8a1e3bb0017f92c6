// What the robot is told to do, and why it cannot be told just now.

const CONFIRM = 1500; // ms in which the robot must say that it has stopped
const RESTS = ["standing", "rising", "safe"]; // modes in which torque may go off
const TWICE = 4000; // ms in which a second press counts
const ASKED_TWICE = {
  rest: "The robot will sink: hold it, then press Rest again.",
  get_up: "The robot moves all its joints: clear its place, then press Get up again.",
  reset: "Reset lets the robot go, and it may sink: hold it, then press Reset again.",
};

/** The buttons of the robot, with the reason where one cannot be used. */
export class Actions {
  #frame = null;
  #armed = ["", -Infinity]; // which button was pressed once, and when

  constructor(link, wheel, notice, page) {
    Object.assign(this, { link, wheel, notice, page });
    for (const name of ["start", "stop", "rest", "reset"]) {
      page[name].addEventListener("click", () => this.#press(name));
    }
    page.getUp.addEventListener("click", () => this.#press("get_up"));
    page.estop.addEventListener("click", () => this.emergency());
  }

  /** Take torque off at once; by two ways, as one of them may be gone. */
  emergency() {
    this.wheel.release();
    this.link.send("emergency_stop");
    void this.link.post("/emergency-stop");
    this.page.estop.classList.add("pressed");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#check(), CONFIRM);
  }

  stop() {
    this.wheel.release();
    if (!this.link.send("stop")) this.notice("Not sent: there is no connection.");
  }

  hear(frame) {
    this.#frame = frame;
    if (this.#stopped) {
      this.page.estop.classList.remove("pressed");
      this.page.unconfirmed.hidden = true;
    }
    for (const name of ["start", "rest", "reset"]) {
      this.page[name].setAttribute("aria-disabled", String(this.#why(name) !== ""));
    }
    this.page.getUp.hidden = !frame.canGetUp;
  }

  /** Whether nothing moves any more; a log that is played has no robot. */
  get #stopped() {
    const { mode, link, replay } = this.#frame ?? {};
    return Boolean(replay) || (mode === "stopped" && !link.holds);
  }

  /** Say why the robot cannot be told so, or "". */
  #why(name) {
    const mode = this.#frame?.mode;
    if (!this.link.isOpen || !mode) return "There is no connection to the robot.";
    if (this.wheel.taken) return `${this.wheel.driver} drives; only stopping is for everybody.`;
    if (name === "start" && mode !== "off") return "Start is for a robot that is off.";
    if (name === "rest" && !RESTS.includes(mode)) return "Rest is for a robot that stands.";
    if (name === "get_up" && !this.#frame.canGetUp) return "Get up is for a robot that has fallen.";
    if (name === "reset" && mode !== "safe" && mode !== "stopped") {
      return "Reset is for a robot that is safe or stopped.";
    }
    return "";
  }

  #press(name) {
    if (name === "stop") return this.stop();
    const why = this.#why(name);
    if (why) return this.notice(why);
    const now = performance.now();
    const [armed, since] = this.#armed;
    const again = armed === name && now - since <= TWICE;
    if (name in ASKED_TWICE && !this.#frame.simulated && !again) {
      this.#armed = [name, now];
      return this.notice(ASKED_TWICE[name]);
    }
    this.#armed = ["", -Infinity];
    this.notice("");
    if (name === "reset") this.page.unconfirmed.hidden = true;
    return this.link.send(name);
  }

  #check() {
    this.page.estop.classList.remove("pressed");
    this.page.unconfirmed.hidden = this.link.isOpen && this.#stopped;
  }
}
