// Attitude indicator, altitude and battery.

import { byId, DASH, DEGREES, fixed, say, scaled, style } from "./words.js";

const SHOWN_PITCH_RAD = 0.5;

/** @param path newest row of the path; @param state newest state of the gate */
export function showInstruments(path, state) {
  drawHorizon(byId("horizon"), path);
  const degrees = (value) => `${fixed(scaled(value, DEGREES), 1)}°`;
  say(byId("roll"), path ? degrees(path.roll_rad) : DASH);
  say(byId("pitch"), path ? degrees(path.pitch_rad) : DASH);
  const heading = path ? (Math.round(path.yaw_rad * DEGREES) + 360) % 360 : NaN;
  say(byId("heading"), `${fixed(heading, 0)}°`);
  say(byId("altitude"), `${fixed(path ? -path.down_m : NaN, 2)} m`);
  const battery = state?.battery ?? NaN;
  say(byId("battery"), `${fixed(battery * 100, 0)} %`);
  byId("battery-level").value = Number.isFinite(battery) ? battery : 0;
  byId("horizon").setAttribute("aria-label", path
    ? `Roll ${degrees(path.roll_rad)}, pitch ${degrees(path.pitch_rad)}` : "No attitude yet");
}

/** Sky and ground as seen from the vehicle: it pitches up, the horizon sinks; rolls right, it turns left. */
function drawHorizon(canvas, path) {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  const size = Math.round(canvas.clientWidth * scale);
  if (!size) return;
  if (canvas.width !== size) canvas.width = canvas.height = size;
  const context = canvas.getContext("2d");
  const r = size / 2;
  context.setTransform(1, 0, 0, 1, r, r);
  context.clearRect(-r, -r, size, size);
  context.save();
  context.beginPath();
  context.arc(0, 0, r - scale, 0, 7);
  context.clip();
  if (path) drawWorld(context, path, r, scale);
  context.restore();
  context.strokeStyle = style("--muted");
  context.lineWidth = 2 * scale;
  context.beginPath();
  context.arc(0, 0, r - scale, 0, 7);
  context.stroke();
  if (path) drawVehicle(context, r, scale);
}

function drawWorld(context, { roll_rad: roll, pitch_rad: pitch }, r, scale) {
  context.rotate(-roll);
  const perRad = r / SHOWN_PITCH_RAD;
  const y = pitch * perRad;
  context.fillStyle = style("--sky");
  context.fillRect(-2 * r, -4 * r, 4 * r, 4 * r + y);
  context.fillStyle = style("--ground");
  context.fillRect(-2 * r, y, 4 * r, 4 * r);
  context.strokeStyle = "#fff";
  context.lineWidth = 1.5 * scale;
  context.beginPath();
  context.moveTo(-2 * r, y);
  context.lineTo(2 * r, y);
  for (const degrees of [-20, -10, 10, 20]) {
    const at = y - (degrees / DEGREES) * perRad;
    context.moveTo(-0.22 * r, at);
    context.lineTo(0.22 * r, at);
  }
  context.stroke();
}

function drawVehicle(context, r, scale) {
  for (const [colour, width] of [["#000", 5], ["#ffd400", 3]]) {
    context.strokeStyle = colour;
    context.lineWidth = width * scale;
    context.beginPath();
    context.moveTo(-0.55 * r, 0);
    context.lineTo(-0.2 * r, 0);
    context.lineTo(0, 0.12 * r);
    context.lineTo(0.2 * r, 0);
    context.lineTo(0.55 * r, 0);
    context.stroke();
  }
}

/** Attitudes of the last seconds, for the time at which an image was taken. */
export class AttitudeHistory {
  #rows = [];

  add(row) {
    this.#rows.push(row);
    if (this.#rows.length > 200) this.#rows.shift();
  }

  clear() {
    this.#rows = [];
  }

  /** Roll and pitch in rad, interpolated; null where no state within `slackMs` of the time is known. */
  at(tMs, slackMs = 300) {
    const a = this.#rows.findLast((row) => row.t_ms <= tMs && tMs - row.t_ms <= slackMs);
    const b = this.#rows.find((row) => row.t_ms > tMs && row.t_ms - tMs <= slackMs) ?? a;
    if (!a) return null;
    const share = b === a ? 0 : (tMs - a.t_ms) / (b.t_ms - a.t_ms);
    const mix = (name) => a[name] + share * (b[name] - a[name]);
    return { roll_rad: mix("roll_rad"), pitch_rad: mix("pitch_rad") };
  }
}
