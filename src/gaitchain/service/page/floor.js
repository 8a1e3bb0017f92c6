// The floor from above: where the robot is, where it goes, and a click that sends it.

import { Plot, tickText, ticks } from "./plot.js";
import { whyNot } from "./wheel.js";
import { fixed, say } from "./words.js";

const REACHES = [0.5, 1, 2, 5, 10, 20]; // m from the robot to the nearer edge
const DRAGGED = 12; // px; less is a click
const CALM = 500; // ms between two readings of the way that is left
const STRIDE = 0.02; // m between two points of the trail
const TRAIL = 2000;
const JUMP = 0.3; // m between two frames; more is another beginning
const DEGREES = 180 / Math.PI;

const polar = ([x, y], angle, r) => [x + r * Math.cos(angle), y + r * Math.sin(angle)];

/** A map that the robot is sent by; ahead of where it stood at first is up. */
export class Floor {
  #reach = 2; // index into REACHES
  #frame = null;
  #trail = [];
  #pulled = null; // pointer, place of it, and the heading that it is dragged to
  #next = 0;

  constructor(wheel, notice, page) {
    Object.assign(this, { wheel, notice, page });
    this.plot = new Plot(page.canvas, (...where) => this.#draw(...where));
    page.form.addEventListener("submit", (event) => this.#submit(event));
    page.nearer.addEventListener("click", () => this.#zoom(-1));
    page.further.addEventListener("click", () => this.#zoom(1));
    page.canvas.addEventListener("pointerdown", (event) => this.#pull(event));
    page.canvas.addEventListener("pointermove", (event) => this.#drag(event));
    page.canvas.addEventListener("pointerup", (event) => this.#drop(event));
    page.canvas.addEventListener("pointercancel", () => (this.#pulled = null));
  }

  hear(frame) {
    const arrives = frame.going?.arrived && this.#frame?.going?.arrived === false;
    if (arrives) this.notice("The robot has arrived.");
    this.#frame = frame;
    this.#follow(frame);
    this.plot.ask();
    if (performance.now() < this.#next) return;
    this.#next = performance.now() + CALM;
    say(this.page.going, goingText(frame));
  }

  #follow({ place, mode }) {
    const last = this.#trail.at(-1) ?? place;
    const passed = place && Math.hypot(place[0] - last[0], place[1] - last[1]);
    if (!place || mode === "rising" || passed > JUMP) this.#trail = [];
    if (place && (passed > STRIDE || !this.#trail.length)) {
      this.#trail = [...this.#trail.slice(1 - TRAIL), place];
    }
  }

  #zoom(by) {
    this.#reach = Math.min(Math.max(this.#reach + by, 0), REACHES.length - 1);
    this.plot.ask();
  }

  #submit(event) {
    event.preventDefault();
    const { form, x, y, yaw } = this.page;
    if (!form.reportValidity()) return;
    this.#go(Number(x.value), Number(y.value), Number(yaw.value) / DEGREES);
  }

  #go(x, y, yaw) {
    const why = this.#why();
    this.notice(why);
    if (!why) this.wheel.go({ x, y, yaw });
  }

  #why() {
    const { wheel } = this;
    const why = whyNot(this.#frame, wheel);
    if (why) return why;
    if (!this.#frame.place) return "Nothing measures where this robot is.";
    if (!wheel.wanted) return "Take the wheel first.";
    if (["standing", "walking"].includes(this.#frame.mode)) return "";
    return "It goes to a place from standing or walking.";
  }

  /** Return the map from the floor to the canvas, and the way back. */
  #scale(width = this.page.canvas.clientWidth, height = this.page.canvas.clientHeight) {
    const [x, y] = this.#frame?.place ?? [0, 0];
    const size = Math.min(width, height) / 2 / REACHES[this.#reach];
    const to = ([px, py]) => [width / 2 - (py - y) * size, height / 2 - (px - x) * size];
    const from = ([right, down]) => [x + (height / 2 - down) / size, y + (width / 2 - right) / size];
    return { to, from, size };
  }

  #pull(event) {
    if (event.button !== 0 || !this.#frame?.place) return;
    this.page.canvas.setPointerCapture(event.pointerId);
    const begun = [event.offsetX, event.offsetY];
    const place = this.#scale().from(begun);
    const [x, y, yaw] = this.#frame.place;
    const far = Math.hypot(place[0] - x, place[1] - y) > 0.5;
    // It faces the way it went, and near by the way it faces.
    const facing = far ? Math.atan2(place[1] - y, place[0] - x) : yaw;
    this.#pulled = { pointer: event.pointerId, begun, place, yaw: facing };
    this.plot.ask();
  }

  #drag(event) {
    const pulled = this.#pulled;
    if (event.pointerId !== pulled?.pointer) return;
    const [right, down] = [event.offsetX - pulled.begun[0], event.offsetY - pulled.begun[1]];
    if (Math.hypot(right, down) > DRAGGED) pulled.yaw = Math.atan2(-right, -down);
    this.plot.ask();
  }

  #drop(event) {
    const pulled = this.#pulled;
    if (event.pointerId !== pulled?.pointer) return;
    this.#pulled = null;
    const [x, y] = pulled.place;
    this.page.x.value = x.toFixed(3);
    this.page.y.value = y.toFixed(3);
    this.page.yaw.value = (pulled.yaw * DEGREES).toFixed(1);
    this.#go(x, y, pulled.yaw);
  }

  #draw(context, width, height, colour) {
    const scale = this.#scale(width, height);
    grid(context, width, height, scale, colour);
    const { place, feet, going } = this.#frame ?? {};
    if (!place) return;
    context.lineWidth = 1.5;
    line(context, this.#trail.map(scale.to), colour("line-strong"));
    const goal = this.#pulled ? [...this.#pulled.place, this.#pulled.yaw] : going?.goal;
    if (goal) {
      context.setLineDash([5, 4]);
      line(context, [scale.to(place), scale.to(goal)], colour("warn"));
      context.setLineDash([]);
      arrow(context, scale.to(goal), goal[2], 20, colour("warn"));
    }
    context.lineWidth = 3;
    for (const foot of feet) {
      line(context, [-0.06, 0.12].map((r) => scale.to(polar(foot, foot[2], r))), colour("sole-line"));
    }
    arrow(context, scale.to(place), place[2], 16, colour("accent"));
  }
}

/** Say how far it is. */
function goingText({ place, going }) {
  if (!place) return "nothing measures where this robot is";
  const [x, y, yaw] = place;
  const here = `at ${fixed(x)}, ${fixed(y)} m, ${fixed(yaw * DEGREES, 0)}°`;
  if (!going) return here;
  if (going.arrived) return `arrived, ${here}`;
  if (!going.goal) return `${fixed(going.steps, 0)} footsteps left, ${here}`;
  return `${fixed(going.distance)} m and ${fixed(going.turn * DEGREES, 0)}° left, ${here}`;
}

function line(context, points, stroke) {
  context.strokeStyle = stroke;
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.stroke();
}

/** Draw an arrow that a heading points along; 0 is up. */
function arrow(context, [x, y], yaw, size, fill) {
  const tip = (angle, r) => [x - r * Math.sin(yaw + angle), y - r * Math.cos(yaw + angle)];
  context.fillStyle = fill;
  context.beginPath();
  for (const [angle, r] of [[0, 1], [2.5, 0.7], [Math.PI, 0.3], [-2.5, 0.7]]) {
    context.lineTo(...tip(angle, r * size));
  }
  context.fill();
}

function grid(context, width, height, { to, from, size }, colour) {
  const [top, left] = from([0, 0]);
  const [bottom, right] = from([width, height]);
  context.lineWidth = 1;
  context.fillStyle = colour("muted");
  for (const x of ticks(bottom, top, height / 48)) {
    const [, down] = to([x, 0]);
    line(context, [[0, down], [width, down]], colour("grid"));
    context.fillText(tickText(x), 3, down - 3);
  }
  for (const y of ticks(right, left, width / (size && 64))) {
    const [across] = to([0, y]);
    line(context, [[across, 0], [across, height]], colour("grid"));
    context.fillText(tickText(y), across + 3, height - 4);
  }
  context.fillText("ahead ↑, left ← [m]", width / 2 - 44, 11);
}
