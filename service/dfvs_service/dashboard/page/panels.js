// State, facts, numbers, links and events in words; nothing here is ever parsed as HTML.

const DEGREES = 180 / Math.PI;
const DASH = "–";

const ICONS = {
  IDLE: "…", PREFLIGHT: "✓?", READY: "▶", ENGAGE: "⇡", SERVO: "➤", HOLD: "❚❚", DONE: "✓",
  ABORT: "✕", RELEASED: "↩",
};

/** Time until which data count as live, and from when a stream's row is marked, s. */
const SLOW_S = { camera: 0.5, servo: 0.5, state: 1, flow: 2 };

/** A result of an older frame is no sign that anything may be flown, ms. */
const STALE_RESULT_MS = 1000;

const byId = (id) => document.getElementById(id);

const scaled = (value, factor) => (Number.isFinite(value) ? value * factor : NaN);

const fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : DASH);

export function duration(seconds) {
  if (!Number.isFinite(seconds)) return DASH;
  if (seconds < 60) return `${Math.max(seconds, 0).toFixed(1)} s`;
  const whole = Math.floor(seconds);
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (v) => String(v).padStart(2, "0");
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)} min`;
}

/** Set a text only where it changed: screen readers announce every change. */
function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function row(tag, cells, className = "") {
  const line = document.createElement(tag);
  line.className = className;
  line.append(...cells);
  return line;
}

function element(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

export function showState(state, freshness) {
  const body = document.body;
  body.dataset.state = state?.state ?? "";
  body.dataset.fresh = freshness.kind;
  say(byId("state-icon"), freshness.kind === "stale" ? "!" : ICONS[state?.state] ?? DASH);
  if (!state) {
    say(byId("state"), "no data");
    say(byId("cause"), freshness.text);
    say(byId("since"), DASH);
    return;
  }
  const isStale = freshness.kind === "stale";
  const title = isStale ? `STALE: was ${state.state}` : state.state;
  // Causes may change many times a second; read aloud is only a change of the state.
  if (byId("state").textContent !== title) say(byId("announcement"), `${title}. ${state.cause}`);
  say(byId("state"), title);
  say(byId("cause"), isStale ? freshness.text : state.cause || "–");
  showFacts(state);
  showWarnings(state.warnings ?? []);
}

export function showSince(state, nowMs) {
  say(byId("since"), state ? duration((nowMs - state.since_ms) / 1000) : DASH);
}

function showFacts(state) {
  const heartbeat = state.heartbeat_age_s;
  const battery = state.battery;
  const facts = [
    [state.mode || "no mode", state.mode === ""],
    [state.armed ? "armed" : "disarmed", false],
    [state.in_air ? "in the air" : "on the ground", false],
    [`battery ${battery === null ? DASH : `${Math.round(battery * 100)} %`}`, battery !== null && battery < 0.2],
    [`autopilot ${heartbeat === null ? "not heard" : `heard ${fixed(heartbeat, 1)} s ago`}`, heartbeat === null || heartbeat > 2],
    [`${fixed(state.distance_m, 2)} m from start`, false],
  ];
  const list = byId("facts");
  while (list.children.length > facts.length) list.lastChild.remove();
  facts.forEach(([text, isBad], i) => {
    const item = list.children[i] ?? list.appendChild(document.createElement("li"));
    say(item, text);
    item.className = isBad ? "bad" : "";
  });
}

function showWarnings(warnings) {
  const list = byId("warnings");
  list.hidden = warnings.length === 0;
  const shown = [...list.children].map((item) => item.textContent);
  if (shown.join("\n") !== warnings.join("\n")) {
    list.replaceChildren(...warnings.map((text) => element("li", text)));
  }
}

/** Length in m, to the mm below 10 m, and its standard deviation where that is known. */
function lengthWithSpread(value, spread) {
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

/** Name, and value, unit or what else stands small beside it, and whether it is an alarm. */
const NUMBERS = [
  ["Distance to goal", (n) => lengthWithSpread(n.servo?.error_m, n.servo?.error_spread_m)],
  ["Mean distance, 1 s", (n) => lengthWithSpread(n.servo?.mean_error_m, n.servo?.mean_error_spread_m)],
  ["Angle to goal", (n) => [fixed(scaled(n.servo?.error_rad, DEGREES), 2), "°"]],
  ["Speed", (n) => [fixed(n.path?.speed_m_s, 2), "m/s"]],
  ["Depth", (n) => [fixed(n.servo?.depth_m, 2), "m"]],
  ["Scale spread", (n) => [fixed(scaled(n.servo?.scale_spread, 100), 1), "%"]],
  ["Velocity error", (n) => [fixed(speed(n.servo?.velocity_error), 3), "m/s"]],
  ["Mounting", (n) => mounting(n.servo?.mounting_score, n.mountingLimit)],
  ["Inliers", (n) => [fixed(scaled(n.servo?.inlier_share, 100), 0), "%"]],
  ["Overlap", (n) => [fixed(scaled(n.servo?.overlap, 100), 0), "%"]],
  ["Residual", (n) => [fixed(n.servo?.residual_px, 2), "px"]],
  ["Conditioning", (n) => [fixed(n.servo?.condition, 0), ""]],
];

/** @param newest `{servo, path, mountingLimit}`: newest rows, and what the score is judged by */
export function showNumbers(newest) {
  const list = byId("numbers");
  if (!list.children.length) {
    for (const [name] of NUMBERS) {
      const value = row("dd", [element("span", ""), " ", element("small", "")]);
      list.append(row("div", [element("dt", name), value]));
    }
  }
  NUMBERS.forEach(([, of], i) => {
    const place = list.children[i].lastChild;
    const [value, rest, isBad] = of(newest);
    say(place.firstChild, value);
    say(place.lastChild, rest);
    place.className = isBad ? "bad" : "";
  });
}

/** States of the gate in which nothing is flown, whatever the image shows. */
const GROUNDED = new Set(["IDLE", "ABORT", "RELEASED"]);

/**
 * Whether the newest result may be flown by: green only while it is new and the gate may fly.
 * @param ageMs age of the result's frame; @param freshness of the gate's state
 */
export function showVerdict(verdict, ageMs, freshness, state) {
  const place = byId("verdict");
  const [text, ok] = judged(verdict, ageMs, freshness, state);
  say(place, text);
  place.dataset.ok = ok;
  document.body.dataset.results = ageMs < STALE_RESULT_MS ? "live" : "stale";
}

function judged(verdict, ageMs, freshness, state) {
  if (!verdict) return ["", ""];
  if (!(ageMs < STALE_RESULT_MS)) return [`? result ${duration(ageMs / 1000)} old`, ""];
  if (verdict.status !== "OK") return [`✕ ${verdict.reason || verdict.status}`, "no"];
  if (freshness.kind !== "live") return ["? state of the gate not known", ""];
  if (GROUNDED.has(state.state)) return [`image good, the gate is in ${state.state}`, ""];
  return ["✓ may be flown", "yes"];
}

const STREAMS = { camera: "camera", servo: "results", state: "state", flow: "flow" };

/** @param link what the server measured; @param screen what this page measured */
export function showLinks(link, screen, roundTripMs) {
  const rows = Object.entries(STREAMS).map(([name, title]) => {
    const stream = link?.streams[name];
    const isLate = stream?.age_s === null || stream?.age_s > SLOW_S[name];
    return streamRow(title, stream, isLate);
  });
  rows.push(row("tr", [
    element("td", "this screen"), element("td", `${fixed(screen.fps, 1)} Hz`), element("td", ""),
    element("td", `${fixed(screen.p50Ms, 0)} ms`), element("td", String(screen.overtaken)),
  ]));
  byId("links").replaceChildren(...rows);
  const facts = [`page to server and back ${fixed(roundTripMs, 0)} ms`];
  if (link?.is_foreign_clock) facts.push("the vehicle's clock is another machine's: delays are those beyond the quickest message");
  say(byId("link-facts"), facts.join("; "));
}

function streamRow(title, stream, isLate) {
  const cells = [
    title, `${fixed(stream?.hz, 1)} Hz`, load(stream?.bytes_s),
    stream?.age_s == null ? "never" : duration(stream.age_s),
    title === "camera" ? String(stream?.missing ?? 0) : "",
  ];
  return row("tr", cells.map((text) => element("td", text)), isLate ? "bad" : "");
}

function load(bytes) {
  if (!bytes) return "";
  return bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB/s` : `${(bytes / 1e6).toFixed(1)} MB/s`;
}

const STAGES = {
  transport: "camera to perception", wait: "waiting", decode: "decoding", prepare: "preparing",
  match: "matching", servo: "servo law", capture_to_report: "capture to result", depth: "depth (after)",
};

export function showDelays(timing, screen) {
  const lines = Object.entries(timing?.stages ?? {}).map(([name, [p50, p99]]) => [STAGES[name] ?? name, p50, p99]);
  lines.push(["capture to this screen", screen.p50Ms, screen.p99Ms]);
  byId("delays").replaceChildren(...lines.map(([name, p50, p99]) =>
    row("tr", [element("td", name), element("td", fixed(p50, 1)), element("td", fixed(p99, 1))])));
}

export function addEvents(transitions) {
  const list = byId("events");
  for (const { t_ms: tMs, to, cause } of transitions) {
    const time = element("time", new Date(tMs).toLocaleTimeString([], { hour12: false }));
    list.prepend(row("li", [time, element("b", to), element("span", cause)]));
  }
  while (list.children.length > 50) list.lastChild.remove();
}

export function clearEvents() {
  byId("events").replaceChildren();
}

/** Keep the list of vehicles; the choice stays where it is. */
export function showVehicles(vehicles, watched) {
  const select = byId("vehicle");
  select.disabled = vehicles.length === 0;
  const texts = vehicles.map((v) => `${v.name}${v.age_s > 3 ? " (silent)" : v.state ? ` – ${v.state}` : ""}`);
  if (!vehicles.length) texts.push("no vehicle yet");
  while (select.options.length > texts.length) select.remove(select.options.length - 1);
  texts.forEach((text, i) => {
    if (!select.options[i]) select.add(new Option());
    say(select.options[i], text);
    select.options[i].value = vehicles[i]?.name ?? "";
  });
  if (watched) select.value = watched;
}

export function describeView(frames, nowMs, captureMs, newest) {
  const age = captureMs === null ? NaN : (nowMs - captureMs) / 1000;
  say(byId("view-facts"), `${frames} frames, newest ${duration(age)} old`);
  const [left, rest] = lengthWithSpread(newest.servo?.error_m, newest.servo?.error_spread_m);
  byId("view").setAttribute("aria-label",
    captureMs === null ? "No picture yet"
      : `Goal and live view; ${left === DASH ? "distance to the goal unknown" : `${left} ${rest} to the goal`}`);
}
