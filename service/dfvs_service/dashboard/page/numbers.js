// The newest numbers, each with the age of its source.

import { ageLabel, byId, DASH, DEGREES, element, fixed, row, say, scaled } from "./words.js";

/** Length in m, to the mm below 10 m, and its standard deviation where that is known. */
export function lengthWithSpread(value, spread) {
  const digits = value < 10 ? 3 : 2;
  const isKnown = Number.isFinite(value) && Number.isFinite(spread);
  return [fixed(value, digits), isKnown ? `± ${fixed(spread, digits)} m` : "m"];
}

/** Length of the translation in a velocity (forward, right, down, ...), NaN where it is unknown. */
function speed(velocity) {
  const linear = (velocity ?? []).slice(0, 3);
  return linear.length === 3 && linear.every(Number.isFinite) ? Math.hypot(...linear) : NaN;
}

/** Verdict of the mounting's test statistic; `limit` in standard deviations. */
function mounting(score, limit) {
  if (!Number.isFinite(score)) return [DASH, ""];
  if (Math.abs(score) < limit) return ["undecided", ""];
  return [score > 0 ? "ok" : "wrong", `${fixed(Math.abs(score), 1)} σ`, score < 0];
}

/** Name, source, and value, unit or what else stands small beside it, and whether it is an alarm. */
const NUMBERS = [
  ["Distance to goal", "results", (n) => lengthWithSpread(n.servo?.error_m, n.servo?.error_spread_m)],
  ["Mean distance, 1 s", "results", (n) => lengthWithSpread(n.servo?.mean_error_m, n.servo?.mean_error_spread_m)],
  ["Angle to goal", "results", (n) => [fixed(scaled(n.servo?.error_rad, DEGREES), 2), "°"]],
  ["Speed commanded", "vehicle", (n) => [fixed(speed(n.path?.setpoint), 2), "m/s"]],
  ["Speed flown", "vehicle", (n) => [fixed(speed(n.path?.flown), 2), "m/s"]],
  ["Velocity error", "results", (n) => [fixed(speed(n.servo?.velocity_error), 3), "m/s"]],
  ["Depth", "results", (n) => [fixed(n.servo?.depth_m, 2), "m"]],
  ["Scale spread", "results", (n) => [fixed(scaled(n.servo?.scale_spread, 100), 1), "%"]],
  ["Mounting", "results", (n) => mounting(n.servo?.mounting_score, n.mountingLimit)],
  ["Inliers", "results", (n) => [fixed(scaled(n.servo?.inlier_share, 100), 0), "%"]],
  ["Overlap", "results", (n) => [fixed(scaled(n.servo?.overlap, 100), 0), "%"]],
  ["Residual", "results", (n) => [fixed(n.servo?.residual_px, 2), "px"]],
  ["Conditioning", "results", (n) => [fixed(n.servo?.condition, 0), ""]],
];

/** @param newest `{servo, path, mountingLimit}`: newest rows, and what the score is judged by */
export function showNumbers(newest) {
  const list = byId("numbers");
  if (!list.children.length) {
    for (const [name, source] of NUMBERS) {
      const value = row("dd", [element("span", ""), " ", element("small", "")]);
      value.dataset.source = source;
      list.append(row("div", [row("dt", [element("span", name), " ", ageLabel(source)]), value]));
    }
  }
  NUMBERS.forEach(([, , of], i) => {
    const place = list.children[i].lastChild;
    const [value, rest, isBad] = of(newest);
    say(place.firstChild, value);
    say(place.lastChild, rest);
    place.classList.toggle("bad", Boolean(isBad));
  });
}
