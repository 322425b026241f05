// Several drops of the same kind, one after the other. The page asks for each when the one before
// has ended: where nobody watches the page, nothing falls.

import { get, post } from "../js/api.js";
import { fill, freshKey, h, say } from "../js/dom.js";
import { live } from "../js/live.js";
import { duration } from "../js/numbers.js";
import { material } from "../js/words.js";
import { aborted } from "./abort.js";
import { watchDrop } from "./steps.js";

const READY_LIMIT_MS = 30000;

/** Make `count` drops; `onShot(drop)` is called with each that ended with a shot. Resolve with what is left to say. */
export async function runSeries({ request, count, place, steps, onShot, signal }) {
  const ending = new AbortController();
  const end = () => ending.abort();
  signal.addEventListener("abort", end);
  aborted.addEventListener("abort", end, { signal });
  const began = Date.now();
  let made = 0;
  try {
    for (; made < count && !ending.signal.aborted; made += 1) {
      show(place, { made, count, began, request, end });
      if (made > 0 && !(await ready(ending.signal))) break;
      const asked = await post("/v1/drops", request, { key: freshKey() });
      const drop = await watchDrop(steps, asked.number, signal);
      if (drop === null) return null;
      if (drop.shot) await onShot(drop);
      if (["failed", "aborted", "interrupted"].includes(drop.state)) {
        return count > 1 ? `The series ended after ${made} of ${count} drops.` : null;
      }
    }
    if (count === 1 || signal.aborted) return null;
    return made === count ? `All ${count} drops are done.` : `The series ended after ${made} of ${count} drops.`;
  } finally {
    fill(place);
  }
}

function show(place, { made, count, began, request, end }) {
  if (count === 1) return;
  const each = made ? (Date.now() - began) / made / 1e3 : null;
  const remaining = duration(each === null ? null : each * (count - made));
  const load = made ? `Load the next sphere: ${material(request.sphere)}.` : "";
  if (load) say(`${load} ${made} of ${count} drops are done.`);
  fill(place, seriesCard({ title: "Series", done: made, of: count, remaining, load, end: h("button", { class: "button", type: "button", on: { click: end } }, "End after this drop") }));
}

/** Return how far a series is; a calibration's looks the same. */
export function seriesCard({ title, done, of, remaining, load, end }) {
  return h("section", { class: "card", "aria-label": title },
    h("div", { class: "row spread" }, h("h2", {}, `${title}: ${done} of ${of} drops done`), h("p", { class: "soft" }, remaining ? `${remaining} to go` : "the time to go is known after the first drop")),
    h("progress", { max: of, value: done, "aria-label": `${done} of ${of} drops done` }),
    load && h("p", { class: "instruction" }, load),
    end);
}

/** Wait until the rig is ready; resolve with whether it is. */
async function ready(signal) {
  const until = Date.now() + READY_LIMIT_MS;
  while (!signal.aborted && Date.now() < until) {
    const status = await get("/v1/status").catch(() => null);
    if (status?.ready) return true;
    await new Promise((resolve) => { setTimeout(resolve, 250); });
  }
  live.refresh();
  return false;
}
