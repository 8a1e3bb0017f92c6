// Who drives: taking the wheel, letting it go, and how fast keys and sticks are.

import { fill } from "./sliders.js";
import { LOST, say } from "./words.js";

/** The head of the driver's panel. */
export class Driver {
  constructor(link, wheel, notice, page) {
    Object.assign(this, { link, wheel, notice, page });
    page.take.addEventListener("click", () => this.#take());
    page.letGo.addEventListener("click", () => wheel.letGo());
    page.share.addEventListener("input", () => this.#share());
    wheel.addEventListener("change", () => this.show());
    this.show();
    this.#share();
  }

  /** Show who has the wheel. */
  show() {
    const { link, wheel, page } = this;
    const text = wheel.mine
      ? "You drive."
      : wheel.taken
        ? `${wheel.driver} drives, you watch.`
        : wheel.wanted
          ? "Taking the wheel…"
          : "Nobody drives.";
    say(page.wheelState, text);
    page.wheelState.dataset.who = wheel.mine ? "me" : wheel.taken ? "other" : "nobody";
    page.take.hidden = wheel.wanted;
    page.take.setAttribute("aria-disabled", String(wheel.taken || !link.isOpen));
    page.letGo.hidden = !wheel.wanted;
    page.drive.classList.toggle("watching", !wheel.wanted);
  }

  #take() {
    const { link, wheel, notice } = this;
    if (wheel.taken) return notice(`${wheel.driver} drives; it must let go first.`);
    if (!link.isOpen) return notice(LOST);
    notice("");
    return wheel.take();
  }

  #share() {
    const { share, shareOut } = this.page;
    this.wheel.share = Number(share.value) / 100;
    say(shareOut, `${share.value} %`);
    fill(share, 0);
  }
}
