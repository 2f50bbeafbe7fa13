// The state of the gate in words: card, header, title and events.

import { byId, DASH, duration, element, fixed, row, say, timeOfDay } from "./words.js";
import { ageText, LIMITS_MS } from "./freshness.js";

const LOW_BATTERY = 0.2;

/**
 * @param truth result of `assess`; @param state newest state of the gate or undefined
 * @param ownWarning the dashboard's own warning or undefined
 */
export function showState(truth, state, ownWarning, nowMs) {
  const { gate, old } = truth;
  document.body.dataset.state = gate.name;
  document.body.dataset.fresh = gate.kind;
  say(byId("state-icon"), gate.icon);
  // Causes may change many times a second; read aloud is only a change of the state.
  if (byId("state").textContent !== gate.title) say(byId("announcement"), `${gate.title}. ${gate.text}`);
  say(byId("state"), gate.title);
  say(byId("cause"), gate.text);
  // Nobody knows whether a silent vehicle still is in its state.
  const untilMs = old.state ? state?.t_ms : nowMs;
  say(byId("since"), state ? duration((untilMs - state.since_ms) / 1000) : DASH);
  showFacts(truth, state);
  showWarnings([ownWarning ?? [], state?.warnings ?? []].flat());
}

function showFacts({ ages, old }, state) {
  const list = byId("facts");
  list.hidden = !state;
  if (!state) return;
  const isSilent = !(ages.autopilot < LIMITS_MS.autopilot);
  const facts = [
    [state.mode || "no mode", state.mode === ""],
    [state.armed ? "armed" : "disarmed", false],
    [state.in_air ? "in the air" : "on the ground", false],
    [batteryText(state, ages, old), state.battery !== null && state.battery < LOW_BATTERY],
    [`autopilot heard ${Number.isFinite(ages.autopilot) ? `${duration(ages.autopilot / 1000)} ago` : "never"}`, isSilent],
    [`${fixed(state.distance_m, 2)} m from start`, false],
  ];
  if (state.reached && state.state !== "DONE") facts.push(["goal was reached", false]);
  while (list.children.length > facts.length) list.lastChild.remove();
  facts.forEach(([text, isBad], i) => {
    const item = list.children[i] ?? list.appendChild(document.createElement("li"));
    say(item, text);
    item.className = isBad ? "bad" : "";
  });
}

function batteryText(state, ages, old) {
  if (state.battery === null) return `battery ${DASH}`;
  return `battery ${Math.round(state.battery * 100)} %${old.battery ? `, ${ageText(ages.battery)}` : ""}`;
}

function showWarnings(warnings) {
  const list = byId("warnings");
  list.hidden = byId("warning-count").hidden = warnings.length === 0;
  say(byId("warning-count"), `⚠ ${warnings.length}`);
  byId("warning-count").ariaLabel = `Warnings: ${warnings.length}`;
  const shown = [...list.children].map((item) => item.textContent);
  if (shown.join("\n") !== warnings.join("\n")) {
    list.replaceChildren(...warnings.map((text) => element("li", text)));
  }
}

/** Chip and alarm about the server, the verdict of the newest result, and the document's title. */
export function showHeader({ gate, server, alarm, verdict }, watched) {
  say(byId("server"), server.text);
  byId("server").dataset.ok = server.ok;
  byId("alarm").hidden = !alarm;
  say(byId("alarm"), alarm);
  say(byId("verdict"), verdict.text);
  byId("verdict").dataset.ok = verdict.ok;
  const title = gate.kind === "never" ? "DFVS" : `${gate.title} ${watched}`;
  if (document.title !== title) document.title = title;
}

/** Keep the list of vehicles; the one that is watched says what the card says. */
export function showVehicles(vehicles, watched, { gate, server }, nowMs) {
  const select = byId("vehicle");
  select.disabled = vehicles.length === 0;
  const texts = vehicles.map((v) => {
    const title = v.name === watched && gate.kind !== "never" ? gate.title : listed(v, nowMs, server);
    return title ? `${v.name} – ${title}` : v.name;
  });
  if (!vehicles.length) texts.push("no vehicle yet");
  while (select.options.length > texts.length) select.remove(select.options.length - 1);
  texts.forEach((text, i) => {
    if (!select.options[i]) select.add(new Option());
    say(select.options[i], text);
    select.options[i].value = vehicles[i]?.name ?? "";
  });
  if (watched) select.value = watched;
}

/** What is said of a vehicle that is not watched. */
function listed({ state, t_ms: tMs }, nowMs, server) {
  if (!state) return "";
  return server.ok !== "no" && nowMs - tMs < 2 * LIMITS_MS.state ? state : `STALE: was ${state}`;
}

export function addEvents(transitions) {
  const list = byId("events");
  for (const { t_ms: tMs, to, cause } of transitions) {
    list.prepend(row("li", [element("time", timeOfDay(tMs)), element("b", to), element("span", cause)]));
  }
  while (list.children.length > 50) list.lastChild.remove();
}

export function clearEvents() {
  byId("events").replaceChildren();
}
