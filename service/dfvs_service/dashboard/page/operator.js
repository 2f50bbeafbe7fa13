// Signing in and sending commands. The server decides what is allowed; the page only hides the rest.

import { byId, DEGREES, fixed, timeOfDay } from "./words.js";

const KEPT_TOKEN = "dfvs-token";
const GOAL_CHANGEABLE = new Set(["READY", "HOLD", "DONE"]);
const ENGAGEABLE = new Set(["READY", "HOLD", "DONE", "ABORT", "RELEASED"]);

export const keptToken = () => sessionStorage.getItem(KEPT_TOKEN) ?? "";

export class Operator {
  #connection;
  #vehicle = "";
  #state = null;
  #isSignedIn = false;
  /** Whether a token was refused, and the page waits for what the user does. */
  #isRefused = false;
  /** Vehicle and name of the commands that were sent on this connection and not answered yet. */
  #unanswered = [];
  #onConfirmed = () => {};
  #maxGoalBytes = Infinity;
  #currentView;
  /** Width of the camera's frames, px; null where the settings leave it open. */
  cameraWidth = null;

  /**
   * @param {Connection} connection
   * @param currentView `() => {captureMs, data, width, attitude} | null`: image that is shown, and
   *   roll and pitch at its capture, null where they are not known
   */
  constructor(connection, currentView) {
    this.#connection = connection;
    this.#currentView = currentView;
    byId("sign").addEventListener("click", () => (this.#isSignedIn ? this.#signOut() : this.ask()));
    byId("hold").addEventListener("click", () => this.command("hold"));
    byId("abort").addEventListener("click", () => this.command("abort"));
    byId("engage").addEventListener("click", () => this.#confirmEngage());
    byId("goal").addEventListener("click", () => byId("goal-files").click());
    byId("take-view").addEventListener("click", () => this.#confirmView());
    byId("goal-files").addEventListener("change", () => this.#confirmGoal([...byId("goal-files").files]));
    byId("sign-dialog").addEventListener("close", () => this.#signIn());
    // No submit button: that of signing in is the one that the Enter key means.
    byId("sign-dialog").querySelector("[data-close]").addEventListener("click", () => byId("sign-dialog").close());
    byId("confirm-dialog").addEventListener("close", () => {
      if (byId("confirm-dialog").returnValue === "ok") this.#onConfirmed();
    });
  }

  welcome({ role, can_command: canCommand, accepts_operators: acceptsOperators, needs_token: needsToken, max_goal_bytes: maxGoalBytes }) {
    this.#maxGoalBytes = maxGoalBytes;
    this.#isSignedIn = keptToken() !== "" && (role === "operator" || needsToken);
    byId("operator").hidden = !canCommand;
    byId("sign").hidden = !this.#isSignedIn && !acceptsOperators;
    byId("sign").textContent = this.#isSignedIn ? "Sign out" : "Sign in";
    if (role === "operator" && !canCommand) this.#answer(false, "signed in, but the server has no key for commands");
  }

  /** The server let nobody in with this token. */
  denied(reason) {
    this.#isRefused = keptToken() !== "";
    sessionStorage.removeItem(KEPT_TOKEN);
    this.ask(reason);
  }

  ask(reason = "") {
    byId("sign-why").textContent = reason
      ? `The server says: ${reason}.` : "With the operator's token you can engage, hold and abort.";
    byId("token").value = "";
    byId("sign-dialog").returnValue = "";
    if (!byId("sign-dialog").open) byId("sign-dialog").showModal();
  }

  watch(vehicle) {
    if (vehicle !== this.#vehicle) this.#answer(null, "");
    this.#vehicle = vehicle;
  }

  /** @param old which sources are old, of `assess` */
  show(state, old) {
    this.#state = state;
    const isFresh = !old.state;
    const acceptsCommands = Boolean(state?.accepts_commands) && this.#connection.isOpen;
    byId("engage").disabled = !acceptsCommands || !isFresh || !ENGAGEABLE.has(state.state);
    byId("goal").disabled = !acceptsCommands || !isFresh || !GOAL_CHANGEABLE.has(state.state);
    byId("take-view").disabled = byId("goal").disabled || old.view || old.vehicle;
    // Stopping is offered even where the newest state is old: it can do no harm.
    byId("hold").disabled = byId("abort").disabled = !acceptsCommands;
    if (state && !state.accepts_commands && !byId("answer").textContent) {
      this.#answer(null, "this vehicle was started without a command key");
    }
  }

  command(name) {
    if (byId("operator").hidden || !this.#vehicle) return;
    const vehicle = this.#vehicle;
    this.#sent(vehicle, name, this.#connection.send({ type: "command", command: name, vehicle }));
  }

  answered(answers) {
    for (const { command, vehicle, accepted, text } of answers) {
      const at = this.#unanswered.indexOf(`${vehicle}: ${command}`);
      if (at >= 0) this.#unanswered.splice(at, 1);
      this.#answer(accepted, `${vehicle}: ${text}`);
    }
  }

  /** The connection is gone, and answers to what was sent on it with it. */
  lost() {
    const names = this.#unanswered.splice(0);
    if (names.length) this.#answer(false, `${names.join(", ")} not answered: connection lost`);
  }

  #confirmEngage() {
    const state = this.#state?.state ?? "unknown";
    this.#confirm("Engage?", `${this.#vehicle} is ${state}. It will fly to its goal by itself.`, null,
      () => this.command("engage"));
  }

  #confirmGoal(files) {
    const image = files.find((file) => !file.name.endsWith(".json"));
    const sidecar = files.find((file) => file.name.endsWith(".json"));
    byId("goal-files").value = "";
    if (!image) return;
    if (image.size > this.#maxGoalBytes) {
      const [size, limit] = [image.size, this.#maxGoalBytes].map((bytes) => `${fixed(bytes / 1e6, 1)} MB`);
      this.#answer(false, `not sent: ${image.name} has ${size}, a goal at most ${limit}; send it as JPEG`);
      return;
    }
    const vehicle = this.#vehicle;
    const taken = sidecar ? `taken as ${sidecar.name} says` : "taken level, by the camera that flies";
    this.#confirm("Change the goal?", `${image.name} for ${vehicle}, ${taken}.`, image, async () => {
      this.#sendGoal(vehicle, sidecar ? await sidecar.text() : "", await image.arrayBuffer());
    });
  }

  /** Ask whether the view of this moment shall be the goal; what is asked is what is sent. */
  #confirmView() {
    const view = this.#currentView();
    if (!view?.attitude) {
      this.#answer(false, "not sent: the attitude at the time of this image is not known");
      return;
    }
    if (this.cameraWidth && view.width !== this.cameraWidth) {
      this.#answer(false, `not sent: the page gets ${view.width} of the camera's ${this.cameraWidth} px; use dfvs-camera goal`);
      return;
    }
    const vehicle = this.#vehicle;
    const degrees = (rad) => `${fixed(rad * DEGREES, 1)}°`;
    const { roll_rad: roll, pitch_rad: pitch } = view.attitude;
    this.#confirm("Take this view as the goal?",
      `${vehicle}, view of ${timeOfDay(view.captureMs)}, at roll ${degrees(roll)} and pitch ${degrees(pitch)}.`,
      new Blob([view.data], { type: "image/jpeg" }),
      () => this.#sendGoal(vehicle, JSON.stringify(view.attitude), view.data));
  }

  #sendGoal(vehicle, sidecar, image) {
    this.#sent(vehicle, "goal", this.#connection.sendGoal({ vehicle, sidecar }, image));
  }

  #sent(vehicle, name, isSent) {
    const named = `${vehicle}: ${name}`;
    if (isSent) this.#unanswered.push(named);
    this.#answer(isSent ? null : false, isSent ? `${named} sent …` : `${named} NOT sent: no connection`);
  }

  #confirm(title, text, image, onConfirmed) {
    this.#onConfirmed = onConfirmed;
    byId("confirm-title").textContent = title;
    byId("confirm-text").textContent = text;
    const preview = byId("confirm-image");
    URL.revokeObjectURL(preview.src);
    preview.hidden = !image;
    if (image) preview.src = URL.createObjectURL(image);
    byId("confirm-dialog").returnValue = "";
    byId("confirm-dialog").showModal();
  }

  #signIn() {
    const token = byId("token").value.trim();
    byId("token").value = "";
    const isGiven = byId("sign-dialog").returnValue === "ok" && token !== "";
    // Without another token the page goes on as one that may only look.
    if (!isGiven && !this.#isRefused) return;
    this.#isRefused = false;
    if (isGiven) sessionStorage.setItem(KEPT_TOKEN, token);
    this.#connection.signIn(isGiven ? token : "");
  }

  #signOut() {
    sessionStorage.removeItem(KEPT_TOKEN);
    this.#connection.signIn("");
  }

  #answer(accepted, text) {
    byId("answer").textContent = text;
    byId("answer").dataset.ok = accepted === null ? "" : accepted ? "yes" : "no";
  }
}
