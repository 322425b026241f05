// Several drops of the same kind, one after the other. The page asks for each when the one before
// has ended, whichever view is shown: where nobody has the page open, nothing falls.

import { get, post } from "../js/api.js";
import { freshKey, h, say } from "../js/dom.js";
import { live } from "../js/live.js";
import { duration, millimetres } from "../js/numbers.js";
import { material } from "../js/words.js";
import { aborted } from "./abort.js";
import { followDrop } from "./steps.js";
import { tell } from "./notices.js";

const READY_LIMIT_MS = 30000;

/** Emits `change` whenever `now` is another: { request, count, made, began, drop }, null when nothing runs. */
class Series extends EventTarget {
  now = null;
  #ending = null;

  /** Make `count` drops. */
  async start(request, count) {
    if (this.now) return;
    this.#ending = new AbortController();
    aborted.addEventListener("abort", () => this.end(), { signal: this.#ending.signal });
    this.#set({ request, count, made: 0, began: Date.now(), drop: null });
    let words = null;
    try {
      words = await this.#run(this.#ending.signal);
    } catch (problem) {
      tell("bad", problem.message);
    }
    this.end();
    this.#set(null);
    if (words) tell("info", words, { passing: true });
  }

  /** Ask for no further drop; the one under way goes on. */
  end() { this.#ending?.abort(); }

  async #run(ending) {
    const { request, count } = this.now;
    while (this.now.made < count && !ending.aborted) {
      if (this.now.made > 0) {
        say(`Load the next sphere: ${material(request.sphere)}. ${this.now.made} of ${count} drops are done.`);
        if (!(await ready(ending))) break;
      }
      const asked = await post("/v1/drops", request, { key: freshKey() });
      this.#set({ ...this.now, drop: asked.number });
      const drop = await followDrop(asked.number);
      if (["failed", "aborted", "interrupted"].includes(drop.state)) break;
      this.#set({ ...this.now, made: this.now.made + 1 });
    }
    const { made } = this.now;
    if (count === 1) return null;
    return made === count ? `All ${count} drops are done.` : `The series ended after ${made} of ${count} drops.`;
  }

  #set(now) {
    this.now = now;
    this.dispatchEvent(new Event("change"));
  }
}

export const series = new Series();

/** Return the card of the series that runs, null where there is none to show. */
export function runningCard() {
  if (!series.now || series.now.count === 1) return null;
  const { request, count, made, began } = series.now;
  const each = made ? (Date.now() - began) / made / 1e3 : null;
  return seriesCard({
    title: "Series", done: made, of: count,
    remaining: duration(each === null ? null : each * (count - made)),
    load: made && made < count ? `Load the next sphere: ${material(request.sphere)}.` : "",
    end: h("button", { class: "button", type: "button", on: { click: () => series.end() } }, "End after this drop"),
  });
}

/** Return how far a series is; a calibration's looks the same. */
export function seriesCard({ title, done, of, remaining, load, end }) {
  return h("section", { class: "card", "aria-label": title },
    h("div", { class: "row spread" }, h("h2", {}, `${title}: ${done} of ${of} drops done`), h("p", { class: "soft" }, remaining ? `${remaining} to go` : "the time to go is known after the first drop")),
    h("progress", { max: of, value: done, "aria-label": `${done} of ${of} drops done` }),
    load && h("p", { class: "instruction" }, load),
    end);
}

const DROP_UNDER_WAY = ["ARMING", "ARMED", "RELEASED", "CAPTURING", "STORING"];

/** Show in `place` how far the calibration is that runs, if one does. The next sphere is not asked for while a drop is under way. */
export function showCalibrationUnderWay(place, { series: told, state }) {
  const now = JSON.stringify([told ?? null, DROP_UNDER_WAY.includes(state)]);
  if (now === place.dataset.drawn) return;
  place.dataset.drawn = now;
  if (!told) { place.replaceChildren(); return; }
  const { sphere, surface, drop_height_m: height } = told.next;
  place.replaceChildren(seriesCard({
    title: `Calibration ${told.number}`, done: told.done, of: told.of, remaining: duration(told.remaining_s),
    load: DROP_UNDER_WAY.includes(state) ? "" : `Load the next sphere: ${material(sphere)}, for ${material(surface)} from ${millimetres(height)}.`,
  }));
}

/** Wait until the rig is ready; resolve with whether it is. */
async function ready(ending) {
  const until = Date.now() + READY_LIMIT_MS;
  while (!ending.aborted && Date.now() < until) {
    const status = await get("/v1/status").catch(() => null);
    if (status?.ready) return true;
    await new Promise((resolve) => { setTimeout(resolve, 250); });
  }
  live.refresh();
  return false;
}
