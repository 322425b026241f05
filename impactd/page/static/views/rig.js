// The technician's view: choose, arm and drop, see what came of it, again.

import { get, post } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { duration, millimetres } from "../js/numbers.js";
import { may } from "../js/session.js";
import { material, materials } from "../js/words.js";
import { dropForm } from "../parts/drop_form.js";
import { runSeries, seriesCard } from "../parts/series.js";
import { hasEnded, watchDrop } from "../parts/steps.js";
import { showResult } from "../parts/shot_result.js";
import { tell } from "../parts/notices.js";
import { prepare } from "../charts/plotly.js";

let latest = null; // what was dropped last on this page, for "again"

export async function showRig(place, { signal }) {
  const formPlace = h("div", { class: "stack" });
  const seriesPlace = h("div", { class: "stack" });
  const calibrationPlace = h("div", { class: "stack" });
  const faultPlace = h("div", { class: "stack" });
  const steps = h("div", { class: "stack" });
  const stepsCard = h("section", { class: "card", "aria-label": "The drop under way", hidden: true }, steps);
  const result = h("section", { class: "card", "aria-label": "The latest shot" });
  const now = h("div", { class: "cards" }, faultPlace, calibrationPlace, seriesPlace, stepsCard, result);
  const both = h("div", { class: "rig" }, formPlace, now);
  const underWay = () => { both.dataset.underWay = ""; };
  fill(place, h("h1", {}, "Drop"), both);

  let running = false;
  let shown = null;
  let watched = null;
  let form = null;

  const showShot = async (drop) => {
    shown = drop.shot;
    const inner = h("div", { class: "stack" });
    const again = h("button", { class: "button large", type: "button", on: { click: () => go(latest ?? asked(drop), 1) } }, "Repeat with the same settings");
    fill(result,
      h("div", { class: "row spread" }, h("h2", {}, `Shot ${drop.shot}`), h("a", { class: "button", href: `#/shots/${drop.shot}` }, "Everything about this shot")),
      h("p", { class: "soft" }, `${materials(drop.sphere, drop.surface)} from ${millimetres(drop.drop_height_m)}, ${drop.operator}`),
      inner, may("operate") && again);
    try {
      await showResult(inner, drop.shot, signal);
    } catch (problem) {
      fill(inner, h("p", { class: "wrong" }, problem.message));
    }
  };

  const go = async (request, count) => {
    if (running) return;
    running = true;
    latest = request;
    allow();
    stepsCard.hidden = false;
    underWay();
    now.scrollIntoView({ block: "start" });
    try {
      const words = await runSeries({ request, count, place: seriesPlace, steps, onShot: showShot, signal });
      if (words) tell("info", words, { passing: true });
    } catch (problem) {
      stepsCard.hidden = !steps.hasChildNodes();
      tell("bad", problem.message);
    }
    running = false;
    allow();
  };

  const allow = () => {
    const status = live.status;
    const busy = running || (status && !status.ready && status.owner);
    form?.allow(Boolean(status?.ready) && !running && !live.lost, busy ? "A drop is under way" : live.lost ? "Not connected" : "Not ready");
  };

  // A drop that somebody else asked for, or that this page knew before it was loaded again.
  const follow = async (number) => {
    if (running || watched === number) return;
    watched = number;
    underWay();
    stepsCard.hidden = false;
    const drop = await watchDrop(steps, number, signal);
    if (drop?.shot && watched === number) showShot(drop);
  };

  on("status", (status) => {
    allow();
    if (status.drop) follow(status.drop);
    showSeries(calibrationPlace, status.series);
    showFault(faultPlace, status);
  }, signal);
  on("lost", allow, signal);

  result.hidden = true;
  try {
    const [rig, drops] = await Promise.all([get("/v1/rig"), get("/v1/drops?limit=10")]);
    if (signal.aborted) return;
    form = dropForm(rig, drops.items[0], go);
    fill(formPlace, form.form);
    allow();
    const last = drops.items.find((drop) => drop.shot);
    result.hidden = false;
    if (shown === null && last && hasEnded(last)) await showShot(last);
    else if (shown === null) fill(result, h("h2", {}, "No shot yet"), h("p", { class: "soft" }, "Choose sphere, surface and height, then press Arm and drop. The shot is shown here two seconds after the impact."));
  } catch (problem) {
    fill(formPlace, h("div", { class: "card" }, h("p", { class: "wrong" }, problem.message), h("button", { class: "button", type: "button", on: { click: () => showRig(place, { signal }) } }, "Try again")));
  }
  prepare();
}

const asked = ({ sphere, surface, drop_height_m, operator }) => ({ sphere, surface, drop_height_m, operator });

let drawnSeries = "";

function showSeries(place, series) {
  const text = JSON.stringify(series);
  if (text === drawnSeries && place.hasChildNodes() === Boolean(series)) return;
  drawnSeries = text;
  if (!series) { fill(place); return; }
  const { sphere, surface, drop_height_m } = series.next;
  fill(place, seriesCard({
    title: `Calibration ${series.number}`, done: series.done, of: series.of, remaining: duration(series.remaining_s),
    load: `Load the next sphere: ${material(sphere)}, for ${material(surface)} from ${millimetres(drop_height_m)}.`,
  }));
}

function showFault(place, status) {
  if (status.state !== "FAULT" || !may("operate")) { fill(place); return; }
  if (place.hasChildNodes()) return;
  const acknowledge = async () => {
    try {
      await post("/v1/acknowledge", undefined, { timeoutMs: 20000 });
    } catch (problem) {
      tell("bad", problem.message);
    }
    live.refresh();
  };
  fill(place, h("section", { class: "card", "aria-label": "Fault" },
    h("h2", {}, "The rig has a fault"),
    h("p", {}, "Do what the light says. When the rig is in order again, say so here; it is then tested before the next drop."),
    h("button", { class: "button main-action", type: "button", on: { click: acknowledge } }, "The rig was checked")));
}
