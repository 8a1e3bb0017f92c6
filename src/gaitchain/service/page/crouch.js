// The slider that lowers the hips; it stays where it is put until the wheel is let go.

import { fill } from "./sliders.js";
import { inward, say } from "./words.js";

/** Shows how low the driver wants the hips, and asks for it when moved. */
export class Crouch {
  constructor(row, wheel, changed) {
    this.input = row.querySelector("input");
    this.output = row.querySelector("output");
    this.ends = row.querySelectorAll(".ends span");
    this.wheel = wheel;
    this.input.addEventListener("input", () => {
      fill(this.input, 0);
      wheel.crouch = Number(this.input.value);
      changed();
    });
    this.library({ crouch: [NaN, NaN] });
  }

  /** Take the library's limits: at rest, and at its fastest. */
  library({ crouch: [most, fast] }) {
    this.most = most > 0 ? most : 0;
    this.input.disabled = this.most === 0;
    const none = "this library does not crouch";
    say(this.ends[0], this.most ? `at full speed ${inward(fast)}` : none);
    say(this.ends[1], this.most ? `most ${inward(most)}` : "");
    this.hear({ crouch: { asked: 0, done: 0 } });
  }

  /** Show what is asked for; what this page asks for stays where it was put. */
  hear({ crouch: { asked } }) {
    const part = this.most ? (asked || 0) / this.most : 0;
    // Who takes the wheel of a robot that is low leaves it there.
    if (!this.wheel.wanted) this.wheel.crouch = part;
    this.input.value = String(this.wheel.crouch);
    fill(this.input, 0);
    const words = `${inward(asked)} m`;
    say(this.output, words);
    this.input.setAttribute("aria-valuetext", words);
  }
}
