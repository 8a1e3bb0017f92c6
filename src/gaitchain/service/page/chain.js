// The Markov chain as a picture: layers of key poses, and the way through them.

import { fixed, primitivesText } from "./words.js";

const SIDE = 44; // to the first and the last column [px]
const TOP = 34;
const FOOT = 44;
const MARKS = ["now", "passed", "candidate", "goal"];
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const LABELLED = 4; // costs written beside the cheapest candidates
const LINE = 13; // px between two

const at = (x, y) => `${x.toFixed(1)} ${y.toFixed(1)}`;

function make(name, attributes, parent) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  parent?.append(node);
  return node;
}

/** Draw the chain, and mark where the robot goes and what else it could have done. */
export class Chain {
  #nodes = []; // per layer, per pose
  #layers = [];
  #here = [0, 0]; // the node that Tab reaches

  /** told: takes the text of the pose that is pointed at. */
  constructor(root, told) {
    Object.assign(this, { root, told });
    new ResizeObserver(() => {
      if (this.#layers.length && Math.abs(root.clientWidth - this.width) > 4) this.#draw();
    }).observe(root);
  }

  library({ layers, edges }) {
    if (!layers.length) return;
    Object.assign(this, { edges });
    this.#layers = layers;
    this.#draw();
  }

  #draw() {
    const layers = this.#layers;
    const most = Math.max(...layers.map((layer) => layer.poses.length));
    // One unit is one pixel, so that texts keep their size on any screen.
    this.width = Math.max(this.root.clientWidth, 280);
    this.height = TOP + FOOT + Math.max(150, Math.min(440, most * 8));
    const svg = make("svg", {
      viewBox: `0 0 ${this.width} ${this.height}`,
      role: "group",
      "aria-label": "Layers of key poses; arrow keys go from pose to pose",
    });
    this.#drawEdges(svg);
    this.#drawReturn(svg);
    this.marks = make("g", { class: "marks", "aria-hidden": "true" }, svg);
    this.#nodes = layers.map((layer, i) => this.#drawLayer(svg, layer, i));
    this.costs = make("g", { class: "costs", "aria-hidden": "true" }, svg);
    svg.addEventListener("keydown", (event) => this.#walk(event));
    this.root.replaceChildren(svg);
    this.#reach(...this.#here);
    if (this.last) this.mark(...this.last);
  }

  /** Mark a choice, on the way of this step's poses so far (null where not known). */
  mark(choice, way, stands) {
    this.last = [choice, [...way], stands];
    this.marks.replaceChildren();
    this.costs.replaceChildren();
    for (const node of this.#nodes.flat()) node.classList.remove(...MARKS);
    if (stands) this.#node(0, way[0])?.classList.add("now");
    if (!choice) return;
    const { layer, pose, others } = choice.decided;
    const from = layer > 0 ? way[layer - 1] : null;
    for (let i = 1; i < choice.layer; i += 1) this.#edge(i, way[i - 1], way[i], "walked");
    for (let i = 0; i < choice.layer; i += 1) this.#node(i, way[i])?.classList.add("passed");
    for (const other of others) {
      this.#edge(layer, from, other.pose, "candidate");
      this.#node(layer, other.pose)?.classList.add("candidate");
    }
    if (layer > choice.layer) this.#edge(choice.layer, way[choice.layer - 1], choice.pose, "walked");
    this.#edge(layer, from, pose, "chosen");
    this.#writeCosts(layer, [choice.decided, ...others].slice(0, LABELLED));
    this.#node(this.#layers.length - 1, choice.target)?.classList.add("goal");
    this.#node(choice.layer, choice.pose)?.classList.add("now");
  }

  /** Describe a pose. */
  describe(layer, pose) {
    const primitives = this.#layers[layer]?.poses[pose];
    return primitives ? primitivesText(primitives) : "";
  }

  #node(layer, pose) {
    return this.#nodes[layer]?.[pose];
  }

  #place(layer, pose) {
    const columns = this.#layers.length;
    const rows = this.#layers[layer].poses.length;
    const room = this.height - TOP - FOOT;
    const pitch = Math.min(room / Math.max(rows, 1), 34);
    return [
      SIDE + (layer * (this.width - 2 * SIDE)) / Math.max(columns - 1, 1),
      TOP + room / 2 + (pose - (rows - 1) / 2) * pitch,
    ];
  }

  #curve(layer, from, to) {
    if (!this.#layers[layer - 1]?.poses[from] || !this.#layers[layer]?.poses[to]) return "";
    const [x0, y0] = this.#place(layer - 1, from);
    const [x1, y1] = this.#place(layer, to);
    const bend = (x1 - x0) * 0.4;
    const way = [[x0 + bend, y0], [x1 - bend, y1], [x1, y1]];
    return `M${at(x0, y0)}C${way.map(([x, y]) => at(x, y)).join(" ")}`;
  }

  #drawEdges(svg) {
    for (let layer = 1; layer < this.#layers.length; layer += 1) {
      const own = this.edges.filter((edge) => edge.layer === layer - 1);
      const d = own.map((edge) => this.#curve(layer, edge.from, edge.to)).join("");
      make("path", { d, class: "edges", "aria-hidden": "true" }, svg);
    }
  }

  #drawReturn(svg) {
    const y = this.height - FOOT + 10;
    const [left, right] = [SIDE, this.width - SIDE];
    const d = `M${right} ${y}C${right} ${y + 24} ${left} ${y + 24} ${left} ${y}m-5 8l5 -8l6 7`;
    make("path", { d, class: "return", "aria-hidden": "true" }, svg);
    const words = make("text", { x: this.width / 2, y: this.height - 4 }, svg);
    words.textContent = "the legs change roles for the next step";
  }

  #drawLayer(svg, layer, i) {
    const [x] = this.#place(i, 0);
    const head = make("text", { x, y: 16, class: "head" }, svg);
    head.textContent = layer.moment;
    const radius = layer.poses.length > 16 ? 3.5 : 6;
    return layer.poses.map((primitives, pose) => {
      const [, y] = this.#place(i, pose);
      const words = `${layer.moment} pose ${pose}: ${primitivesText(primitives)}`;
      const node = make("g", {
        class: "node",
        role: "button",
        tabindex: "-1",
        transform: `translate(${at(x, y)})`,
        "aria-label": words,
      }, svg);
      make("circle", { r: 10, class: "touch" }, node);
      make("circle", { r: radius, class: "dot" }, node);
      // By turns nearer and further out: many nodes are less than a line apart.
      const aside = (11 + (pose % 2 && layer.poses.length > 16 ? 15 : 0)) * (i ? 1 : -1);
      const inner = i > 0 && i < this.#layers.length - 1; // edges leave to both sides
      const where = inner ? { x: 5, y: -8 } : { x: aside, y: 3.5 };
      make("text", { ...where, class: `number ${i ? "start" : "end"}` }, node).textContent = pose;
      const tell = () => this.told(`${words}.`);
      node.addEventListener("pointerenter", tell);
      node.addEventListener("focus", () => {
        this.#reach(i, pose);
        tell();
      });
      return node;
    });
  }

  #edge(layer, from, to, kind) {
    const d = this.#curve(layer, from, to);
    if (d) make("path", { d, class: kind }, this.marks);
  }

  /** Write costs on the edges that arrive at their poses, one below the other. */
  #writeCosts(layer, costs) {
    const shown = costs.filter((one) => this.#node(layer, one.pose) && Number.isFinite(one.cost));
    let least = -LINE;
    for (const one of shown.sort((a, b) => a.pose - b.pose)) {
      const [x, y] = this.#place(layer, one.pose);
      least = Math.max(y - 5, least + LINE);
      const kind = one === costs[0] ? "best" : "";
      const words = make("text", { x: x - 12, y: least, class: `cost ${kind}` }, this.costs);
      words.textContent = fixed(one.cost, 4);
    }
  }

  #reach(layer, pose) {
    this.#node(...this.#here)?.setAttribute("tabindex", "-1");
    this.#here = [layer, pose];
    this.#node(layer, pose)?.setAttribute("tabindex", "0");
  }

  #walk(event) {
    const [layer, pose] = this.#here;
    if (!(event.key in WAYS)) return;
    const [across, down] = WAYS[event.key];
    event.preventDefault();
    const column = this.#nodes[layer + across];
    if (!column) return;
    column[Math.min(Math.max(pose + down, 0), column.length - 1)]?.focus();
  }
}
