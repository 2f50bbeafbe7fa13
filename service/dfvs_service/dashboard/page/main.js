// The dashboard's page: news from the server to the panels, and the user's choices back.

import { Connection } from "./connection.js";
import { Operator, keptToken } from "./operator.js";
import * as panels from "./panels.js";
import { PathView } from "./path.js";
import { Plots } from "./plots.js";
import { startTheme } from "./theme.js";
import { View } from "./view.js";

const STALE_STATE_MS = 1500;
const STALE_VIEW_MS = 1000;
const REFRESH_MS = 200;
const TABLES_EVERY = 5;
const MODES = ["side", "slider", "blend", "difference"];

const byId = (id) => document.getElementById(id);
const connection = new Connection(keptToken());
const now = () => connection.clock.now();
const view = new View(byId("view"), now);
const path = new PathView(byId("path"));
const plots = new Plots(byId("plots"));
const operator = new Operator(connection);
const nextTheme = startTheme(() => {
  plots.restyle();
  path.redraw();
});

let watched = "";
let shown = "";
let known = {};
let columns = { servo: [], path: [] };
let mountingLimit = Infinity;
let refreshes = 0;
let lostSinceMs = performance.now();

// --- news ------------------------------------------------------------------------------------

function forget(name) {
  // After a reconnection the last picture stays until a newer one comes.
  if (name !== shown) view.clear();
  shown = name;
  known = { ...known, servo: null, verdict: null, path: null, state: null, timing: null, link: null };
  path.clear();
  plots.clear();
  panels.clearEvents();
}

const named = (names, row) => Object.fromEntries(names.map((name, i) => [name, row[i]]));

function takeServo(rows) {
  for (const values of rows) {
    known.servo = named(columns.servo, values);
    plots.addServo(known.servo);
    path.aim(known.servo.motion);
  }
}

function takePath(rows) {
  for (const values of rows) {
    known.path = named(columns.path, values);
    plots.addPath(known.path);
    path.add(known.path);
  }
}

const TAKE = {
  vehicles: (list) => {
    panels.showVehicles(list, watched);
    const wanted = list.find((v) => v.name === watched) ?? liveliest(list);
    if (wanted && wanted.name !== watched) watch(wanted.name);
  },
  watching: (name) => {
    watched = name;
    operator.watch(name);
    forget(name);
  },
  settings: (settings) => {
    if (Number.isFinite(settings.min_confidence)) view.minConfidence = settings.min_confidence;
  },
  history: (history) => {
    takePath(history.path);
    takeServo(history.servo);
    panels.addEvents(history.transitions);
  },
  state: (state) => (known.state = state),
  servo: takeServo,
  path: takePath,
  transitions: (list) => panels.addEvents(list),
  verdict: (verdict) => (known.verdict = verdict),
  timing: (timing) => (known.timing = timing),
  link: (link) => (known.link = link),
  zenoh: (zenoh) => (known.zenoh = zenoh),
  overtaken: (count) => (known.overtaken = count),
  answers: (answers) => operator.answered(answers),
};

/** A vehicle that talks, or else any. */
const liveliest = (list) => list.find((v) => v.age_s < 3) ?? list[0];

function watch(name) {
  watched = name;
  connection.send({ type: "watch", vehicle: name });
}

connection.addEventListener("news", ({ detail: news }) => {
  // In the table's order: what is watched comes before its history.
  for (const [key, take] of Object.entries(TAKE)) if (key in news) take(news[key]);
});
connection.addEventListener("picture", ({ detail }) => view.take(detail));
connection.addEventListener("welcome", ({ detail }) => {
  columns = detail.columns;
  mountingLimit = detail.mounting_score;
  lostSinceMs = null;
  operator.welcome(detail);
  if (watched) watch(watched);
});
connection.addEventListener("lost", () => (lostSinceMs ??= performance.now()));
connection.addEventListener("denied", ({ detail }) => operator.denied(detail.reason));

// --- what is old ------------------------------------------------------------------------------

function freshness() {
  const ageMs = known.state ? now() - known.state.t_ms : NaN;
  if (!known.state) return { kind: "never", text: waitingFor() };
  if (connection.isOpen && ageMs < STALE_STATE_MS) return { kind: "live", text: "" };
  return { kind: "stale", text: `Nothing heard for ${panels.duration(ageMs / 1000)}.` };
}

function waitingFor() {
  if (!connection.isOpen) return "Waiting for the dashboard's server.";
  return known.zenoh?.connected ? "Waiting for a vehicle." : "Waiting for a service or router to connect to.";
}

function showServer() {
  const chip = byId("server");
  const isUp = connection.isOpen;
  const hasLink = isUp && known.zenoh?.connected > 0;
  const text = !isUp ? "reconnecting" : hasLink ? "connected" : "no vehicle link";
  if (chip.textContent !== text) chip.textContent = text;
  chip.dataset.ok = !isUp ? "no" : hasLink ? "yes" : "";
  const seconds = lostSinceMs === null ? 0 : (performance.now() - lostSinceMs) / 1000;
  const alarm = byId("alarm");
  alarm.hidden = seconds < 1;
  if (alarm.hidden) return;
  const message = "Connection to the dashboard's server lost. What you see is old. Reconnecting …";
  if (alarm.textContent !== message) alarm.textContent = message;
}

function showViewAge() {
  const ageMs = view.captureMs === null ? Infinity : now() - view.captureMs;
  const isOld = ageMs > STALE_VIEW_MS;
  byId("view").parentElement.classList.toggle("old", isOld);
  const notice = byId("view-notice");
  notice.hidden = !isOld;
  const text = view.captureMs === null ? "No picture yet" : `NO NEW PICTURE FOR ${panels.duration(ageMs / 1000)}`;
  if (isOld && notice.textContent !== text) notice.textContent = text;
}

function refresh() {
  const fresh = freshness();
  const screen = { ...view.stats, overtaken: known.overtaken ?? 0 };
  panels.showState(known.state ?? null, fresh);
  panels.showSince(known.state ?? null, now());
  const resultAgeMs = now() - (known.servo?.t_ms ?? NaN);
  panels.showVerdict(known.verdict, resultAgeMs, fresh, known.state);
  panels.showNumbers({ ...known, mountingLimit });
  if (refreshes++ % TABLES_EVERY === 0) {
    panels.showLinks(known.link, screen, connection.clock.roundTripMs);
    panels.showDelays(known.timing, screen);
  }
  panels.describeView(view.frames, now(), view.captureMs, known);
  operator.show(known.state ?? null, fresh.kind === "live");
  showServer();
  showViewAge();
  byId("path-facts").textContent =
    `${path.lengthM.toFixed(2)} m flown, ${path.straightM.toFixed(2)} m straight`;
  const title = known.state ? `${fresh.kind === "stale" ? "STALE " : ""}${known.state.state} ${watched}` : "DFVS";
  if (document.title !== title) document.title = title;
}

// --- the user's choices -----------------------------------------------------------------------

function setMode(mode) {
  view.mode = mode;
  document.querySelector(`input[name="mode"][value="${mode}"]`).checked = true;
  byId("mix-row").hidden = mode !== "slider" && mode !== "blend";
  view.redraw();
}

function setMix(share) {
  view.mix = share;
  byId("mix").value = Math.round(share * 100);
  view.redraw();
}

function setOverlay(name, isOn) {
  byId(`show-${name}`).checked = isOn;
  if (name === "flow") view.showsFlow = isOn;
  else view.showsConfidence = isOn;
  view.redraw();
}

function nextVehicle() {
  const select = byId("vehicle");
  if (select.options.length < 2) return;
  watch(select.options[(select.selectedIndex + 1) % select.options.length].value);
}

const KEYS = {
  1: () => setMode(MODES[0]), 2: () => setMode(MODES[1]), 3: () => setMode(MODES[2]), 4: () => setMode(MODES[3]),
  f: () => setOverlay("flow", !view.showsFlow), c: () => setOverlay("confidence", !view.showsConfidence),
  v: nextVehicle, t: nextTheme,
  H: () => operator.order("hold"), A: () => operator.order("abort"),
  ArrowLeft: () => setMix(Math.max(view.mix - 0.02, 0)), ArrowRight: () => setMix(Math.min(view.mix + 0.02, 1)),
  "?": () => byId("help-dialog").showModal(),
};

document.addEventListener("keydown", (event) => {
  const isTyping = event.target.matches("input:not([type=checkbox]), select, textarea");
  if (isTyping || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  const key = event.key.length === 1 && !event.shiftKey ? event.key.toLowerCase() : event.key;
  if (!KEYS[key]) return;
  KEYS[key]();
  event.preventDefault();
});
document.querySelectorAll('input[name="mode"]').forEach((input) =>
  input.addEventListener("change", () => setMode(input.value)));
document.querySelectorAll('input[name="span"]').forEach((input) =>
  input.addEventListener("change", () => {
    plots.spanS = Number(input.value);
    plots.redraw();
  }));
byId("mix").addEventListener("input", () => setMix(byId("mix").value / 100));
byId("view").addEventListener("mix", ({ detail }) => setMix(detail));
byId("show-flow").addEventListener("change", (e) => setOverlay("flow", e.target.checked));
byId("show-confidence").addEventListener("change", (e) => setOverlay("confidence", e.target.checked));
byId("vehicle").addEventListener("change", (e) => watch(e.target.value));
byId("help").addEventListener("click", () => byId("help-dialog").showModal());

forget("");
setInterval(refresh, REFRESH_MS);
connection.open();

/** For automated measurements: what this page has shown. */
globalThis.dfvsScreen = () => ({ ...view.stats, roundTripMs: connection.clock.roundTripMs });
