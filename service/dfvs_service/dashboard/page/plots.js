// Time series with uPlot, drawn a few times a second and only while the page is looked at.

const MAX_POINTS = 3000;
const PERIOD_MS = 250;
const HEIGHT_PX = 108;
const LEAST_SPAN_S = 5;
const DEGREES = 180 / Math.PI;

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Opacity of a band of plus/minus one standard deviation. */
const BAND_OPACITY = 0.3;

/** Each line: label, colour variable, side of its axis; `of` takes it from a row, `spread` its
 * standard deviation. */
const SERVO_PLOTS = [
  {
    title: "Error", units: ["m", "°"],
    lines: [
      { label: "distance", colour: "--a", side: 0, of: (row) => row.error_m, spread: (row) => row.error_spread_m },
      { label: "angle", colour: "--b", side: 1, dash: true, of: (row) => scaled(row.error_rad, DEGREES) },
    ],
  },
  {
    title: "Depth", units: ["m"],
    lines: [{ label: "median of the scene", colour: "--c", side: 0, of: (row) => row.depth_m }],
  },
  {
    title: "Matching", units: ["%", "px"],
    lines: [
      { label: "inliers", colour: "--a", side: 0, of: (row) => scaled(row.inlier_share, 100) },
      { label: "overlap", colour: "--c", side: 0, dash: true, of: (row) => scaled(row.overlap, 100) },
      { label: "residual", colour: "--b", side: 1, of: (row) => row.residual_px },
    ],
  },
  {
    title: "Conditioning", units: [""], log: true,
    lines: [{ label: "condition number", colour: "--d", side: 0, of: (row) => row.condition }],
  },
  {
    title: "Latency", units: ["ms"], zero: true,
    lines: [{ label: "capture to result", colour: "--b", side: 0, of: (row) => row.delay_ms }],
  },
];
const PATH_PLOTS = [
  {
    title: "Velocity sent", units: ["m/s", "°/s"],
    lines: [
      { label: "forward", colour: "--a", side: 0, of: (row) => row.setpoint[0] },
      { label: "right", colour: "--b", side: 0, of: (row) => row.setpoint[1] },
      { label: "down", colour: "--c", side: 0, of: (row) => row.setpoint[2] },
      { label: "yaw", colour: "--d", side: 1, dash: true, of: (row) => scaled(row.setpoint[3], DEGREES) },
    ],
  },
];

const scaled = (value, factor) => (value === null || value === undefined ? null : value * factor);

/** Upper and lower edge of a line's band; null where the value or its spread is not known. */
function bandEdges(line, row) {
  const [value, spread] = [line.of(row), line.spread(row)];
  if (!Number.isFinite(value) || !Number.isFinite(spread)) return [null, null];
  return [value + spread, Math.max(value - spread, 0)];
}

/** One plot and its data, column by column: time, the lines, two edges of every band. */
class Plot {
  #definition;
  #bands;
  #columns;
  #chart = null;
  #box;

  constructor(definition, parent) {
    this.#definition = definition;
    this.#bands = definition.lines.filter((line) => line.spread);
    this.#columns = Array.from({ length: 1 + definition.lines.length + 2 * this.#bands.length }, () => []);
    this.#box = document.createElement("div");
    this.#box.className = "plot";
    this.#box.append(this.#heading());
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
  }

  /** Draw from `fromS` to `toS`; a canvas that has no place yet is left alone. */
  draw(fromS, toS) {
    const width = this.#box.clientWidth;
    if (!width) return;
    this.#chart ??= this.#make(width);
    if (this.#chart.width !== width) this.#chart.setSize({ width, height: HEIGHT_PX });
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
    const heading = document.createElement("h3");
    heading.append(this.#definition.title);
    for (const line of this.#definition.lines) {
      const mark = document.createElement("i");
      mark.style.borderColor = style(line.colour);
      if (line.dash) mark.dataset.dash = "";
      const unit = this.#definition.units[line.side];
      heading.append(key(mark, unit ? `${line.label}, ${unit}` : line.label));
      if (line.spread) heading.append(key(bandMark(line), "± standard deviation"));
    }
    return heading;
  }

  #make(width) {
    const { lines, units, log, zero } = this.#definition;
    const scales = { x: { time: true, auto: false } };
    units.forEach((_, side) => {
      scales[`y${side}`] = log ? { distr: 3 } : { range: (_u, low, high) => padded(low, high, zero) };
    });
    const options = {
      width, height: HEIGHT_PX, scales,
      legend: { show: false },
      cursor: { sync: { key: "time" }, drag: { x: false, y: false } },
      axes: [timeAxis(), valueAxis(0), units.length > 1 ? valueAxis(1) : EMPTY_AXIS],
      series: [{}, ...lines.map((line) => ({
        label: line.label, scale: `y${line.side}`, stroke: style(line.colour), width: 2,
        dash: line.dash ? [6, 4] : undefined, points: { show: false }, spanGaps: false,
      })), ...this.#bands.flatMap((line) => [edge(line), edge(line)])],
      bands: this.#bands.map((line, i) => ({
        series: [1 + lines.length + 2 * i, 2 + lines.length + 2 * i], fill: translucent(style(line.colour)),
      })),
    };
    return new globalThis.uPlot(options, this.#columns, this.#box);
  }
}

/** Series of a band's edge, which is not drawn itself. */
const edge = (line) => ({ scale: `y${line.side}`, width: 0, points: { show: false }, spanGaps: false });

function key(mark, text) {
  const made = document.createElement("span");
  made.className = "key";
  made.append(mark, text);
  return made;
}

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

const font = () => "11px system-ui, sans-serif";

function timeAxis() {
  return {
    stroke: style("--muted"), font: font(), size: 22, gap: 3, space: 70,
    grid: { stroke: style("--grid"), width: 1 }, ticks: { show: false },
    values: [[1, "{HH}:{mm}:{ss}", null, null, null, null, null, null, 0]].concat([
      [60, "{HH}:{mm}", null, null, null, null, null, null, 0],
    ]),
  };
}

function valueAxis(side) {
  return {
    scale: `y${side}`, side: side === 0 ? 3 : 1, stroke: style("--muted"), font: font(),
    size: 44, gap: 4, ticks: { show: false }, space: 17,
    grid: side === 0 ? { stroke: style("--grid"), width: 1 } : { show: false },
    values: (_u, splits) => splits.map((v) => (v === null ? "" : shortNumber(v))),
  };
}

function shortNumber(value) {
  if (Math.abs(value) >= 10000) return value.toExponential(0).replace("+", "");
  return String(Number(value.toPrecision(3)));
}

export class Plots {
  #servo;
  #path;
  #isDue = false;
  spanS = 30;

  /** @param {HTMLElement} parent takes the plots */
  constructor(parent) {
    const [error, ...others] = SERVO_PLOTS;
    const make = (definition) => new Plot(definition, parent);
    const first = make(error);
    this.#path = PATH_PLOTS.map(make);
    this.#servo = [first, ...others.map(make)];
    setInterval(() => this.#draw(), PERIOD_MS);
  }

  addServo(row) {
    this.#servo.forEach((plot) => plot.add(row.t_ms, row));
    this.#isDue = true;
  }

  addPath(row) {
    this.#path.forEach((plot) => plot.add(row.t_ms, row));
    this.#isDue = true;
  }

  clear() {
    this.#all.forEach((plot) => plot.clear());
    this.#isDue = true;
  }

  /** Take the colours of another theme. */
  restyle() {
    this.#all.forEach((plot) => plot.forgetChart());
    this.#isDue = true;
  }

  redraw() {
    this.#isDue = true;
  }

  get #all() {
    return [...this.#servo, ...this.#path];
  }

  #draw() {
    if (!this.#isDue || document.hidden) return;
    this.#isDue = false;
    const last = Math.max(...this.#all.map((plot) => plot.lastS));
    if (!last) return;
    const firsts = this.#all.map((plot) => plot.firstS).filter((t) => t > 0);
    const earliest = Math.min(...firsts, last - LEAST_SPAN_S);
    const first = this.spanS ? Math.max(last - this.spanS, earliest) : earliest;
    this.#all.forEach((plot) => plot.draw(first, last));
  }
}
