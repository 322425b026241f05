// The technician's view: choose, arm and drop, see what came of it, again.

import { get, post } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { millimetres } from "../js/numbers.js";
import { may } from "../js/session.js";
import { materials } from "../js/words.js";
import { dropForm } from "../parts/drop_form.js";
import { dropOf, runningCard, series, showCalibrationUnderWay } from "../parts/series.js";
import { hasEnded, watchDrop } from "../parts/steps.js";
import { showResult } from "../parts/shot_result.js";
import { tell } from "../parts/notices.js";
import { prepare } from "../charts/plotly.js";

export async function showRig(place, { signal }) {
  const formPlace = h("div", { class: "stack" });
  const seriesPlace = h("div", { class: "stack" });
  const calibrationPlace = h("div", { class: "stack" });
  const faultPlace = h("div", { class: "stack" });
  const steps = h("div", { class: "stack" });
  const stepsCard = h("section", { class: "card", "aria-label": "The drop under way", hidden: true }, steps);
  const result = h("section", { class: "card", "aria-label": "The latest shot", hidden: true });
  const now = h("div", { class: "cards" }, faultPlace, calibrationPlace, seriesPlace, stepsCard, result);
  const both = h("div", { class: "rig" }, formPlace, now);
  fill(place, h("h1", {}, "Drop"), both);

  let form = null;
  let watched = null;
  let shown = null;
  let redraw = null;

  const allow = () => {
    const { status, lost } = live;
    const queue = series.now && !series.now.single;
    const busy = series.now || status?.owner;
    const fine = queue || (Boolean(status?.ready) && !series.now);
    form?.allow(fine && !lost, lost ? "Not connected" : busy ? "A drop is under way" : "Not ready", queue ? "Add to the series" : "Arm and drop");
  };

  const go = (request, count, note) => {
    both.dataset.underWay = "";
    window.scrollTo(0, 0);
    series.start(request, count, note);
  };

  const showShot = async (drop) => {
    shown = drop.shot;
    const inner = h("div", { class: "stack" });
    const { sphere, surface, drop_height_m, operator } = drop;
    const again = h("button", { class: "button large", type: "button", on: { click: () => go({ sphere, surface, drop_height_m, operator }, 1) } }, "Repeat with the same settings");
    result.hidden = false;
    result.after(stepsCard); // of a drop that has ended, what it gave comes first
    fill(result,
      h("div", { class: "row spread" }, h("h2", {}, `Shot ${drop.shot}`), h("a", { class: "button", href: `#/shots/${drop.shot}` }, "Everything about this shot")),
      h("p", { class: "soft" }, `${materials(sphere, surface)} from ${millimetres(drop_height_m)}, ${operator}`),
      inner, may("operate") && again);
    redraw = () => showResult(inner, drop.shot, signal);
    await redraw();
  };

  // Whoever asked for a drop, whenever: this view shows it to its end.
  const follow = async (number) => {
    if (watched === number) return;
    watched = number;
    both.dataset.underWay = "";
    stepsCard.hidden = false;
    result.before(stepsCard);
    const drop = await watchDrop(steps, number, signal);
    if (drop?.shot && watched === number) showShot(drop);
  };

  const showSeries = () => {
    const open = seriesPlace.querySelector("details")?.open;
    const text = JSON.stringify([series.now, live.status?.state]);
    // Drawn only when something changed: a button must not vanish under a finger.
    if (text !== seriesPlace.dataset.drawn) {
      seriesPlace.dataset.drawn = text;
      fill(seriesPlace, runningCard());
      const queue = seriesPlace.querySelector("details");
      if (queue && open) queue.open = true;
    }
    const drop = dropOf(series.now);
    if (drop) follow(drop);
    allow();
  };

  on("status", (status) => {
    allow();
    if (status.drop) follow(status.drop);
    showCalibrationUnderWay(calibrationPlace, status);
    showFault(faultPlace, status);
  }, signal);
  on("lost", allow, signal);
  on("found", () => redraw?.(), signal);
  // It may be known only after the fit is shown.
  on("happened", ({ kind, number }) => { if (kind === "shot.unlike" && number === shown) redraw?.(); }, signal);
  series.addEventListener("change", showSeries, { signal });

  try {
    const [rig, drops] = await Promise.all([get("/v1/rig"), get("/v1/drops?limit=10")]);
    if (signal.aborted) return;
    form = dropForm(rig, drops.items[0], go);
    fill(formPlace, form.form);
    showSeries();
    series.look();
    const last = drops.items.find((drop) => drop.shot && hasEnded(drop));
    if (last && shown === null) await showShot(last);
    else if (shown === null) {
      result.hidden = false;
      if (drops.items.some(hasEnded)) fill(result, h("h2", {}, "The latest drops left no shot"), h("p", { class: "soft" }, "Earlier shots are under Shots."));
      else fill(result, h("h2", {}, "No shot yet"), h("p", { class: "soft" }, "Choose sphere, surface and height, then press Arm and drop. The shot is shown here two seconds after the impact."));
    }
  } catch (problem) {
    fill(formPlace, h("div", { class: "card" }, h("p", { class: "wrong" }, problem.message), h("button", { class: "button", type: "button", on: { click: () => showRig(place, { signal }) } }, "Try again")));
  }
  prepare();
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
    h("p", {}, "Do what the status says. Then confirm here; the rig is tested before the next drop."),
    h("button", { class: "button main-action", type: "button", on: { click: acknowledge } }, "The rig was checked")));
}
