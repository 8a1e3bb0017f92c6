// The connection to the server: one socket that comes back by itself, and REST.

import { readFrame } from "./frame.js";

const API = "/api/v1";
const FIRST_WAIT = 500; // ms; doubles with each attempt
const LONGEST_WAIT = 8000; // ms
const SILENT = 1500; // ms without a frame
const DEAD = 6000; // ms without any message; a phone's radio may drop a socket unnoticed
const LOOK = 500; // ms between two looks at it

/** Events: `frame` (detail: a frame), `state` (detail: name, text), `fault` (detail: text). */
export class Link extends EventTarget {
  unheard = 0; // ms without a frame
  #socket = null;
  #attempts = 0;
  #quiet = 0; // ms without any message, or without an answer to a handshake
  #looked = 0;
  #timer = 0;

  constructor(hz) {
    super();
    this.driver = `browser-${Math.random().toString(36).slice(2, 8)}`;
    this.hz = hz;
    this.isOpen = false;
    setInterval(() => this.#watch(), LOOK);
    window.addEventListener("online", () => this.#retryNow());
  }

  /** Connect now. */
  open() {
    clearTimeout(this.#timer);
    this.#tell("connecting", this.#attempts ? "reconnecting…" : "connecting…");
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const query = new URLSearchParams({ hz: this.hz, driver: this.driver });
    const socket = new WebSocket(`${scheme}://${location.host}${API}/stream?${query}`);
    this.#socket?.close();
    this.#socket = socket;
    this.#quiet = 0;
    let opened = false;
    socket.onopen = () => {
      if (socket !== this.#socket) return; // a later one has taken its place
      opened = true;
      this.isOpen = true;
      this.unheard = this.#quiet = 0;
      this.#tell("open", "connected, waiting for the robot");
    };
    socket.onmessage = (event) => {
      if (socket === this.#socket) this.#hear(event.data);
    };
    socket.onclose = (event) => this.#lost(socket, event.code, opened);
  }

  /** Send a request; false if there is no connection. */
  send(type, fields = {}) {
    if (!this.isOpen || this.#socket.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify({ type, ...fields }));
    return true;
  }

  /** Ask for something by REST; null if there is no answer of use. */
  async get(path) {
    try {
      const answer = await fetch(API + path, { cache: "no-store" });
      this.#judge(answer.status);
      return answer.ok ? await answer.json() : null;
    } catch {
      return null;
    }
  }

  /** Send a request by REST, which needs no socket; whether the server took it. */
  async post(path) {
    try {
      const headers = { "X-Driver": this.driver };
      const answer = await fetch(API + path, { method: "POST", headers, keepalive: true });
      this.#judge(answer.status);
      return answer.ok;
    } catch {
      return false;
    }
  }

  #hear(data) {
    this.#quiet = 0;
    let raw = null;
    try {
      raw = JSON.parse(data);
    } catch {
      return;
    }
    if (raw?.type === "error") {
      this.dispatchEvent(new CustomEvent("fault", { detail: String(raw.detail ?? "refused") }));
      return;
    }
    const frame = readFrame(raw);
    if (!frame) return;
    this.unheard = 0;
    this.#attempts = 0;
    this.#tell("live", "connected");
    this.dispatchEvent(new CustomEvent("frame", { detail: frame }));
  }

  #lost(socket, code, opened) {
    if (socket !== this.#socket) return;
    this.isOpen = false;
    const longer = Math.min(FIRST_WAIT * 2 ** this.#attempts, LONGEST_WAIT);
    const wait = longer * (0.8 + 0.4 * Math.random()); // browsers do not all come at once
    this.#attempts += 1;
    this.#tell("waiting", `lost; reconnecting in ${Math.max(1, Math.round(wait / 1000))} s…`);
    this.#timer = setTimeout(() => this.open(), wait);
    // A refused handshake says nothing to a script; a request over HTTP does.
    if (code === 1008 || !opened) void this.get("/health");
  }

  #watch() {
    const now = performance.now();
    // While this page itself stood still, frames came and wait behind this look.
    const passed = Math.min(now - this.#looked, 2 * LOOK);
    this.#looked = now;
    this.unheard += passed;
    this.#quiet += passed;
    if (this.isOpen && this.unheard >= SILENT) {
      this.#tell("silent", `connected; robot silent for ${Math.round(this.unheard / 1000)} s`);
    }
    const socket = this.#socket;
    const connecting = socket?.readyState === WebSocket.CONNECTING;
    if (this.#quiet < DEAD || !(this.isOpen || connecting)) return;
    this.#lost(socket, 0, true); // its own close event comes late, or never
    this.#socket = null;
    socket.close();
  }

  #retryNow() {
    if (!this.isOpen && this.#attempts) this.open();
  }

  #judge(status) {
    if (status === 401 || status === 403) this.#tell("refused", "not signed in");
    else if (status < 400) this.#tell("accepted", "");
  }

  #tell(name, text) {
    this.dispatchEvent(new CustomEvent("state", { detail: { name, text } }));
  }
}
