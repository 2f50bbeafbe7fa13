// Signing in and giving orders. The server decides what is allowed; the page only hides the rest.

import { byId, DEGREES, fixed, timeOfDay } from "./words.js";

const KEPT_TOKEN = "dfvs-token";
const GOAL_CHANGEABLE = new Set(["READY", "HOLD", "DONE"]);
const ENGAGEABLE = new Set(["READY", "DONE", "ABORT", "RELEASED"]);

export const keptToken = () => sessionStorage.getItem(KEPT_TOKEN) ?? "";

export class Operator {
  #connection;
  #vehicle = "";
  #state = null;
  #isSignedIn = false;
  #onConfirmed = () => {};
  #currentView;
  /** Width of the camera's frames, px; null where the settings leave it open. */
  cameraWidth = null;

  /**
   * @param {Connection} connection
   * @param currentView `() => {captureMs, data, width, attitude} | null`: picture that is shown, and
   *   roll and pitch at its capture, null where they are not known
   */
  constructor(connection, currentView) {
    this.#connection = connection;
    this.#currentView = currentView;
    byId("sign").addEventListener("click", () => (this.#isSignedIn ? this.#signOut() : this.ask()));
    byId("hold").addEventListener("click", () => this.order("hold"));
    byId("abort").addEventListener("click", () => this.order("abort"));
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

  welcome({ role, can_command: canOrder, accepts_operators: acceptsOperators, needs_token: needsToken }) {
    this.#isSignedIn = keptToken() !== "" && (role === "operator" || needsToken);
    byId("operator").hidden = !canOrder;
    byId("sign").hidden = !this.#isSignedIn && !acceptsOperators;
    byId("sign").textContent = this.#isSignedIn ? "Sign out" : "Sign in";
    if (role === "operator" && !canOrder) this.#answer(false, "signed in, but the server has no key for orders");
  }

  /** The server let nobody in with this token. */
  denied(reason) {
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
    this.#vehicle = vehicle;
  }

  /** @param old which sources are old, of `assess` */
  show(state, old) {
    this.#state = state;
    const isFresh = !old.state;
    const takesOrders = Boolean(state?.takes_orders) && this.#connection.isOpen;
    byId("engage").disabled = !takesOrders || !isFresh || !ENGAGEABLE.has(state.state);
    byId("goal").disabled = !takesOrders || !isFresh || !GOAL_CHANGEABLE.has(state.state);
    byId("take-view").disabled = byId("goal").disabled || old.view || old.vehicle;
    // Stopping is offered even where the newest state is old: it can do no harm.
    byId("hold").disabled = byId("abort").disabled = !takesOrders;
    if (state && !state.takes_orders) this.#hint("this vehicle was started without a command key");
  }

  order(word) {
    if (byId("operator").hidden || !this.#vehicle) return;
    this.#answer(null, `${word} sent …`);
    this.#connection.send({ type: "order", order: word, vehicle: this.#vehicle });
  }

  answered(answers) {
    for (const { accepted, text } of answers) this.#answer(accepted, text);
  }

  #confirmEngage() {
    const state = this.#state?.state ?? "unknown";
    this.#confirm("Engage?", `${this.#vehicle} is ${state}. It will fly to its goal by itself.`, null,
      () => this.order("engage"));
  }

  #confirmGoal(files) {
    const picture = files.find((file) => !file.name.endsWith(".json"));
    const sidecar = files.find((file) => file.name.endsWith(".json"));
    byId("goal-files").value = "";
    if (!picture) return;
    const vehicle = this.#vehicle;
    const taken = sidecar ? `taken as ${sidecar.name} says` : "taken level, by the camera that flies";
    this.#confirm("Change the goal?", `${picture.name} for ${vehicle}, ${taken}.`, picture, async () => {
      this.#sendGoal(vehicle, sidecar ? await sidecar.text() : "", await picture.arrayBuffer());
    });
  }

  /** Ask whether the view of this moment shall be the goal; what is asked is what is sent. */
  #confirmView() {
    const view = this.#currentView();
    if (!view?.attitude) {
      this.#answer(false, "not sent: the attitude at the time of this picture is not known");
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

  #sendGoal(vehicle, sidecar, picture) {
    this.#answer(null, "goal sent …");
    this.#connection.sendGoal({ vehicle, sidecar }, picture);
  }

  #confirm(title, text, picture, onConfirmed) {
    this.#onConfirmed = onConfirmed;
    byId("confirm-title").textContent = title;
    byId("confirm-text").textContent = text;
    const image = byId("confirm-picture");
    URL.revokeObjectURL(image.src);
    image.hidden = !picture;
    if (picture) image.src = URL.createObjectURL(picture);
    byId("confirm-dialog").returnValue = "";
    byId("confirm-dialog").showModal();
  }

  #signIn() {
    const token = byId("token").value.trim();
    byId("token").value = "";
    if (byId("sign-dialog").returnValue !== "ok" || !token) return;
    sessionStorage.setItem(KEPT_TOKEN, token);
    this.#connection.signIn(token);
  }

  #signOut() {
    sessionStorage.removeItem(KEPT_TOKEN);
    this.#connection.signIn("");
  }

  #hint(text) {
    if (!byId("answer").textContent) this.#answer(null, text);
  }

  #answer(accepted, text) {
    byId("answer").textContent = text;
    byId("answer").dataset.ok = accepted === null ? "" : accepted ? "yes" : "no";
  }
}
