// Text for people, and elements that hold it; nothing here is ever parsed as HTML.

export const DASH = "–";
export const DEGREES = 180 / Math.PI;

/** Value of a CSS variable of the theme. */
export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export const byId = (id) => document.getElementById(id);

export const scaled = (value, factor) => (Number.isFinite(value) ? value * factor : null);

export const fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : DASH);

export function duration(seconds) {
  if (!Number.isFinite(seconds)) return DASH;
  if (seconds < 60) return `${Math.max(seconds, 0).toFixed(1)} s`;
  const whole = Math.floor(seconds);
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (v) => String(v).padStart(2, "0");
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)} min`;
}

export const timeOfDay = (ms) => new Date(ms).toLocaleTimeString([], { hour12: false });

/** Set a text only where it changed: screen readers announce every change. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function row(tag, cells, className = "") {
  const line = document.createElement(tag);
  line.className = className;
  line.append(...cells);
  return line;
}

export function element(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

/** Label of a source's age, filled in by `showAges` while that is old. */
export function ageLabel(source) {
  const label = row("small", [], "age");
  label.dataset.ageOf = source;
  label.dataset.quiet = "";
  return label;
}
