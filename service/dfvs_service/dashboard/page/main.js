// The dashboard's page: updates from the server to the panels, and the user's choices back.

import { Connection } from "./connection.js";
import { ageText, assess, showAges } from "./freshness.js";
import { AttitudeHistory, showInstruments } from "./instruments.js";
import { showDelays, showLinks } from "./links.js";
import { lengthWithSpread, showNumbers } from "./numbers.js";
import { Operator, keptToken } from "./operator.js";
import { PathView } from "./path.js";
import { Plots } from "./plots.js";
import * as card from "./state_card.js";
import { startTheme } from "./theme.js";
import { View } from "./view.js";
import { byId, DASH, duration, say } from "./words.js";

const REFRESH_MS = 200;
const TABLES_EVERY = 5;
const MODES = ["side", "slider", "blend", "difference"];
const LIVELY_MS = 3000;

const connection = new Connection(keptToken());
const now = () => connection.clock.now();
const view = new View(byId("view"), now);
const path = new PathView(byId("path"));
const plots = new Plots(byId("plots"), now);
const attitudes = new AttitudeHistory();
const operator = new Operator(connection, () => view.shown && { ...view.shown, attitude: attitudes.at(view.shown.captureMs) });
const nextTheme = startTheme(() => {
  plots.restyle();
  path.redraw();
});

/** The user's choice, or the first vehicle that was found; it outlives a lost connection. */
let watched = "";
/** What the server sends on this connection. */
let confirmed = "";
let shown = "";
let known = {};
let vehicles = [];
let columns = { servo: [], path: [] };
let mountingLimit = Infinity;
let refreshes = 0;
let lostSinceMs = performance.now();

// --- updates -----------------------------------------------------------------------------------

function forget(name) {
  // After a reconnection the last image stays until a newer one comes.
  if (name !== shown) view.clear();
  shown = name;
  known = { zenoh: known.zenoh, overtaken: known.overtaken };
  path.clear();
  plots.clear();
  attitudes.clear();
  card.clearEvents();
  refreshes = 0;
}

const named = (names, row) => Object.fromEntries(names.map((name, i) => [name, row[i]]));

function takeServo(rows) {
  for (const values of rows) {
    known.servo = named(columns.servo, values);
    plots.add("results", known.servo);
    path.aim(known.servo.motion);
  }
}

function takePath(rows) {
  for (const values of rows) {
    known.path = named(columns.path, values);
    plots.add("vehicle", known.path);
    path.add(known.path);
    attitudes.add(known.path);
  }
}

function takeTransitions(list) {
  card.addEvents(list);
  plots.mark(list);
}

const TAKE = {
  vehicles: (list) => {
    const own = list.find((v) => v.name === watched);
    // The server does not know it yet: it stays chosen, and is asked for once it is listed.
    vehicles = watched && !own ? [{ name: watched, state: "", t_ms: null }, ...list] : list;
    const wanted = watched ? own : list.find((v) => now() - v.t_ms < LIVELY_MS) ?? list[0];
    if (wanted && wanted.name !== confirmed) watch(wanted.name);
  },
  watching: (name) => {
    watched = confirmed = name;
    operator.watch(name);
    forget(name);
  },
  settings: (settings) => {
    if (Number.isFinite(settings.min_confidence)) view.minConfidence = settings.min_confidence;
    operator.cameraWidth = settings.camera_width;
  },
  history: (history) => {
    takeTransitions(history.transitions);
    takePath(history.path);
    takeServo(history.servo);
  },
  servo: takeServo,
  path: takePath,
  transitions: takeTransitions,
  answers: (answers) => operator.answered(answers),
};
/** Kept as they come, for the next refresh. */
const KEPT = ["state", "verdict", "timing", "link", "zenoh", "overtaken"];

function watch(name) {
  if (name !== shown) forget("");
  watched = name;
  connection.send({ type: "watch", vehicle: name });
}

connection.addEventListener("update", ({ detail: update }) => {
  // In the table's order: what is watched comes before its history.
  for (const [key, take] of Object.entries(TAKE)) if (key in update) take(update[key]);
  for (const key of KEPT) if (key in update) known[key] = update[key];
});
connection.addEventListener("image", ({ detail }) => view.take(detail));
connection.addEventListener("welcome", ({ detail }) => {
  columns = detail.columns;
  mountingLimit = detail.mounting_score;
  lostSinceMs = null;
  operator.welcome(detail);
});
connection.addEventListener("lost", () => {
  confirmed = "";
  operator.lost();
  lostSinceMs ??= performance.now();
});
connection.addEventListener("denied", ({ detail }) => operator.denied(detail.reason));

// --- what is shown -----------------------------------------------------------------------------

function refresh() {
  const nowMs = now();
  const server = {
    isOpen: connection.isOpen && connection.clock.isKnown, lostMs: lostSinceMs === null ? 0 : performance.now() - lostSinceMs,
  };
  const truth = assess({ ...known, viewMs: view.shown?.captureMs, flowMs: view.flowMs }, nowMs, server);
  card.showState(truth, known.state, known.zenoh?.warnings?.[watched], nowMs);
  card.showHeader(truth, watched);
  card.showVehicles(vehicles, watched, truth, nowMs);
  showNumbers({ ...known, mountingLimit });
  showInstruments(known.path, known.state);
  if (refreshes++ % TABLES_EVERY === 0) {
    const screen = { ...view.stats, overtaken: known.overtaken ?? 0 };
    showLinks(known.link, screen, connection.clock.roundTripMs, truth.ages.links / 1000);
    showDelays(known.timing, screen);
  }
  showView(truth);
  operator.show(known.state ?? null, truth.old);
  say(byId("path-facts"), `${path.lengthM.toFixed(2)} m flown, ${path.straightM.toFixed(2)} m straight`);
  path.ageGoal(truth.old.results ? ageText(truth.ages.results) : "");
  showAges(truth);
}

function showView({ ages, old }) {
  const isOld = old.view;
  const age = duration(ages.view / 1000);
  byId("view-notice").hidden = !isOld;
  say(byId("view-notice"), view.shown ? `NO NEW IMAGE FOR ${age}` : "No image yet");
  say(byId("view-facts"), `${view.frames} ${view.frames === 1 ? "frame" : "frames"}, newest ${age} old`);
  const [left, rest] = lengthWithSpread(known.servo?.error_m, known.servo?.error_spread_m);
  const distance = left === DASH || old.results ? "distance to the goal unknown" : `${left} ${rest} to the goal`;
  byId("view").setAttribute("aria-label",
    !view.shown ? "No image yet" : `Goal and ${isOld ? "old" : "live"} view; ${distance}`);
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
  byId(`${name}-legend`).hidden = !isOn;
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
  H: () => operator.command("hold"), A: () => operator.command("abort"),
  ArrowLeft: () => setMix(Math.max(view.mix - 0.02, 0)), ArrowRight: () => setMix(Math.min(view.mix + 0.02, 1)),
  "?": () => byId("help-dialog").showModal(),
};

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  const isCharacter = event.key.length === 1;
  // By Shift, whatever caps lock makes of the letter.
  const key = !isCharacter ? event.key : event.shiftKey ? event.key.toUpperCase() : event.key.toLowerCase();
  // Text is typed in dialogs alone: Hold and Abort count wherever the focus was left.
  const isOfControl = event.target.matches("input:not([type=checkbox]), select") && !"HA".includes(key);
  if (isOfControl || !KEYS[key]) return;
  KEYS[key]();
  event.preventDefault();
});
document.querySelectorAll('input[name="mode"]').forEach((input) =>
  input.addEventListener("change", () => setMode(input.value)));
document.querySelectorAll('input[name="span"]').forEach((input) =>
  input.addEventListener("change", () => plots.show(Number(input.value))));
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
globalThis.dfvsScreen = () => ({ ...view.stats, watched, refreshes, roundTripMs: connection.clock.roundTripMs });
