// Values of a kind, of whatever came: NaN and "" for what is none.

export const number = (value) =>
  typeof value === "number" && Number.isFinite(value) ? value : NaN;
export const list = (value) => (Array.isArray(value) ? value : []);
export const text = (value) => (typeof value === "string" ? value : "");
export const record = (value) =>
  value !== null && typeof value === "object" && !Array.isArray(value) ? value : {};
export const numbers = (value) => list(value).map(number);
export const point = (value) => [number(list(value)[0]), number(list(value)[1])];
export const points = (value) => list(value).map(point).filter(known);

/** Whether all numbers of a list are known. */
export function known(values) {
  return values.every(Number.isFinite);
}
