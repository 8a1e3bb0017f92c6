// Joint angles and torques of the last ten seconds.

import { Plot, tickText, ticks } from "./plot.js";
import { fixed, say } from "./words.js";

const SPAN = 10; // s
const LEAST = 0.02; // s between two frames that are kept; live they come every 0.04 s
const COLOURS = 6;
const CALM = 250; // ms between two readings of a number
const DEGREES = 180 / Math.PI;

/** Two plots over time, of the joints that are chosen. */
export class Traces {
  #frames = [];
  #next = 0;

  unit = "N m";

  constructor({ angles, loads, jointList }) {
    this.list = jointList;
    this.chips = [];
    this.chosen = new Map(); // joint -> colour
    this.angles = new Plot(angles, (...where) =>
      this.#draw(...where, "angle [°]", DEGREES, ["position", "target"]),
    );
    this.loads = new Plot(loads, (...where) =>
      this.#draw(...where, `load [${this.unit}]`, 1, ["load"]),
    );
  }

  library({ joints }) {
    this.chips = joints.map((name, joint) => {
      const chip = document.createElement("button");
      chip.type = "button";
      chip.className = "chip";
      chip.append(name.replaceAll("_", " "), document.createElement("span"));
      chip.addEventListener("click", () => this.#toggle(joint));
      return chip;
    });
    this.list.replaceChildren(...this.chips);
    this.chosen.clear();
    const knees = joints.map((name, i) => [name, i]).filter(([name]) => name.includes("knee"));
    for (const [, joint] of knees.length ? knees.slice(0, 2) : [[, 0]]) this.#choose(joint);
    this.#show();
  }

  hear(frame) {
    const [before, last] = [-2, -1].map((i) => this.#frames.at(i)?.time);
    if (frame.time < last) this.#frames = [];
    else if (last - before < LEAST) this.#frames.pop(); // of a log that is slow or paused
    this.#frames.push(frame);
    this.#frames = this.#frames.filter(({ time }) => frame.time - time <= SPAN);
    this.angles.ask();
    this.loads.ask();
    if (performance.now() < this.#next) return;
    this.#next = performance.now() + CALM;
    this.#read(frame);
  }

  #toggle(joint) {
    if (!this.chosen.delete(joint)) this.#choose(joint);
    this.#show();
  }

  #choose(joint) {
    if (this.chosen.size >= COLOURS) this.chosen.delete(this.chosen.keys().next().value);
    const used = [...this.chosen.values()];
    const all = Array.from({ length: COLOURS }, (_, i) => i + 1);
    this.chosen.set(joint, all.find((colour) => !used.includes(colour)));
  }

  #show() {
    this.chips.forEach((chip, joint) => {
      const colour = this.chosen.get(joint);
      chip.setAttribute("aria-pressed", String(colour !== undefined));
      chip.style.setProperty("--tone", colour === undefined ? "" : `var(--trace-${colour})`);
    });
    const last = this.#frames.at(-1);
    if (last) this.#read(last);
    this.angles.ask();
    this.loads.ask();
  }

  #read(frame) {
    this.unit = frame.unit;
    this.chips.forEach((chip, joint) => {
      const load = frame.load[joint];
      const angle = `${fixed(frame.position[joint] * DEGREES, 1)}°`;
      const torque = Number.isFinite(load) ? ` ${fixed(load, 1)} ${this.unit}` : "";
      say(chip.lastChild, ` ${angle}${torque}`);
    });
  }

  #draw(context, width, height, colour, unit, scale, columns) {
    const box = { left: 46, right: width - 8, top: 16, bottom: height - 20 };
    const now = this.#frames.at(-1)?.time ?? 0;
    const [low, high] = this.#range(columns, scale);
    const x = (time) => box.right - ((now - time) / SPAN) * (box.right - box.left);
    const y = (value) => box.bottom - ((value - low) / (high - low)) * (box.bottom - box.top);
    axes(context, box, x, y, now, [low, high], unit, colour);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4);
    context.clip();
    context.lineJoin = "round";
    for (const [joint, index] of this.chosen) {
      context.strokeStyle = colour(`trace-${index}`);
      for (const column of columns) {
        context.setLineDash(column === "target" ? [4, 4] : []);
        context.lineWidth = column === "target" ? 1.25 : 1.75;
        this.#line(context, (frame) => [x(frame.time), y(frame[column][joint] * scale)]);
      }
    }
    context.restore();
  }

  #line(context, at) {
    context.beginPath();
    let broken = true; // a gap where nothing was measured
    for (const frame of this.#frames) {
      const [x, y] = at(frame);
      const isKnown = Number.isFinite(y);
      if (isKnown) context[broken ? "moveTo" : "lineTo"](x, y);
      broken = !isKnown;
    }
    context.stroke();
  }

  #range(columns, scale) {
    let [low, high] = [Infinity, -Infinity];
    for (const frame of this.#frames) {
      for (const joint of this.chosen.keys()) {
        for (const column of columns) {
          const value = frame[column][joint] * scale;
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
    }
    if (!(low <= high)) return [-1, 1];
    const room = Math.max(0.08 * (high - low), 0.5);
    return [low - room, high + room];
  }
}

function axes(context, box, x, y, now, [low, high], unit, colour) {
  context.lineWidth = 1;
  context.strokeStyle = colour("grid");
  context.fillStyle = colour("muted");
  context.textAlign = "right";
  for (const value of ticks(low, high, Math.max(2, (box.bottom - box.top) / 28))) {
    context.beginPath();
    context.moveTo(box.left, y(value));
    context.lineTo(box.right, y(value));
    context.stroke();
    context.fillText(tickText(value), box.left - 6, y(value) + 4);
  }
  context.textAlign = "center";
  for (const ago of [10, 8, 6, 4, 2, 0]) {
    const at = Math.min(Math.max(x(now - ago), box.left + 8), box.right - 8);
    context.fillText(ago ? `−${ago}` : "0 s", at, box.bottom + 15);
  }
  context.textAlign = "left";
  context.fillText(unit, box.left, 10);
}
