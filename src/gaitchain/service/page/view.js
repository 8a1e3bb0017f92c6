// The 3-D view in its frame: loaded when wanted, again when it died, with the page's keys.

import { say } from "./words.js";

const STYLE = "/page/viewer.css";
const PHONE = "(max-width: 47.99rem), (max-height: 30rem) and (pointer: coarse)"; // as in style.css

/** Show the viewer, open on a desk, closed on a phone. */
export class View {
  #drawn = null; // number of the process that draws, by the latest frame
  #shown = null; // of the one that the frame was loaded for
  #lost = false; // whether the frame's socket went with the page's own

  /** entered: takes the frame's window once it has loaded. */
  constructor({ box, frame, toggle, stale }, entered) {
    Object.assign(this, { box, frame, toggle, stale, entered });
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    toggle.addEventListener("click", () => this.#show(box.hidden));
    frame.addEventListener("load", () => this.#enter());
    this.dark.addEventListener("change", () => this.#load());
    this.#show(!matchMedia(PHONE).matches);
  }

  /** Load the view where another process draws it than before, or the way there broke. */
  hear({ view }) {
    this.#drawn = view;
    if (view !== null && (view !== this.#shown || this.#lost)) this.#load();
    this.#tell(view === null ? "its part does not answer" : "");
  }

  /** Take note that the page's connection is not as it should be. */
  doubt(name) {
    if (name === "waiting") this.#lost = true; // it had the same way to the server
    if (name !== "accepted") this.#tell("no news of the robot");
  }

  #tell(why) {
    this.stale.hidden = why === "";
    say(this.stale, why && `This view is stale: ${why}. It comes back by itself.`);
  }

  #show(open) {
    this.box.hidden = !open;
    this.toggle.setAttribute("aria-expanded", String(open));
    this.toggle.textContent = open ? "Hide" : "Show";
    if (open) this.#load();
    else this.frame.removeAttribute("src"); // a hidden scene costs no power
  }

  #load() {
    if (this.box.hidden || this.#drawn === null) return;
    [this.#shown, this.#lost] = [this.#drawn, false];
    this.frame.src = this.dark.matches ? "/viewer/?darkMode" : "/viewer/";
  }

  #enter() {
    // Keys that are pressed while the view has the focus must still stop the robot.
    const view = this.frame.contentWindow;
    try {
      if (!view.location.pathname.startsWith("/viewer")) return;
      const link = view.document.createElement("link");
      Object.assign(link, { rel: "stylesheet", href: STYLE });
      view.document.head.append(link);
      this.entered(view);
    } catch {
      // An error page of the browser itself; it takes no keys.
    }
  }
}
