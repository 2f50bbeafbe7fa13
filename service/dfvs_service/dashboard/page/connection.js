// One WebSocket to the server: greets, reconnects by itself, and keeps the clocks together.

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 2000;
const PING_PERIOD_MS = 2000;
const PATIENCE_MS = 6000;
const DENIED = 4401;
/** Difference between two measurements of the server's clock that no round trip explains, ms. */
const SET_MS = 50;

export const IMAGE = Object.freeze({ VIEW: 1, GOAL: 2, FLOW: 3 });
const PICTURE_HEADER_BYTES = 9;

/** Wall clock of the server, as seen from here: the quickest of the recent pings counts. */
class ServerClock {
  #samples = [];

  add(sentMs, serverMs, nowMs) {
    const roundTrip = nowMs - sentMs;
    const offset = serverMs - (sentMs + roundTrip / 2);
    // The server's clock was set, or this machine slept: earlier pings count no longer.
    const isSet = (s) => Math.abs(s.offset - offset) > (s.roundTrip + roundTrip) / 2 + SET_MS;
    if (this.#samples.some(isSet)) this.#samples = [];
    this.#samples.push({ roundTrip, offset });
    if (this.#samples.length > 15) this.#samples.shift();
  }

  /** Whether the server's time is known; ages are not, before. */
  get isKnown() {
    return this.#samples.length > 0;
  }

  get roundTripMs() {
    return this.#samples.length ? this.#samples.at(-1).roundTrip : null;
  }

  /** Server's time in ms since 1970 at this moment. */
  now() {
    const here = performance.timeOrigin + performance.now();
    if (!this.#samples.length) return here;
    const best = this.#samples.reduce((a, b) => (b.roundTrip < a.roundTrip ? b : a));
    return here + best.offset;
  }
}

export class Connection extends EventTarget {
  #socket = null;
  #waitMs = FIRST_WAIT_MS;
  #lastReceivedMs = 0;
  #token;
  clock = new ServerClock();
  isOpen = false;

  /** @param {string} token empty, or the secret of a viewer or operator */
  constructor(token) {
    super();
    this.#token = token;
    setInterval(() => this.#tend(), PING_PERIOD_MS);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.#greet(socket);
    socket.onmessage = (event) => this.#take(event.data);
    socket.onclose = (event) => this.#lose(socket, event);
    this.#socket = socket;
  }

  /** Sign in with another token; the connection is opened anew. */
  signIn(token) {
    this.#token = token;
    this.#waitMs = 0;
    if (this.#socket) this.#socket.close(1000);
    if (!this.#socket) this.open();
  }

  /** @returns {boolean} whether there was a connection to send it on */
  send(message) {
    return this.#transmit(JSON.stringify(message));
  }

  /**
   * Send a goal image: length of a JSON header (uint32), the header, the image's bytes.
   * @returns {boolean} whether there was a connection to send it on
   */
  sendGoal(header, image) {
    const headerBytes = new TextEncoder().encode(JSON.stringify({ type: "command", command: "goal", ...header }));
    const length = new Uint8Array(4);
    new DataView(length.buffer).setUint32(0, headerBytes.length, true);
    return this.#transmit(new Blob([length, headerBytes, image]));
  }

  #transmit(data) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(data);
    return true;
  }

  #greet(socket) {
    this.#lastReceivedMs = performance.now();
    socket.send(JSON.stringify({ type: "hello", token: this.#token }));
  }

  #take(data) {
    this.#lastReceivedMs = performance.now();
    if (typeof data !== "string") {
      this.#takePicture(data);
      return;
    }
    const update = JSON.parse(data);
    if (update.welcome) this.#welcomed(update.welcome);
    if (update.pong) {
      this.clock.add(update.pong.t, update.pong.server_ms, performance.timeOrigin + performance.now());
    }
    this.dispatchEvent(new CustomEvent("update", { detail: update }));
  }

  #takePicture(buffer) {
    const header = new DataView(buffer);
    const kind = header.getUint8(0);
    if (kind === IMAGE.VIEW) this.send({ type: "seen" });
    const image = {
      kind,
      captureMs: header.getFloat64(1, true),
      data: new Uint8Array(buffer, PICTURE_HEADER_BYTES),
    };
    this.dispatchEvent(new CustomEvent("image", { detail: image }));
  }

  #welcomed(welcome) {
    this.isOpen = true;
    this.#waitMs = FIRST_WAIT_MS;
    this.#ping();
    this.dispatchEvent(new CustomEvent("welcome", { detail: welcome }));
  }

  #lose(socket, event) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    this.isOpen = false;
    this.dispatchEvent(new CustomEvent("lost", { detail: { reason: event.reason } }));
    if (event.code === DENIED) {
      this.dispatchEvent(new CustomEvent("denied", { detail: { reason: event.reason } }));
      return;
    }
    const jitter = 0.75 + Math.random() / 2;
    setTimeout(() => this.#socket ?? this.open(), this.#waitMs * jitter);
    this.#waitMs = Math.min(Math.max(this.#waitMs * 1.6, FIRST_WAIT_MS), LONGEST_WAIT_MS);
  }

  /** Ping; a connection that has been silent for long is dead, whatever TCP says. */
  #tend() {
    if (!this.#socket) return;
    if (this.isOpen && performance.now() - this.#lastReceivedMs > PATIENCE_MS) {
      const silent = this.#socket;
      this.#lose(silent, { code: 0, reason: "silent" });
      silent.onmessage = null;
      silent.close();
      return;
    }
    this.#ping();
  }

  #ping() {
    if (this.isOpen) this.send({ type: "ping", t: performance.timeOrigin + performance.now() });
  }
}
