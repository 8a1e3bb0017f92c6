// The 3-D view in its frame: loaded when wanted, with the page's keys inside it.

/** Show the viewer, open on a desk, closed on a phone. */
export class View {
  /** entered: takes the frame's window once it has loaded. */
  constructor({ box, frame, toggle }, entered) {
    Object.assign(this, { box, frame, toggle, entered });
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    toggle.addEventListener("click", () => this.#show(box.hidden));
    frame.addEventListener("load", () => this.#enter());
    this.dark.addEventListener("change", () => {
      if (frame.src) this.#load();
    });
    this.#show(matchMedia("(min-width: 48rem)").matches);
  }

  #show(open) {
    this.box.hidden = !open;
    this.toggle.setAttribute("aria-expanded", String(open));
    this.toggle.textContent = open ? "Hide" : "Show";
    if (open) this.#load();
    else this.frame.removeAttribute("src"); // a hidden scene costs no power
  }

  #load() {
    this.frame.src = this.dark.matches ? "/viewer/?darkMode" : "/viewer/";
  }

  #enter() {
    // Keys that are pressed while the view has the focus must still stop the robot.
    const view = this.frame.contentWindow;
    try {
      if (view.location.pathname.startsWith("/viewer")) this.entered(view);
    } catch {
      // An error page of the browser itself; it takes no keys.
    }
  }
}
