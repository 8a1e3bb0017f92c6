// Canvases: sharp on any screen, drawn only when seen, in the colours of the page.

/** A canvas that is drawn again when something is new and it can be seen. */
export class Plot {
  #due = false;
  #seen = false;

  /** draw: takes (context, width, height, colours), in CSS pixels. */
  constructor(canvas, draw) {
    Object.assign(this, { canvas, draw });
    new IntersectionObserver((entries) => {
      this.#seen = entries.at(-1).isIntersecting; // the newest, where several have come
      this.ask();
    }).observe(canvas);
    new ResizeObserver(() => this.ask()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.ask());
  }

  /** Draw with the next picture of the screen. */
  ask() {
    if (this.#due || !this.#seen || document.hidden) return;
    this.#due = true;
    requestAnimationFrame(() => {
      this.#due = false;
      this.#paint();
    });
  }

  #paint() {
    const { canvas } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    const scale = devicePixelRatio || 1;
    const [columns, rows] = [Math.round(width * scale), Math.round(height * scale)];
    if (canvas.width !== columns || canvas.height !== rows) {
      Object.assign(canvas, { width: columns, height: rows });
    }
    const context = canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(canvas);
    context.font = `11px ${style.fontFamily}`;
    this.draw(context, width, height, (name) => style.getPropertyValue(`--${name}`).trim());
  }
}

/** Choose round numbers between two ends: at most so many. */
export function ticks(low, high, most) {
  const raw = (high - low) / Math.max(most, 1);
  if (!(raw > 0)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= raw * 0.999);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, i) => (first + i) * step);
}

/** Write a tick's number without needless digits. */
export function tickText(value) {
  return String(Number(value.toPrecision(6))).replace("-", "−");
}
