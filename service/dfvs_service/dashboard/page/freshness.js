// How old everything is, and what may be said of it. Every part of the page asks here and nowhere
// else, so that no two parts disagree.

import { DASH, duration, say, timeOfDay } from "./words.js";

/** Age from which the values of a source are old, ms. */
export const LIMITS_MS = Object.freeze({
  state: 1500, vehicle: 1500, autopilot: 2000, battery: 5000, results: 1000, view: 1000, flow: 1000,
  timing: 3000, links: 2000,
});

/** What is later than this by the server's clock was stamped before that was set back: its age is not known. */
export const SET_BACK_MS = 2000;

/** States of the gate in which nothing is flown, whatever the image shows. */
const GROUNDED = new Set(["IDLE", "ABORT", "RELEASED"]);

const ICONS = {
  IDLE: "…", PREFLIGHT: "✓?", READY: "▶", ENGAGE: "⇡", SERVO: "➤", HOLD: "❚❚", DONE: "✓",
  ABORT: "✕", RELEASED: "↩",
};

/**
 * @param known newest of everything: state, path, servo, verdict, timing, link, zenoh; and the capture
 *   times viewMs and flowMs
 * @param nowMs server's clock
 * @param server {isOpen, lostMs}: whether it is connected, and for how long it has not been
 * @returns {{ages, old, gate, verdict, server, alarm}} ages in ms (NaN: not known)
 */
export function assess(known, nowMs, server) {
  const { state } = known;
  const since = (tMs) => (Number.isFinite(tMs) && tMs < nowMs + SET_BACK_MS ? Math.max(nowMs - tMs, 0) : NaN);
  const stateMs = since(state?.t_ms);
  const within = (ageS) => (ageS === null ? NaN : stateMs + (ageS ?? 0) * 1000);
  const ages = {
    state: stateMs, vehicle: since(known.path?.t_ms), autopilot: within(state?.heartbeat_age_s),
    battery: within(state?.battery_age_s), results: since(known.servo?.t_ms), view: since(known.viewMs),
    flow: since(known.flowMs), timing: since(known.timing?.t_ms), links: since(known.link?.t_ms),
  };
  const old = {};
  for (const source of Object.keys(ages)) old[source] = !server.isOpen || !(ages[source] < LIMITS_MS[source]);
  const gate = gateOf(known, old.state, server);
  return {
    ages, old, gate,
    verdict: judged(known, ages, old),
    server: serverOf(gate, server),
    alarm: server.lostMs > 1000
      ? "Connection to the dashboard's server lost. What you see is old. Reconnecting …" : "",
  };
}

function gateOf({ state, zenoh }, isOld, server) {
  if (!state) {
    return { kind: "never", name: "", title: "no data", icon: DASH, text: waitingFor(zenoh, server) };
  }
  if (isOld) {
    const text = `Nothing heard since ${timeOfDay(state.t_ms)}.`;
    return { kind: "stale", name: state.state, title: `STALE: was ${state.state}`, icon: "!", text };
  }
  const isDone = state.state === "DONE";
  return {
    kind: "live", name: state.state, title: isDone ? "DONE: goal reached" : state.state,
    icon: ICONS[state.state] ?? DASH, text: state.cause || DASH,
  };
}

function waitingFor(zenoh, server) {
  if (!server.isOpen) return "Waiting for the dashboard's server.";
  return zenoh?.connected ? "Waiting for a vehicle." : "Waiting for a service or router to connect to.";
}

function serverOf(gate, server) {
  if (!server.isOpen) return { text: "reconnecting", ok: "no" };
  if (gate.kind === "never") return { text: "no vehicle", ok: "" };
  if (gate.kind === "stale") return { text: "silent", ok: "no" };
  return { text: "live", ok: "yes" };
}

/** Whether the newest result is valid: green only while it is new and the gate may fly. */
function judged({ verdict, state }, ages, old) {
  if (!verdict) return { text: "", ok: "" };
  if (old.results) return { text: `? result ${duration(ages.results / 1000)} old`, ok: "" };
  if (verdict.status !== "OK") return { text: `✕ ${verdict.reason || verdict.status}`, ok: "no" };
  if (old.state) return { text: "? state of the gate not known", ok: "" };
  if (GROUNDED.has(state.state)) return { text: `image good, the gate is in ${state.state}`, ok: "" };
  return { text: "✓ valid", ok: "yes" };
}

/** Text of an age; that of fresh values stays the same, so that nothing flickers. */
export function ageText(ageMs) {
  if (!Number.isFinite(ageMs)) return "no data";
  return ageMs < 1000 ? "under 1 s old" : `${duration(ageMs / 1000)} old`;
}

/** Grey what is old (`data-source`), and fill in all labels of ages (`data-age-of`). */
export function showAges({ ages, old }) {
  for (const place of document.querySelectorAll("[data-source]")) {
    place.classList.toggle("old", old[place.dataset.source]);
  }
  for (const label of document.querySelectorAll("[data-age-of]")) {
    const source = label.dataset.ageOf;
    const isOld = old[source] && Number.isFinite(ages[source]);
    label.classList.toggle("is-old", isOld);
    say(label, "quiet" in label.dataset && !isOld ? "" : ageText(ages[source]));
  }
}
