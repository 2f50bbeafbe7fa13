// One plot of time series with uPlot: lines, bands of uncertainty, markers of the gate's states.

import { ageLabel, row, say, style } from "./words.js";

const MAX_POINTS = 9000;
const HEIGHT_PX = 112;
const WIDE_PX = 1800;
const WIDE_HEIGHT_PX = 180;
const BAND_OPACITY = 0.3;

/** Colour of a state's marker; others are calm. */
const TONES = {
  SERVO: "--good", DONE: "--good", ENGAGE: "--busy", HOLD: "--busy", ABORT: "--bad", READY: "--accent",
  RELEASED: "--odd",
};

/** Data column by column: time, the lines, two edges of every band. */
export class Plot {
  #definition;
  #bands;
  #columns;
  #chart = null;
  #box;
  #place = document.createElement("div");
  #readouts = [];
  #events;

  /** @param events {markers, onHover(tS or null), onZoom(fromS, toS), onUnzoom()} */
  constructor(definition, parent, events) {
    this.#definition = definition;
    this.#events = events;
    this.#bands = definition.lines.filter((line) => line.spread);
    this.#columns = Array.from({ length: 1 + definition.lines.length + 2 * this.#bands.length }, () => []);
    this.source = this.#place.dataset.source = definition.source;
    this.#box = row("div", [this.#heading(), this.#place], "plot");
    parent.append(this.#box);
  }

  add(tMs, row) {
    this.#columns[0].push(tMs / 1000);
    this.#definition.lines.forEach((line, i) => {
      const value = line.of(row);
      // A logarithm knows no zero.
      this.#columns[i + 1].push(this.#definition.log && value <= 0 ? null : value ?? null);
    });
    const first = 1 + this.#definition.lines.length;
    this.#bands.flatMap((line) => bandEdges(line, row)).forEach((edge, i) => this.#columns[first + i].push(edge));
    if (this.#columns[0].length > MAX_POINTS) this.#columns.forEach((column) => column.shift());
  }

  clear() {
    this.#columns.forEach((column) => (column.length = 0));
    this.forgetChart();
  }

  get #height() {
    return window.innerWidth < WIDE_PX ? HEIGHT_PX : WIDE_HEIGHT_PX;
  }

  /** Draw from `fromS` to `toS`; a canvas that has no place yet is left alone. */
  draw(fromS, toS) {
    const width = this.#box.clientWidth;
    if (!width) return;
    this.#chart ??= this.#make(width);
    const height = this.#height;
    if (this.#chart.width !== width || this.#chart.height !== height) this.#chart.setSize({ width, height });
    this.#chart.batch(() => {
      this.#chart.setData(this.#columns, false);
      this.#chart.setScale("x", { min: fromS, max: toS });
    });
  }

  /** Make it anew at the next drawing, in the colours of another theme. */
  forgetChart() {
    this.#chart?.destroy();
    this.#chart = null;
    this.#box.firstChild.replaceWith(this.#heading());
  }

  get lastS() {
    return this.#columns[0].at(-1) ?? 0;
  }

  get firstS() {
    return this.#columns[0][0] ?? 0;
  }

  #heading() {
    const heading = row("h3", [this.#definition.title, ageLabel(this.#definition.source)]);
    this.#readouts = [];
    for (const line of this.#definition.lines) {
      const mark = document.createElement("i");
      mark.style.borderColor = style(line.colour);
      if (line.dash) mark.dataset.dash = "";
      const unit = this.#definition.units[line.side];
      const readout = document.createElement("b");
      this.#readouts.push(readout);
      heading.append(row("span", [mark, unit ? `${line.label}, ${unit}` : line.label, readout], "key"));
      if (line.spread) heading.append(row("span", [bandMark(line), "± standard deviation"], "key"));
    }
    return heading;
  }

  #make(width) {
    const { lines, units, log, zero } = this.#definition;
    const scales = { x: { time: true, auto: false } };
    units.forEach((_, side) => {
      scales[`y${side}`] = log ? { distr: 3 } : { range: (_u, low, high) => padded(low, high, zero) };
    });
    const isPointer = (type) => type === "mousemove" || type === "mouseleave";
    const options = {
      width, height: this.#height, scales,
      legend: { show: false },
      cursor: {
        sync: { key: "time", scales: ["x", null], filters: { pub: isPointer } },
        drag: { x: true, y: false, setScale: false }, y: false,
        bind: { dblclick: () => () => this.#events.onUnzoom() },
      },
      axes: [timeAxis(), valueAxis(0), units.length > 1 ? valueAxis(1) : EMPTY_AXIS],
      series: [{}, ...lines.map((line) => ({
        label: line.label, scale: `y${line.side}`, stroke: style(line.colour), width: 2,
        dash: line.dash ? [6, 4] : undefined, points: { show: false }, spanGaps: false,
      })), ...this.#bands.flatMap((line) => [edge(line), edge(line)])],
      bands: this.#bands.map((line, i) => ({
        series: [1 + lines.length + 2 * i, 2 + lines.length + 2 * i], fill: translucent(style(line.colour)),
      })),
      hooks: {
        draw: [(chart) => drawMarkers(chart, this.#events.markers())],
        setCursor: [(chart) => this.#read(chart)],
        setSelect: [(chart) => this.#select(chart)],
      },
    };
    return new globalThis.uPlot(options, this.#columns, this.#place);
  }

  /** Show the values under the cursor. */
  #read(chart) {
    const { idx, left } = chart.cursor;
    const isOver = idx !== null && idx !== undefined && left >= 0;
    this.#readouts.forEach((readout, i) => {
      const value = isOver ? this.#columns[i + 1][idx] : null;
      say(readout, isOver ? (Number.isFinite(value) ? ` ${shortNumber(value)}` : " –") : "");
    });
    this.#events.onHover(isOver ? this.#columns[0][idx] : null);
  }

  /** Zoom to what was drawn over. */
  #select(chart) {
    const { left, width } = chart.select;
    if (width < 5) return;
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.#events.onZoom(chart.posToVal(left, "x"), chart.posToVal(left + width, "x"));
  }
}

/** Lines where the gate entered a state, with its name where there is room. */
function drawMarkers(chart, markers) {
  const { ctx: context, bbox } = chart;
  const scale = globalThis.uPlot.pxRatio;
  context.save();
  context.font = `600 ${10 * scale}px system-ui, sans-serif`;
  context.textBaseline = "top";
  let end = bbox.left + bbox.width;
  for (const { t_ms: tMs, to } of markers.toReversed()) {
    const x = chart.valToPos(tMs / 1000, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    const colour = style(TONES[to] ?? "--calm");
    context.strokeStyle = colour;
    context.lineWidth = scale;
    context.setLineDash([3 * scale, 3 * scale]);
    context.beginPath();
    context.moveTo(x, bbox.top);
    context.lineTo(x, bbox.top + bbox.height);
    context.stroke();
    const width = context.measureText(to).width + 6 * scale;
    if (x + width > end) continue;
    end = x;
    context.fillStyle = style("--panel");
    context.fillRect(x + scale, bbox.top, width, 12 * scale);
    context.fillStyle = colour;
    context.fillText(to, x + 4 * scale, bbox.top + scale);
  }
  context.restore();
}

/** Upper and lower edge of a line's band; null where the value or its spread is not known. */
function bandEdges(line, row) {
  const [value, spread] = [line.of(row), line.spread(row)];
  if (!Number.isFinite(value) || !Number.isFinite(spread)) return [null, null];
  return [value + spread, Math.max(value - spread, 0)];
}

/** Series of a band's edge, which is not drawn itself. */
const edge = (line) => ({ scale: `y${line.side}`, width: 0, points: { show: false }, spanGaps: false });

function bandMark(line) {
  const mark = document.createElement("i");
  mark.dataset.band = "";
  mark.style.background = translucent(style(line.colour));
  return mark;
}

/** @param colour `#rrggbb` */
const translucent = (colour) => colour + Math.round(BAND_OPACITY * 255).toString(16).padStart(2, "0");

/** Range with some air; a flat line gets a range too. */
function padded(low, high, startsAtZero) {
  if (low === null || high === null || low === undefined) return [0, 1];
  const air = Math.max((high - low) * 0.1, Math.abs(high) * 0.02, 0.01);
  return [startsAtZero ? 0 : low < 0 ? low - air : Math.max(low - air, 0), high + air];
}

/** Keeps the right edges of all plots in one line. */
const EMPTY_AXIS = {
  scale: "y0", side: 1, size: 44, gap: 0, ticks: { show: false }, grid: { show: false },
  values: (_u, splits) => splits.map(() => ""),
};

const FONT = "11px system-ui, sans-serif";

function timeAxis() {
  return {
    stroke: style("--muted"), font: FONT, size: 22, gap: 3, space: 70,
    grid: { stroke: style("--grid"), width: 1 }, ticks: { show: false },
    values: [
      [1, "{HH}:{mm}:{ss}", null, null, null, null, null, null, 0],
      [60, "{HH}:{mm}", null, null, null, null, null, null, 0],
    ],
  };
}

function valueAxis(side) {
  return {
    scale: `y${side}`, side: side === 0 ? 3 : 1, stroke: style("--muted"), font: FONT,
    size: 44, gap: 4, ticks: { show: false }, space: 17,
    grid: side === 0 ? { stroke: style("--grid"), width: 1 } : { show: false },
    values: (_u, splits) => splits.map((v) => (v === null ? "" : shortNumber(v))),
  };
}

function shortNumber(value) {
  if (Math.abs(value) >= 10000) return value.toExponential(0).replace("+", "");
  return String(Number(value.toPrecision(3)));
}
