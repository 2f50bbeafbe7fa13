// Health of the links: rates and ages of the streams, delays of the stages.

import { byId, duration, element, fixed, row, say } from "./words.js";

/** Title of each stream, and the age from which its row is marked, s. */
const STREAMS = { camera: ["camera", 0.5], servo: ["results", 0.5], state: ["state", 1], flow: ["flow", 2] };

/**
 * @param link what the server measured; @param screen what this page measured
 * @param sinceS time since the server measured, s: ages go on while nothing is heard of it
 */
export function showLinks(link, screen, roundTripMs, sinceS) {
  const rows = Object.entries(STREAMS).map(([name, [title, limitS]]) => {
    const stream = link?.streams[name];
    const ageS = stream?.age_s == null ? null : stream.age_s + sinceS;
    return streamRow(title, stream, ageS, ageS === null || ageS > limitS);
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

function streamRow(title, stream, ageS, isLate) {
  const cells = [
    title, isLate ? "–" : `${fixed(stream?.hz, 1)} Hz`, isLate ? "" : load(stream?.bytes_s),
    ageS === null ? "never" : duration(ageS), title === "camera" ? String(stream?.missing ?? 0) : "",
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
