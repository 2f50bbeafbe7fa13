// The flown path in three dimensions: an orthographic projection that is turned by hand.

import { style } from "./words.js";

const MAX_POINTS = 6000;
const NEAREST_M = 0.5;
const PERIOD_MS = 200;
const HOME = Object.freeze({ turn: -0.6, tilt: 0.55, zoom: 1 });

export class PathView {
  #canvas;
  #points = [];
  #yaw = 0;
  #goal = null;
  #goalAge = "";
  #camera = { ...HOME };
  #isDue = false;
  #isTurning = false;

  constructor(canvas) {
    this.#canvas = canvas;
    new ResizeObserver(() => this.redraw()).observe(canvas.parentElement);
    this.#listen();
  }

  /** @param row position NED in m and heading in rad */
  add(row) {
    this.#points.push([row.north_m, row.east_m, row.down_m]);
    this.#yaw = row.yaw_rad;
    if (this.#points.length > MAX_POINTS) this.#points.shift();
    this.redraw();
  }

  /** Where the goal is thought to be: what is left of the way, seen from the newest position. */
  aim(motion) {
    const here = this.#points.at(-1);
    if (!here || motion.length !== 4 || motion.some((v) => v === null)) return;
    const [cos, sin] = [Math.cos(this.#yaw), Math.sin(this.#yaw)];
    const [forward, right, down] = motion;
    this.#goal = [
      here[0] + cos * forward - sin * right, here[1] + sin * forward + cos * right, here[2] + down,
    ];
  }

  /** Say how old the estimate of the goal is, empty while it is new. */
  ageGoal(text) {
    if (text === this.#goalAge) return;
    this.#goalAge = text;
    this.redraw();
  }

  clear() {
    this.#points = [];
    this.#goal = null;
    this.redraw();
  }

  get lengthM() {
    let sum = 0;
    for (let i = 1; i < this.#points.length; i++) sum += distance(this.#points[i], this.#points[i - 1]);
    return sum;
  }

  get straightM() {
    return this.#points.length ? distance(this.#points[0], this.#points.at(-1)) : 0;
  }

  redraw() {
    if (this.#isDue) return;
    this.#isDue = true;
    setTimeout(() => requestAnimationFrame(() => {
      this.#isDue = false;
      this.#draw();
    }), this.#isTurning ? 0 : PERIOD_MS);
  }

  #draw() {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(this.#canvas.clientWidth * scale);
    const height = Math.round(width * 0.62);
    if (!width) return;
    if (this.#canvas.width !== width) this.#canvas.width = width;
    if (this.#canvas.height !== height) this.#canvas.height = height;
    const context = this.#canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    if (!this.#points.length) return;
    const scene = this.#frame(width, height);
    this.#drawFloor(context, scene, scale);
    this.#drawPath(context, scene, scale);
    this.#drawGoal(context, scene, scale);
    this.#drawVehicle(context, scene, scale);
  }

  /** Box of everything shown, and the projection that fits it. */
  #frame(width, height) {
    const all = this.#goal ? [...this.#points, this.#goal] : this.#points;
    const low = [0, 1, 2].map((k) => Math.min(...all.map((p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...all.map((p) => p[k])));
    const centre = low.map((v, k) => (v + high[k]) / 2);
    const radius = Math.max(Math.hypot(...low.map((v, k) => high[k] - v)) / 2, NEAREST_M);
    const { turn, tilt, zoom } = this.#camera;
    const k = (Math.min(width, height) * 0.42 * zoom) / radius;
    const [ct, st, cl, sl] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
    const project = ([n, e, d]) => {
      const [x, y, z] = [n - centre[0], e - centre[1], d - centre[2]];
      const [right, ahead] = [ct * y - st * x, ct * x + st * y];
      return [width / 2 + k * right, height / 2 + k * (cl * z - sl * ahead)];
    };
    return { project, centre, radius, floor: high[2] + 0.15 * radius };
  }

  #drawFloor(context, { project, centre, radius, floor }, scale) {
    const step = niceStep(radius);
    const [n0, e0] = [centre[0], centre[1]].map((v) => Math.round(v / step) * step);
    context.strokeStyle = style("--line");
    context.lineWidth = scale;
    for (let i = -3; i <= 3; i++) {
      line(context, project([n0 + i * step, e0 - 3 * step, floor]), project([n0 + i * step, e0 + 3 * step, floor]));
      line(context, project([n0 - 3 * step, e0 + i * step, floor]), project([n0 + 3 * step, e0 + i * step, floor]));
    }
    context.fillStyle = style("--muted");
    context.font = `${12 * scale}px system-ui, sans-serif`;
    this.#writeAxis(context, "N", (r) => project([n0 + r * step, e0, floor]), scale);
    this.#writeAxis(context, "E", (r) => project([n0, e0 + r * step, floor]), scale);
    context.textAlign = "left";
    context.fillText(`grid ${step} m`, 8 * scale, 16 * scale);
  }

  /** An axis' letter as far out on the floor's grid as the canvas shows it whole. */
  #writeAxis(context, letter, at, scale) {
    const { width, height } = this.#canvas;
    const isInside = ([x, y]) => x > 8 * scale && x < width - 8 * scale && y > 28 * scale && y < height - 8 * scale;
    const place = [3.3, 2.8, 2.3, 1.8, 1.3, 0.8].map(at).find(isInside);
    context.textAlign = "center";
    if (place) context.fillText(letter, ...place);
  }

  #drawPath(context, { project, floor }, scale) {
    context.strokeStyle = style("--line");
    context.lineWidth = 2 * scale;
    trace(context, this.#points.map(([n, e]) => project([n, e, floor])));
    context.stroke();
    context.strokeStyle = style("--a");
    context.lineWidth = 3 * scale;
    context.lineJoin = "round";
    trace(context, this.#points.map(project));
    context.stroke();
    context.fillStyle = style("--muted");
    context.beginPath();
    context.arc(...project(this.#points[0]), 4 * scale, 0, 7);
    context.fill();
  }

  #drawGoal(context, { project, floor }, scale) {
    if (!this.#goal) return;
    const [x, y] = project(this.#goal);
    context.strokeStyle = style("--line");
    context.lineWidth = scale;
    line(context, [x, y], project([this.#goal[0], this.#goal[1], floor]));
    context.strokeStyle = style(this.#goalAge ? "--muted" : "--b");
    context.lineWidth = 3 * scale;
    const r = 7 * scale;
    line(context, [x - r, y], [x + r, y]);
    line(context, [x, y - r], [x, y + r]);
    const text = `goal (estimate${this.#goalAge && `, ${this.#goalAge}`})`;
    const half = context.measureText(text).width / 2 + 4 * scale;
    const middle = Math.min(Math.max(x, half), this.#canvas.width - half);
    context.fillStyle = style("--ink");
    context.textAlign = "center";
    context.fillText(text, middle, y > 50 * scale ? y - 14 * scale : y + 24 * scale);
  }

  #drawVehicle(context, { project, radius, floor }, scale) {
    const here = this.#points.at(-1);
    const size = radius * 0.16;
    const at = (angle, r) => project([
      here[0] + r * Math.cos(this.#yaw + angle), here[1] + r * Math.sin(this.#yaw + angle), here[2],
    ]);
    context.strokeStyle = style("--muted");
    context.lineWidth = scale;
    line(context, project(here), project([here[0], here[1], floor]));
    context.fillStyle = style("--a");
    context.strokeStyle = style("--panel");
    context.lineWidth = 1.5 * scale;
    trace(context, [at(0, 1.5 * size), at(2.5, size), at(Math.PI, 0.4 * size), at(-2.5, size)]);
    context.closePath();
    context.fill();
    context.stroke();
  }

  #listen() {
    const turn = (dx, dy) => {
      this.#camera.turn += dx;
      this.#camera.tilt = Math.min(Math.max(this.#camera.tilt + dy, 0), Math.PI / 2);
      this.redraw();
    };
    const zoom = (factor) => {
      this.#camera.zoom = Math.min(Math.max(this.#camera.zoom * factor, 0.3), 8);
      this.redraw();
    };
    const keys = {
      ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0),
      ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
      "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2),
      0: () => Object.assign(this.#camera, HOME) && this.redraw(),
    };
    this.#canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
      keys[event.key]();
      event.preventDefault();
      event.stopPropagation();
    });
    this.#canvas.addEventListener("pointerdown", (event) => {
      this.#canvas.setPointerCapture(event.pointerId);
      this.#isTurning = true;
    });
    this.#canvas.addEventListener("lostpointercapture", () => (this.#isTurning = false));
    this.#canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(event.movementX * 0.008, event.movementY * 0.008);
    });
  }
}

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

function niceStep(radius) {
  const rough = radius / 2;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((s) => s * power >= rough) * power;
  return Number(step.toPrecision(1));
}

function line(context, a, b) {
  trace(context, [a, b]);
  context.stroke();
}

/** Begin a path through points, to be stroked or filled. */
function trace(context, points) {
  context.beginPath();
  points.forEach((p, i) => context[i ? "lineTo" : "moveTo"](...p));
}
