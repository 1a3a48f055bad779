// Numbers and states in words. What is not known is a dash, never a zero.

export const UNKNOWN = 0;
export const CLEAR = 1;
export const OBSTACLE = 2;

export const DASH = "–";

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

/** A number with so many digits behind the point, or a dash. */
export function fixed(value, digits, unit = "") {
  if (!isNumber(value)) return DASH;
  const text = value.toFixed(digits).replace(/^-(0(?:\.0+)?)$/, "$1").replace("-", "−");
  return unit ? `${text} ${unit}` : text;
}

/** Metres as they are read at a glance: rounded down, so that what is shown is never farther than it is. */
export function metres(centimetres) {
  if (centimetres >= 10_000) return String(Math.floor(centimetres / 100));
  return (Math.floor(centimetres / 10) / 10).toFixed(1);
}

/** Seconds since something, short. */
export function age(ms) {
  if (!isNumber(ms)) return "";
  const seconds = Math.max(0, ms) / 1000;
  if (seconds < 1) return `${Math.floor(seconds * 10) / 10 || "0.0"} s`;
  if (seconds < 10) return `${(Math.floor(seconds * 10) / 10).toFixed(1)} s`;
  if (seconds < 100) return `${Math.floor(seconds)} s`;
  if (seconds < 5400) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}

/** Bytes a second. */
export function rate(bytes) {
  if (!isNumber(bytes)) return DASH;
  const kilo = bytes / 1000;
  return kilo >= 1000 ? `${(kilo / 1000).toFixed(1)} MB/s` : `${kilo.toFixed(kilo < 10 ? 1 : 0)} kB/s`;
}

/** A bearing from the nose. */
export function bearing(degrees) {
  const whole = Math.round(degrees);
  if (Math.abs(whole) < 3) return "straight ahead";
  if (Math.abs(whole) > 177) return "straight behind";
  return `${Math.abs(whole)}° ${whole < 0 ? "left" : "right"}`;
}

/** "live", "stale" or "none" of something that old. */
export function freshness(ageMs, limits) {
  if (!isNumber(ageMs) || ageMs > limits.noDataMs) return "none";
  return ageMs > limits.staleMs ? "stale" : "live";
}

export const FRESHNESS_WORDS = Object.freeze({ live: "live", stale: "stale", none: "no data" });

/** Put text into an element, only if it changed. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Set a data attribute, only if it changed. */
export function mark(element, name, value) {
  if (element.dataset[name] !== value) element.dataset[name] = value;
}
