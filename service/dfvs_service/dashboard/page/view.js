// Goal and live view on one canvas: beside each other, under a slider, blended, or subtracted.

import { IMAGE } from "./connection.js";
import { decodeFlow, drawConfidence, drawFlow } from "./flow.js";

const GAP_PX = 6;
const RECENT = 240;
/** A flow of another frame than this one would mislead, ms between captures. */
const FLOW_SLACK_MS = 500;

export class View {
  #canvas;
  #context;
  #bitmaps = { [IMAGE.VIEW]: null, [IMAGE.GOAL]: null };
  #decoding = new Set();
  #waiting = new Map();
  #flow = null;
  #sheet = new OffscreenCanvas(1, 1);
  #sheetKey = "";
  #sheetFlow = null;
  #isDrawingDue = false;
  #pendingMs = null;
  #delays = [];
  #isFirst = true;
  /** How many times everything was forgotten: an image from before is not shown. */
  #epoch = 0;
  #drawnAt = [];
  #now;
  /** Live image that is shown, `{captureMs, data, width}`: capture by the server's clock in ms, JPEG
   * bytes, px; null before one. */
  shown = null;
  /** Time of capture of the newest flow's frame, null before one. */
  flowMs = null;
  mode = "side";
  mix = 0.5;
  showsFlow = true;
  showsConfidence = false;
  minConfidence = 0.3;
  frames = 0;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => number} now server's wall clock, ms
   */
  constructor(canvas, now) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
    this.#now = now;
    new ResizeObserver(() => this.redraw()).observe(canvas.parentElement);
    this.#letDrag();
  }

  /** Which images and flow are here to be shown, frames a second and delay from capture to screen
   * over the last seconds. */
  get stats() {
    const since = performance.now() - 3000;
    const drawn = this.#drawnAt.filter((t) => t > since).length;
    const delays = [...this.#delays].sort((a, b) => a - b);
    const at = (share) => (delays.length ? delays[Math.floor(share * (delays.length - 1))] : null);
    const has = { view: !!this.#bitmaps[IMAGE.VIEW], goal: !!this.#bitmaps[IMAGE.GOAL], flow: !!this.#flow };
    const [p50Ms, p99Ms] = drawn ? [at(0.5), at(0.99)] : [null, null];
    return { has, frames: this.frames, fps: drawn / 3, p50Ms, p99Ms };
  }

  /** Forget everything: another vehicle is watched. */
  clear() {
    this.#bitmaps = { [IMAGE.VIEW]: null, [IMAGE.GOAL]: null };
    this.shown = null;
    this.#flow = null;
    this.flowMs = null;
    this.#delays = [];
    this.#drawnAt = [];
    this.#isFirst = true;
    this.#epoch += 1;
    this.#waiting.clear();
    this.redraw();
  }

  /** Take an image message; while one is being decoded only the newest of its kind waits. */
  async take(image) {
    if (image.kind === IMAGE.FLOW) {
      this.#flow = decodeFlow(image.data);
      this.flowMs = this.#flow && image.captureMs;
      // The next frame shows it; without one it is as old as the image.
      return;
    }
    if (this.#decoding.has(image.kind)) {
      this.#waiting.set(image.kind, image);
      return;
    }
    this.#decoding.add(image.kind);
    const epoch = this.#epoch;
    try {
      const bitmap = await createImageBitmap(new Blob([image.data], { type: "image/jpeg" }));
      if (epoch === this.#epoch) this.#show(image, bitmap);
      else bitmap.close();
    } catch {
      // A damaged JPEG is left out; the next one comes soon.
    } finally {
      this.#decoding.delete(image.kind);
    }
    const next = this.#waiting.get(image.kind);
    this.#waiting.delete(image.kind);
    if (next) await this.take(next);
  }

  #show(image, bitmap) {
    this.#bitmaps[image.kind]?.close();
    this.#bitmaps[image.kind] = bitmap;
    if (image.kind === IMAGE.VIEW) {
      this.shown = { captureMs: image.captureMs, data: image.data, width: bitmap.width };
    }
    // The first one may be of long ago: it says nothing of delays.
    const isTimed = image.kind === IMAGE.VIEW && !this.#isFirst;
    if (image.kind === IMAGE.VIEW) this.#isFirst = false;
    this.redraw(isTimed ? image.captureMs : null);
  }

  /** Draw at the next animation frame; with a capture time, count it when it is on the screen. */
  redraw(captureMs = null) {
    if (captureMs !== null) this.#pendingMs = captureMs;
    if (this.#isDrawingDue) return;
    this.#isDrawingDue = true;
    requestAnimationFrame(() => {
      this.#isDrawingDue = false;
      this.#draw();
      if (this.#pendingMs != null) this.#count(this.#pendingMs);
      this.#pendingMs = null;
    });
  }

  #count(captureMs) {
    this.frames += 1;
    this.#drawnAt.push(performance.now());
    if (this.#drawnAt.length > RECENT) this.#drawnAt.shift();
    // What was drawn now is on the screen when the next animation frame begins.
    requestAnimationFrame(() => {
      this.#delays.push(this.#now() - captureMs);
      if (this.#delays.length > RECENT) this.#delays.shift();
    });
  }

  #draw() {
    const live = this.#bitmaps[IMAGE.VIEW];
    const goal = this.#bitmaps[IMAGE.GOAL];
    const size = live ?? goal;
    const areas = this.#layOut(size ? size.height / size.width : 0.75);
    const context = this.#context;
    context.fillStyle = "#05080b";
    context.fillRect(0, 0, this.#canvas.width, this.#canvas.height);
    if (this.mode === "side") {
      this.#paint(goal, areas.goal);
      this.#paint(live, areas.live);
      this.#overlay(areas.live, live);
      this.#label("Goal", areas.goal);
      this.#label("Live", areas.live);
      return;
    }
    this.#paint(live, areas.live);
    this.#paintOver(goal, areas.live);
    this.#overlay(areas.live, live);
    if (this.mode === "slider") this.#handle(areas.live);
  }

  /** Size the canvas for its place on the page, and say where the images go. */
  #layOut(aspect) {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(Math.round(this.#canvas.parentElement.clientWidth * scale), 2);
    const isSide = this.mode === "side";
    const gap = Math.round(GAP_PX * scale);
    const most = Math.round((window.innerHeight * 0.72 * scale) / aspect);
    const w = Math.min(isSide ? Math.floor((width - gap) / 2) : width, most);
    const h = Math.round(w * aspect);
    if (this.#canvas.width !== width) this.#canvas.width = width;
    if (this.#canvas.height !== h) this.#canvas.height = h;
    const left = Math.round((width - (isSide ? 2 * w + gap : w)) / 2);
    const first = { x: left, y: 0, w, h };
    return isSide ? { goal: first, live: { ...first, x: left + w + gap } } : { live: first };
  }

  #paint(bitmap, area) {
    if (bitmap) this.#context.drawImage(bitmap, area.x, area.y, area.w, area.h);
  }

  /** Paint the goal over the live view: left of the slider, translucent, or subtracted. */
  #paintOver(goal, area) {
    const context = this.#context;
    context.save();
    if (this.mode === "slider") {
      context.beginPath();
      context.rect(area.x, area.y, area.w * this.mix, area.h);
      context.clip();
    }
    if (this.mode === "blend") context.globalAlpha = 1 - this.mix;
    if (this.mode === "difference") context.globalCompositeOperation = "difference";
    this.#paint(goal, area);
    context.restore();
  }

  #overlay(area, live) {
    if (!this.#flow || !live || !(this.showsFlow || this.showsConfidence)) return;
    if (Math.abs(this.flowMs - this.shown.captureMs) > FLOW_SLACK_MS) return;
    const sheet = this.#drawnOverlay(area.w, area.h, area.w / live.width);
    // Under the slider the live part alone has a flow.
    const hidden = this.mode === "slider" ? Math.round(area.w * this.mix) : 0;
    const shown = area.w - hidden;
    if (shown < 1) return;
    this.#context.drawImage(sheet, hidden, 0, shown, area.h, area.x + hidden, area.y, shown, area.h);
  }

  /** Overlay on a sheet of its own: drawn when a flow comes, not with every frame. */
  #drawnOverlay(w, h, scale) {
    const key = [w, h, this.showsFlow, this.showsConfidence, this.minConfidence].join();
    if (this.#sheetKey === key && this.#sheetFlow === this.#flow) return this.#sheet;
    this.#sheetKey = key;
    this.#sheetFlow = this.#flow;
    this.#sheet.width = w;
    this.#sheet.height = h;
    const context = this.#sheet.getContext("2d");
    const place = { scale, minConfidence: this.minConfidence };
    if (this.showsConfidence) drawConfidence(context, this.#flow, place);
    if (this.showsFlow) drawFlow(context, this.#flow, place);
    return this.#sheet;
  }

  #label(text, area) {
    const size = Math.max(Math.round(area.w / 28), 12);
    const context = this.#context;
    context.font = `700 ${size}px system-ui, sans-serif`;
    const width = context.measureText(text).width + size;
    context.fillStyle = "rgba(0, 0, 0, .65)";
    context.fillRect(area.x, area.y, width, size * 1.7);
    context.fillStyle = "#fff";
    context.textBaseline = "middle";
    context.fillText(text, area.x + size / 2, area.y + size * 0.87);
  }

  #handle(area) {
    const x = area.x + area.w * this.mix;
    const context = this.#context;
    for (const [style, width] of [["#000", 6], ["#fff", 3]]) {
      context.strokeStyle = context.fillStyle = style;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      context.beginPath();
      context.arc(x, area.y + area.h / 2, 9 + width, 0, 7);
      context.fill();
    }
  }

  #letDrag() {
    const drag = (event) => {
      if (this.mode !== "slider" && this.mode !== "blend") return;
      const box = this.#canvas.getBoundingClientRect();
      const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
      this.#canvas.dispatchEvent(new CustomEvent("mix", { detail: share }));
    };
    this.#canvas.addEventListener("pointerdown", (event) => {
      this.#canvas.setPointerCapture(event.pointerId);
      drag(event);
    });
    this.#canvas.addEventListener("pointermove", (event) => event.buttons && drag(event));
  }
}
