// Why this pose: the chosen one and the runners-up, with what each would cost.

import { fixed, primitivesText, say } from "./words.js";

const ROWS = 5;
const DIGITS = 4;
const STAND = 0; // pose of the first and the last layer in which the robot stands

/** The panel of the chain: picture, heading, table; it can be frozen to be read. */
export class Why {
  #way = [null, null, null, null]; // pose of each layer in this step, as far as known
  #shown = "";
  #layers = [];

  constructor(chain, { title, now, body, freeze, sizes }) {
    Object.assign(this, { chain, title, now, body, freeze, sizes });
    freeze.addEventListener("click", () => {
      freeze.setAttribute("aria-checked", String(!this.frozen));
      this.#shown = "";
    });
    this.rows = Array.from({ length: ROWS }, () => this.#row());
  }

  get frozen() {
    return this.freeze.getAttribute("aria-checked") === "true";
  }

  library(library) {
    this.#layers = library.layers;
    this.#shown = "";
    this.chain.library(library);
  }

  hear(frame) {
    // A robot that stands still has its last choice behind it.
    const choice = frame.mode === "walking" && frame.choice?.layer > 0 ? frame.choice : null;
    if (choice) this.#follow(choice);
    else this.#way = [STAND, null, null, null];
    const key = choice
      ? `${choice.layer} ${choice.pose} ${choice.target} ${choice.decided.cost} ${choice.sizes.length}`
      : frame.mode;
    if (!this.#layers.length || this.frozen || key === this.#shown) return;
    this.#shown = key;
    this.chain.mark(choice, this.#way, frame.mode === "standing");
    this.#tell(choice);
  }

  #follow(choice) {
    const last = this.#way.length - 1;
    const before = this.#way.findLastIndex((pose) => pose !== null);
    const other = choice.layer === before && choice.pose !== this.#way[before];
    if (choice.layer < before || other) {
      // A new step: it begins with the pose in which the one before it ended.
      this.#way = [before === last ? this.#way[last] : null, null, null, null];
    }
    this.#way[choice.layer] = choice.pose;
  }

  #tell(choice) {
    const rows = choice ? [choice.decided, ...choice.decided.others] : [];
    say(this.now, choice ? heading(choice) : "not walking: no choice to make");
    say(this.title, title(choice, rows.length));
    say(this.sizes, sizesText(choice));
    this.rows.forEach((cells, rank) => this.#fill(cells, rows[rank], rank, choice));
    if (choice && rows.length === 1) say(this.rows[1][0], "no other way leads on");
  }

  #fill(cells, one, rank, choice) {
    cells[0].closest("tr").classList.toggle("chosen-row", rank === 0 && Boolean(one));
    const words = one ? this.#words(one, rank, choice) : ["\u00a0", "\u00a0", "", "", "", ""];
    cells.forEach((cell, i) => say(cell, words[i]));
  }

  #words(one, rank, choice) {
    const name = rank ? `${one.pose}` : `${one.pose} (chosen)`;
    const more = rank ? `+${fixed(one.cost - choice.decided.cost, DIGITS)}` : "";
    const off = choice.decided.byCommand ? fixed(one.cost - one.walking, DIGITS) : "–";
    const costs = [fixed(one.cost, DIGITS), more, fixed(one.walking, DIGITS), off];
    return [name, this.#made(choice, one, rank), ...costs];
  }

  #made(choice, one, rank) {
    const known = this.chain.describe(choice.decided.layer, one.pose);
    return known || (rank === 0 ? primitivesText(choice.primitives) : "");
  }

  #row() {
    const row = this.body.insertRow();
    const [pose, ...costs] = [0, 1, 2, 3, 4].map(() => row.insertCell());
    return [...lines(pose), ...costs];
  }
}

/** Two lines in a cell; the second one goes on below the other cells. */
function lines(cell) {
  const both = [0, 1].map(() => document.createElement("div"));
  both[1].className = "made muted";
  cell.append(...both);
  return both;
}

function heading(choice) {
  const leg = choice.leftSupport ? "left" : "right";
  const way = `${leg} leg, to ${choice.moment} pose ${choice.pose}`;
  return `${way}; the step ends in pose ${choice.target}`;
}

/** How far a disturbed walk steps, and what other sizes would cost; 1 is a fall. */
function sizesText(choice) {
  if (!choice) return "\u00a0";
  if (!choice.sizes.length) return "Not disturbed: the step is as commanded.";
  const [[size, cost], ...others] = choice.sizes;
  const percent = (part) => `${fixed(100 * part, 0)} %`;
  const more = others.map(([other, its]) => `${percent(other)} ${fixed(its, 4)}`);
  const chosen = `a step of ${percent(size)} of the range, expected cost ${fixed(cost, 4)}`;
  return `Disturbed: ${[chosen, ...more].join("; ")} (a fall costs 1)`;
}

function title(choice, count) {
  if (!choice) return "Why this pose";
  const best = count > ROWS ? `: the best ${ROWS} of ${count}` : "";
  const { layer, pose, byCommand } = choice.decided;
  const what = byCommand ? ", by expected cost and distance to the command" : ", by expected cost";
  return `Why kp_${layer + 1} pose ${pose}${best}${what}`;
}
