// What happened, newest first.

import { readEvents } from "./frame.js";
import { clockText } from "./words.js";

const MOST = 200;

/** A list of events, each of them once. */
export class Log {
  #seen = new Set();
  #order = new WeakMap(); // item -> [UNIX time, number]
  #newest = 0; // number
  #jumps; // of a replay

  /** after: gets the events with higher numbers from the server. */
  constructor(root, after) {
    Object.assign(this, { root, after });
  }

  /** Take the events of a frame, which has room for the latest alone. */
  hear({ events, replay }) {
    if (replay?.jumps !== this.#jumps) {
      this.#jumps = replay?.jumps; // elsewhere in the log other things have happened
      this.#newest = 0;
      this.#seen.clear();
      this.root.replaceChildren();
    }
    if (events[0]?.number > this.#newest + 1) void this.fill(this.#newest);
    this.#add(events);
  }

  /** Get what no frame had room for. */
  async fill(number = 0) {
    const jumps = this.#jumps;
    const events = readEvents(await this.after(number));
    if (jumps === this.#jumps) this.#add(events);
  }

  /** Put events on top that are not there yet. */
  #add(events) {
    this.#newest = events.at(-1)?.number ?? this.#newest;
    for (const event of events) {
      // Not by its number: a server that is started again counts anew.
      const key = `${event.stamp} ${event.kind} ${event.text}`;
      if (this.#seen.has(key)) continue;
      this.#seen.add(key);
      this.#put(this.#item(event), [event.stamp, event.number]);
    }
    while (this.root.children.length > MOST) this.root.lastElementChild.remove();
    if (this.#seen.size > 20 * MOST) this.#seen = new Set([...this.#seen].slice(-MOST));
  }

  /** Put an item where its time belongs: what was missed may come late. */
  #put(item, order) {
    this.#order.set(item, order);
    const older = [...this.root.children].find((other) => {
      const [stamp, number] = this.#order.get(other);
      return stamp < order[0] || (stamp === order[0] && number < order[1]);
    });
    this.root.insertBefore(item, older ?? null);
  }

  #item(event) {
    const item = document.createElement("li");
    item.dataset.kind = event.kind;
    const when = document.createElement("time");
    when.textContent = clockText(event.time);
    const wall = new Date(event.stamp / 1e6);
    if (Number.isFinite(wall.getTime())) when.title = wall.toLocaleString();
    const kind = document.createElement("span");
    kind.className = "kind";
    kind.textContent = event.kind;
    const text = document.createElement("span");
    text.textContent = event.text;
    item.append(when, kind, text);
    return item;
  }
}
