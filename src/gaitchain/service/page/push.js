// Pushes on a simulated robot, from eight sides.

const MOST = 2; // m/s by which a push may change the robot's speed; the server's limit
const SOFT = 0.1; // m/s; a push to begin with
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

/** Eight buttons round a robot that is seen from above. */
export class Push {
  #why = "There is no connection to the robot.";

  constructor(link, wheel, notice, { dial, impulse, reason }) {
    Object.assign(this, { link, wheel, notice, impulse, reason });
    this.buttons = WAYS.map(([degrees, words, arrow]) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = arrow;
      button.setAttribute("aria-label", `Push ${words}`);
      button.title = `Push ${words}`;
      button.addEventListener("click", () => this.#push(degrees));
      dial.append(button);
      return button;
    });
  }

  /** Take the library: how hard a push is depends on how heavy the robot is. */
  library({ mass }) {
    if (!Number.isFinite(mass)) return;
    this.impulse.max = (Math.floor(10 * MOST * mass) / 10).toFixed(1);
    this.impulse.value = Math.max(0.1, SOFT * mass).toFixed(1);
  }

  hear(frame) {
    this.#why = "";
    if (!frame.simulated) this.#why = "Pushing is for a simulated robot; this one is real.";
    else if (this.wheel.taken) this.#why = `${this.wheel.driver} drives; you watch.`;
    const words = this.#why || "0.1 s on the trunk, as it faces";
    if (this.reason.textContent !== words) this.reason.textContent = words;
    for (const button of this.buttons) {
      button.setAttribute("aria-disabled", String(this.#why !== ""));
    }
  }

  #push(direction_deg) {
    const impulse_ns = Number(this.impulse.value);
    const fits = this.impulse.value !== "" && this.impulse.checkValidity();
    const { min, max } = this.impulse;
    const why = this.#why || (fits ? "" : `The impulse must be ${min} to ${max} N s.`);
    if (why) return this.notice(why);
    return this.link.send("push", { impulse_ns, direction_deg });
  }
}
