// The head of the page: robot, mode, connection, and how well the loop keeps its rate.

import { MODES, commandText, fixed, say, supportWords } from "./words.js";

const CALM = 250; // ms between two readings of a number
const SLOW = 0.98; // of the rate that was asked for; less is amber
const LIMP = ["off", "stopped"];
const HOLDS = "Its torque may be ON: only its own power switch is sure.";
const KINDS = {
  simulation: "simulation",
  mock: "mock robot",
  emulated: "emulated servos",
  real: "real robot",
};
const LEVELS = { live: "good", waiting: "bad", refused: "bad" };
const DEGREES = 180 / Math.PI;

/** Show what the robot does and how well all of it works. */
export class Status {
  #next = 0;
  #mode = ""; // the last one that was heard of

  constructor(page) {
    this.page = page;
  }

  library(library) {
    const { page } = this;
    say(page.robotName, library.name);
    document.title = `${library.name} · gaitchain`;
    const walked = library.qualified ? "qualified in physics" : "not qualified in physics";
    const robot = library.fingerprint.slice(0, 8);
    say(page.libraryFacts, `Robot ${robot}; library ${walked}, ${fixed(library.step)} s a step.`);
  }

  connection(name, text) {
    const { page } = this;
    if (name === "refused") page.signin.hidden = false;
    if (name === "accepted" || name === "live") page.signin.hidden = true;
    if (!text) return;
    say(page.connection, text);
    page.connectionFact.dataset.level = LEVELS[name] ?? "warn";
    document.body.classList.toggle("stale", name !== "live");
    if (name !== "live") this.#doubt();
  }

  /** What was heard last is no news. */
  #doubt() {
    const { page } = this;
    page.mode.dataset.mode = "unknown";
    say(page.mode, "Unknown");
    const last = this.#mode ? ` It was: ${this.#mode}.` : "";
    say(page.modeWords, `No news of the robot.${last}`);
    say(page.reason, "");
    for (const shown of [page.pace, page.robotLink]) say(shown, "–");
    for (const fact of [page.paceFact, page.linkFact]) delete fact.dataset.level;
    this.#next = 0;
  }

  hear(frame) {
    const { page } = this;
    const [name, words] = MODES[frame.mode] ?? [frame.mode || "Unknown", ""];
    this.#mode = name;
    page.mode.dataset.mode = frame.mode in MODES ? frame.mode : "unknown";
    say(page.mode, name);
    say(page.modeWords, LIMP.includes(frame.mode) && frame.link.holds ? HOLDS : words);
    page.reason.ariaLive = frame.replay ? "off" : "polite"; // it tells the time of a log
    say(page.reason, frame.reason);
    // Nobody saw a robot fall that lay there from the beginning.
    page.fall.hidden = frame.fall === "" && !frame.canGetUp;
    say(page.fallTitle, frame.fall ? "Why it fell" : "It lies there");
    say(page.fallSentence, frame.fall || frame.reason);
    page.robotKind.hidden = false;
    say(page.robotKind, [frame.replay && "replay", KINDS[frame.kind]].filter(Boolean).join(", "));
    const now = performance.now();
    if (now < this.#next) return;
    this.#next = now + CALM;
    this.#pace(frame.pace);
    this.#link(frame.link);
    this.#drive(frame);
    this.#body(frame);
  }

  #pace(pace) {
    const { page } = this;
    const [late, worst] = [pace.late, pace.worst].map((time) => `${fixed(1e3 * time)} ms late`);
    say(page.pace, `${fixed(pace.rate, 0)} Hz, p99 ${late}, ${fixed(pace.overruns, 0)} overruns`);
    const wanted = `Asked for ${fixed(1 / pace.period, 0)} Hz.`;
    page.pace.title = `${wanted} The latest tick since the start began ${worst}.`;
    const slow = pace.rate * pace.period < SLOW || pace.late > 0.5 * pace.period;
    page.paceFact.dataset.level = slow ? "warn" : "good";
  }

  #link(link) {
    const { page } = this;
    const share = link.sent > 0 ? link.lost / link.sent : 0;
    const lost = link.sent ? `${fixed(link.lost, 0)} of ${fixed(link.sent, 0)} lost` : "none lost";
    const supply = link.supply > 0 ? `, ${fixed(link.supply, 1)} V` : "";
    say(page.robotLink, link.note || lost + supply);
    page.linkFact.dataset.level = link.note || share > 0.01 ? "warn" : "good";
  }

  #drive(frame) {
    const { page } = this;
    say(page.asked, commandText(frame.asked, frame.crouch.asked));
    say(page.carried, commandText(frame.command, frame.crouch.done));
    say(page.note, frame.note || "none");
  }

  #body(frame) {
    const { page } = this;
    const [roll, pitch] = frame.tilt.map((angle) => fixed(angle * DEGREES, 1));
    say(page.support, supportWords(frame.support));
    say(page.steps, fixed(frame.steps, 0));
    say(page.tilt, `${roll}°, ${pitch}°`);
    say(page.sensors, frame.status || "all well");
  }
}
