// What the daemon tells by itself: its status, its events, and whether the line to it holds.
//
// Events come as a stream, which the browser opens again by itself and without a gap; the status
// is asked for every two seconds, which also shows a line that is dead without having said so.

import { get } from "./api.js";

const EVERY_MS = 2000;
const PATIENCE_MS = 6000;
const KINDS = [
  "rig.state", "rig.fault", "rig.abort", "rig.acknowledged",
  "drop.requested", "drop.arming", "drop.armed", "drop.released", "drop.capturing", "drop.storing",
  "drop.stored", "drop.analysed", "drop.failed", "drop.aborted", "drop.interrupted",
  "shot.unlike", "series.changed", "fit.done", "job.failed", "job.cancelled", "job.retried",
  "calibration.started", "calibration.progress", "calibration.fitting", "calibration.done", "calibration.failed",
  "trigger.early", "environment.unknown", "diagnosis.done", "model.chosen", "material.changed", "alarm.raised", "alarm.acknowledged",
];

/** Emits `status`, `happened`, `lost`, `found`, `unknown`. */
class Live extends EventTarget {
  status = null;
  seenAt = null;
  lost = false;
  #source = null;
  #timer = null;
  #opened = false;

  /** Begin; `withEvents` once somebody is signed in. */
  start({ withEvents }) {
    this.stop();
    if (withEvents) this.#listen();
    this.#timer = setInterval(() => this.refresh(), EVERY_MS);
    return this.refresh();
  }

  stop() {
    clearInterval(this.#timer);
    this.#source?.close();
    this.#source = null;
    this.#opened = false;
  }

  /** Ask for the status now. */
  async refresh() {
    let status;
    try {
      status = await get("/v1/status", { timeoutMs: PATIENCE_MS });
    } catch (problem) {
      if (problem.status === 401) {
        clearInterval(this.#timer); // until somebody signs in; asking on would only be refused
        this.#emit("unknown");
      } else {
        this.#lose();
      }
      return;
    }
    this.status = status;
    this.seenAt = new Date();
    this.#find();
    this.#emit("status", status);
  }

  #listen() {
    const source = new EventSource("/v1/events");
    this.#source = source;
    source.onopen = () => {
      // After a gap whatever is on the screen may be old.
      if (this.#opened) this.#emit("found");
      this.#opened = true;
    };
    source.onerror = () => {
      if (source !== this.#source) return;
      this.refresh();
      // A refusal ends the stream for good; whether we are still known is for the API to say.
      if (source.readyState === EventSource.CLOSED) setTimeout(() => this.#again(source), EVERY_MS);
    };
    for (const kind of KINDS) {
      source.addEventListener(kind, (event) => {
        this.#emit("happened", JSON.parse(event.data));
        if (kind.startsWith("rig.") || kind.startsWith("drop.")) this.#soon();
      });
    }
  }

  async #again(source) {
    if (source !== this.#source) return;
    try {
      await get("/v1/session");
    } catch (problem) {
      if (problem.status !== 401 && source === this.#source) setTimeout(() => this.#again(source), EVERY_MS);
      return; // a 401 has already led to the sign-in
    }
    if (source === this.#source) this.#listen();
  }

  #due = null;

  #soon() {
    this.#due ??= setTimeout(() => { this.#due = null; this.refresh(); }, 60);
  }

  #lose() {
    if (this.lost) return;
    this.lost = true;
    this.#emit("lost");
  }

  #find() {
    if (!this.lost) return;
    this.lost = false;
    this.#emit("found");
  }

  #emit(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

export const live = new Live();

/** Listen to one of its words until the signal ends it. */
export function on(name, listener, signal) {
  live.addEventListener(name, (event) => listener(event.detail), { signal });
}
