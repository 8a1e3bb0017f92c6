// A log that is played: on and off, where, and how fast.

import { say } from "./words.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

/** The bar of a replay; hidden while a robot is live, as what drives one is in a replay. */
export class Replay {
  #playing = false;
  #held = false; // somebody moves the bar: it follows them, not the log
  #other = new Option(); // a speed that a program has set, and that is not offered

  constructor(link, notice, page) {
    Object.assign(this, { link, notice, page });
    for (const speed of SPEEDS) page.speed.add(new Option(`${speed} x`, speed));
    page.play.addEventListener("click", () => this.#ask({ playing: !this.#playing }));
    page.bar.addEventListener("pointerdown", () => (this.#held = true));
    for (const name of ["pointerup", "pointercancel", "blur"]) {
      page.bar.addEventListener(name, () => (this.#held = false));
    }
    page.bar.addEventListener("input", () => this.#show(Number(page.bar.value), Number(page.bar.max)));
    page.bar.addEventListener("change", () => this.#ask({ at_s: Number(page.bar.value) }));
    page.speed.addEventListener("change", () => this.#ask({ speed: Number(page.speed.value) }));
  }

  get isOn() {
    return !this.page.box.hidden;
  }

  hear({ replay }) {
    const { page } = this;
    page.box.hidden = replay === null;
    document.body.classList.toggle("replaying", this.isOn);
    if (!replay) return;
    this.#playing = replay.playing;
    say(page.play, replay.playing ? "Pause" : "Play");
    page.bar.max = String(replay.length);
    if (document.activeElement !== page.speed) this.#showSpeed(replay.speed);
    if (this.#held) return;
    page.bar.value = String(replay.at);
    this.#show(replay.at, replay.length);
  }

  #showSpeed(speed) {
    const select = this.page.speed;
    select.value = String(speed);
    if (select.value) return;
    Object.assign(this.#other, { value: String(speed), text: `${speed} x` });
    select.add(this.#other, [...select.options].find(({ value }) => Number(value) > speed));
    select.value = String(speed);
  }

  #show(at, length) {
    say(this.page.time, `${at.toFixed(1)} of ${length.toFixed(1)} s`);
  }

  #ask(what) {
    if (!this.link.send("replay", what)) this.notice("Not sent: there is no connection.");
  }
}
