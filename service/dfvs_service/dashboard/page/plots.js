// All plots on one time axis, drawn a few times a second and only while the page is looked at.

import { SET_BACK_MS } from "./freshness.js";
import { Plot } from "./plot.js";
import { PLOTS } from "./plot_series.js";
import { byId, say, timeOfDay } from "./words.js";

const PERIOD_MS = 250;
const LEAST_SPAN_S = 5;
const MOST_MARKERS = 50;
/** Share of the time shown that is left empty at most, once nothing comes any more. */
const EMPTY_SHARE = 0.2;

export class Plots {
  #plots;
  #now;
  #zoom = null;
  spanS = 30;
  /** Transitions of the gate, as they came. */
  markers = [];

  /** @param {HTMLElement} parent takes the plots; @param {() => number} now server's clock, ms */
  constructor(parent, now) {
    this.#now = now;
    const events = {
      markers: () => this.markers,
      onHover: (tS) => this.#showTime(tS),
      onZoom: (fromS, toS) => this.#setZoom([fromS, toS]),
      onUnzoom: () => this.#setZoom(null),
    };
    this.#plots = PLOTS.map((definition) => new Plot(definition, parent, events));
    byId("unzoom").addEventListener("click", () => this.#setZoom(null));
    setInterval(() => this.#draw(), PERIOD_MS);
  }

  /** @param source of the row: `results` or `vehicle` */
  add(source, row) {
    const plots = this.#plots.filter((plot) => plot.source === source);
    const latestMs = row.t_ms + SET_BACK_MS;
    if (plots[0].lastS * 1000 > latestMs) {
      for (const plot of this.#plots) if (plot.lastS * 1000 > latestMs) plot.clear();
      this.#unmark(latestMs);
    }
    for (const plot of plots) plot.add(row.t_ms, row);
  }

  mark(transitions) {
    for (const transition of transitions) {
      this.#unmark(transition.t_ms + SET_BACK_MS);
      this.markers.push(transition);
    }
    this.markers.splice(0, this.markers.length - MOST_MARKERS);
  }

  /** Forget the markers up to the last one that is later: the clock was set back after it. */
  #unmark(latestMs) {
    this.markers.splice(0, this.markers.findLastIndex((marker) => marker.t_ms > latestMs) + 1);
  }

  clear() {
    this.#plots.forEach((plot) => plot.clear());
    this.markers = [];
    this.#setZoom(null);
  }

  /** Take the colours of another theme. */
  restyle() {
    this.#plots.forEach((plot) => plot.forgetChart());
  }

  /** Show the last `spanS` seconds, 0: all of them. */
  show(spanS) {
    this.spanS = spanS;
    this.#setZoom(null);
  }

  #setZoom(range) {
    this.#zoom = range;
    byId("unzoom").hidden = !range;
    this.#showTime(null);
    this.#draw();
  }

  #showTime(tS) {
    if (tS === null) {
      say(byId("plot-time"), this.#zoom ? this.#zoom.map((edgeS) => timeOfDay(edgeS * 1000)).join(" to ") : "");
      return;
    }
    const state = this.markers.findLast((marker) => marker.t_ms <= tS * 1000)?.to ?? "";
    say(byId("plot-time"), `${timeOfDay(tS * 1000)} ${state}`);
  }

  /** Seconds at the left and right edge; null before the first data. */
  get rangeS() {
    if (this.#zoom) return this.#zoom;
    const last = Math.max(...this.#plots.map((plot) => plot.lastS));
    if (!last) return null;
    const first = Math.min(...this.#plots.map((plot) => plot.firstS).filter((t) => t > 0));
    const spanS = Math.max(this.spanS ? Math.min(this.spanS, last - first) : last - first, LEAST_SPAN_S);
    // Time goes on without data, until they would be pushed out of sight.
    const right = Math.min(Math.max(this.#now() / 1000, last), last + EMPTY_SHARE * spanS);
    return [right - spanS, right];
  }

  #draw() {
    if (document.hidden) return;
    const range = this.rangeS;
    if (range) this.#plots.forEach((plot) => plot.draw(...range));
  }
}
