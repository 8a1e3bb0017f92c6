// The ZMP within the soles, from above; the robot walks up the picture.

import { known } from "./raw.js";
import { Plot, tickText, ticks } from "./plot.js";
import { fixed, say } from "./words.js";

const TAIL = 1; // s of measured ZMP that stays drawn
const CM = 100;

/** Plot the support and the ZMP in the frame between the feet. */
export class Balance {
  #tail = []; // [time, [x, y]], world
  #scene = null;
  #reach = 0.2; // m from the middle to the edge; grows with the robot

  constructor(canvas, margin) {
    this.margin = margin;
    this.plot = new Plot(canvas, (...where) => this.#draw(...where));
  }

  hear(frame) {
    const { scene, time } = frame;
    const last = this.#tail.at(-1);
    if (last && time < last[0]) this.#tail = [];
    // A log that is paused tells the same moment over and over.
    this.#tail = this.#tail.filter(([then]) => then < time && time - then <= TAIL);
    if (known(scene.zmp)) this.#tail.push([time, scene.zmp]);
    this.#scene = scene;
    this.#fit();
    this.plot.ask();
    say(this.margin, marginText(marginOf(scene.zmp, scene.region)));
  }

  #fit() {
    const place = middle(this.#scene.feet);
    const corners = this.#scene.soles.flat().map((corner) => place(corner));
    const far = Math.max(0.05, ...corners.flat().map(Math.abs)) * 1.25;
    // Steps of 5 cm, and back only when much smaller: a scale that breathes is hard to read.
    const fits = far <= this.#reach && far >= 0.6 * this.#reach;
    if (!fits) this.#reach = Math.ceil(far / 0.05) * 0.05;
  }

  #draw(context, width, height, colour) {
    const side = Math.min(width, height) / 2 - 22;
    const scale = side / this.#reach;
    const [x, y] = [width / 2 + 10, height / 2 - 8]; // room for the axes' numbers
    const to = ([ahead, left]) => [x - left * scale, y - ahead * scale];
    this.#axes(context, to, width, height, colour);
    if (!this.#scene) return;
    const place = middle(this.#scene.feet);
    const path = (points) => {
      context.beginPath();
      points.map((point) => to(place(point))).forEach(([x, y]) => context.lineTo(x, y));
    };
    for (const sole of this.#scene.soles) {
      path(sole);
      context.closePath();
      paint(context, colour("sole-fill"), colour("sole-line"), 1.5);
    }
    if (this.#scene.region.length > 2) {
      path(this.#scene.region);
      context.closePath();
      paint(context, colour("region-fill"), colour("region-line"), 2);
    }
    this.#zmp(context, (point) => to(place(point)), colour);
  }

  #axes(context, to, width, height, colour) {
    context.strokeStyle = colour("grid");
    context.fillStyle = colour("muted");
    context.lineWidth = 1;
    const reach = this.#reach * CM;
    const [first, second] = ticks(-reach, reach, 8);
    const far = 3 * reach; // a long picture shows more than the reach
    context.beginPath();
    for (const value of ticks(-far, far, (2 * far) / (second - first))) {
      const [x] = to([0, value / CM]);
      const [, y] = to([value / CM, 0]);
      if (x > 40 && x < width - 8) {
        context.moveTo(x, 4);
        context.lineTo(x, height - 30);
        context.textAlign = "center";
        context.fillText(tickText(value), x, height - 18);
      }
      if (y > 8 && y < height - 32) {
        context.moveTo(40, y);
        context.lineTo(width, y);
        context.textAlign = "right";
        context.fillText(tickText(value), 34, y + 4);
      }
    }
    context.stroke();
    context.textAlign = "center";
    context.fillText("to the left [cm]", width / 2, height - 4);
    context.save();
    context.translate(10, height / 2);
    context.rotate(-Math.PI / 2);
    context.fillText("ahead [cm]", 0, 0);
    context.restore();
  }

  #zmp(context, to, colour) {
    context.lineWidth = 2;
    context.strokeStyle = colour("measured");
    const now = this.#tail.at(-1)?.[0];
    for (let i = 1; i < this.#tail.length; i += 1) {
      context.globalAlpha = Math.max(0.05, 1 - (now - this.#tail[i][0]) / TAIL) * 0.6;
      context.beginPath();
      context.moveTo(...to(this.#tail[i - 1][1]));
      context.lineTo(...to(this.#tail[i][1]));
      context.stroke();
    }
    context.globalAlpha = 1;
    dot(context, to, this.#scene.planned, 6, "", colour("planned"));
    dot(context, to, this.#scene.zmp, 6, colour("measured"), colour("card"));
  }
}

function dot(context, to, point, radius, fill, line) {
  if (!known(point)) return;
  context.beginPath();
  context.arc(...to(point), radius, 0, 2 * Math.PI);
  paint(context, fill, line, 2.5);
}

function paint(context, fill, line, width) {
  context.fillStyle = fill;
  context.strokeStyle = line;
  context.lineWidth = width;
  if (fill) context.fill();
  if (line) context.stroke();
}

function marginText(margin) {
  if (!Number.isFinite(margin)) return "ZMP not known";
  const where = margin >= 0 ? "inside" : "outside";
  return `ZMP ${fixed(Math.abs(margin) * 1000, 0)} mm ${where} the region`;
}

/** Return the map from the world into the frame between the feet: ahead, left. */
function middle(feet) {
  if (feet.length < 2) return (point) => point;
  const [left, right] = feet;
  const [x, y] = [0, 1].map((i) => (left[i] + right[i]) / 2);
  const yaw = Math.atan2(
    Math.sin(left[2]) + Math.sin(right[2]),
    Math.cos(left[2]) + Math.cos(right[2]),
  );
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return ([px, py]) => [
    cos * (px - x) + sin * (py - y),
    -sin * (px - x) + cos * (py - y),
  ];
}

/** Distance from a point to the edge of a convex region, negative outside it [m]. */
export function marginOf(point, region) {
  if (!known(point) || region.length < 3) return NaN;
  const edges = region.map((corner, i) => [corner, region[(i + 1) % region.length]]);
  const sides = edges.map(
    ([a, b]) => (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]),
  );
  const inside = sides.every((side) => side >= 0) || sides.every((side) => side <= 0);
  const nearest = Math.min(...edges.map(([a, b]) => distance(point, a, b)));
  return inside ? nearest : -nearest;
}

function distance([x, y], [ax, ay], [bx, by]) {
  const [dx, dy] = [bx - ax, by - ay];
  const length = dx * dx + dy * dy;
  const part = length ? Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / length)) : 0;
  return Math.hypot(x - ax - part * dx, y - ay - part * dy);
}
