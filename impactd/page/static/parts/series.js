// Several drops, one after the other. The queue is the daemon's: it goes on when the page is closed or
// loaded again, and one abort ends it all.

import { ask, get, post } from "../js/api.js";
import { freshKey, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { counted, duration, millimetres } from "../js/numbers.js";
import { may } from "../js/session.js";
import { material, materials } from "../js/words.js";
import { followDrop } from "./steps.js";
import { tell } from "./notices.js";

/** Emits `change` whenever `now` is another: the daemon's series, { single, drop } for one drop of this page, or null. */
class Series extends EventTarget {
  now = null;
  #running = false;

  constructor() {
    super();
    on("happened", ({ kind }) => { if (kind === "series.changed") this.look(); });
    on("found", () => this.look());
    on("status", () => { if (this.now && !this.now.single) this.dispatchEvent(new Event("change")); });
  }

  /** Ask the daemon how its series is. */
  async look() {
    const found = await get("/v1/series").catch(() => null);
    if (found) this.#take(found);
  }

  /** Make `count` drops: one by itself, several as a series; more are added to the series that runs. */
  async start(request, count, note = "") {
    try {
      if (this.now && !this.now.single) this.#take(await post("/v1/series/drops", { drops: [{ ...request, repeats: count }] }));
      else if (count > 1) this.#take(await post("/v1/series", { drops: [{ ...request, repeats: count }], note }, { key: freshKey() }));
      else await this.#one(request);
    } catch (problem) {
      tell("bad", problem.message);
    }
  }

  async #one(request) {
    if (this.now) return;
    this.#set({ single: true, drop: null });
    try {
      const asked = await post("/v1/drops", request, { key: freshKey() });
      this.#set({ single: true, drop: asked.number });
      await followDrop(asked.number);
    } finally {
      this.#set(null);
    }
  }

  /** Pause, resume, order or end it: `change(path, method, body)` of /v1/series. */
  async change(method, path = "", body = undefined) {
    try {
      this.#take(await ask(method, `/v1/series${path}`, { body }));
    } catch (problem) {
      tell("bad", problem.message);
    }
  }

  #take(found) {
    const alive = found.state === "running" || found.state === "paused";
    // The abort has told it already.
    if (this.#running && !alive && !found.reason.endsWith("aborted it.")) tell("info", found.reason[0].toUpperCase() + found.reason.slice(1), { passing: true });
    this.#running = alive;
    if (alive || (this.now && !this.now.single)) this.#set(alive ? found : null);
  }

  #set(now) {
    this.now = now;
    this.dispatchEvent(new Event("change"));
  }
}

export const series = new Series();

/** Return the number of the drop that the series, or this page, makes at present. */
export const dropOf = (now) => (now?.single ? now.drop : now?.drops.find((one) => one.state === "under way")?.drop ?? null);

/** Return the card of the series that runs, null where there is none to show. */
export function runningCard() {
  const { now } = series;
  if (!now || now.single) return null;
  const next = now.drops.find((one) => one.state === "under way") ?? now.drops.find((one) => one.state === "planned");
  const waits = now.state === "running" && next && !DROP_UNDER_WAY.includes(live.status?.state);
  return seriesCard({
    title: "Series", done: now.done, of: now.of, remaining: duration(now.remaining_s),
    load: waits ? `Load the next sphere: ${material(next.sphere)}, for ${material(next.surface)} from ${millimetres(next.drop_height_m)}.` : "",
    end: h("div", { class: "stack" },
      now.note && h("p", { class: "soft" }, `Note: ${now.note}`),
      now.state === "paused" && h("p", { class: "notice warn" }, `Paused. ${now.reason}`),
      may("operate") && h("div", { class: "row" },
        now.state === "paused"
          ? h("button", { class: "button main-action", type: "button", on: { click: () => series.change("POST", "/resume") } }, "Go on")
          : h("button", { class: "button", type: "button", on: { click: () => series.change("POST", "/pause") } }, "Pause after this drop"),
        h("button", { class: "button", type: "button", on: { click: () => series.change("DELETE") } }, "End after this drop")),
      planned(now)),
  });
}

function planned(now) {
  const left = now.drops.filter((one) => one.state === "planned");
  if (!left.length) return null;
  const ids = left.map((one) => one.id);
  const moved = (at) => { const order = [...ids]; [order[at - 1], order[at]] = [order[at], order[at - 1]]; return order; };
  return h("details", { class: "queue" }, h("summary", {}, `${left.length} still planned`),
    h("ol", {}, left.map((one, at) => h("li", { class: "row spread" },
      h("span", {}, `${materials(one.sphere, one.surface)} from ${millimetres(one.drop_height_m)}`),
      may("operate") && h("span", { class: "row" },
        at > 0 && h("button", { class: "button", type: "button", "aria-label": `Make planned drop ${one.id} earlier`, on: { click: () => series.change("PUT", "/order", { order: moved(at) }) } }, "↑"),
        h("button", { class: "button", type: "button", "aria-label": `Take planned drop ${one.id} out`, on: { click: () => series.change("PUT", "/order", { order: ids.filter((id) => id !== one.id) }) } }, "Take out"))))));
}

/** Return how far a series is; a calibration's looks the same. */
export function seriesCard({ title, done, of, remaining, load, end }) {
  return h("section", { class: "card", "aria-label": title },
    h("div", { class: "row spread" }, h("h2", {}, `${title}: ${done} of ${counted(of, "drop")} done`), h("p", { class: "soft" }, remaining ? `${remaining} to go` : "the remaining time is known after the first drop")),
    h("progress", { max: of, value: done, "aria-label": `${done} of ${counted(of, "drop")} done` }),
    load && h("p", { class: "instruction" }, load),
    end);
}

const DROP_UNDER_WAY = ["CHECKING", "ARMING", "ARMED", "RELEASED", "CAPTURING", "STORING"];

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
