// The load cell: which calibration is in force, how it drifts, when the next is due, and a new one.

import { get, post } from "../js/api.js";
import { fill, freshKey, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { counted, day, inDays, measured, millimetres, moment } from "../js/numbers.js";
import { may } from "../js/session.js";
import { materials, stateBadge } from "../js/words.js";
import { QUANTITIES, drawDrift } from "../charts/drift.js";
import { tell } from "../parts/notices.js";
import { showCalibrationUnderWay } from "../parts/series.js";

export async function showCalibration(place, { signal }) {
  const progress = h("div", { class: "stack" });
  const current = h("section", { class: "card", "aria-label": "The valid calibration" });
  const drift = h("section", { class: "card", "aria-labelledby": "drift-title" });
  const begin = h("section", { class: "card", "aria-labelledby": "begin-title" });
  const history = h("section", { class: "card", "aria-labelledby": "history-title" });
  fill(place, h("h1", {}, "Calibration"), progress, current, begin, drift, history);

  const loadHistory = async () => {
    const page = await get("/v1/calibrations?limit=100");
    if (!signal.aborted) showHistory(history, page.items);
    return page;
  };
  const load = async () => {
    try {
      const page = await loadHistory();
      if (signal.aborted) return;
      const inForce = page.items.find((one) => one.kind === "drops" && one.state === "done") ?? null;
      showCurrent(current, inForce);
      showDrift(drift, page.series, inForce, signal);
    } catch (problem) {
      fill(current, h("p", { class: "wrong" }, problem.message));
    }
  };
  on("happened", ({ kind }) => {
    if (kind === "calibration.progress") loadHistory().catch(() => {}); // a chart is not drawn again for a drop
    else if (kind.startsWith("calibration.")) load();
  }, signal);
  on("found", load, signal);
  on("status", (status) => {
    showCalibrationUnderWay(progress, status);
    const button = begin.querySelector("button");
    if (button) button.setAttribute("aria-disabled", String(!status.ready));
  }, signal);
  await load();
  const rig = await get("/v1/rig").catch(() => null);
  if (rig && !signal.aborted) showBegin(begin, rig.calibration_plan);
}

function showCurrent(place, one) {
  if (!one) {
    fill(place, h("h2", {}, "Never calibrated"), h("p", {}, "The values of the cell's certificate are used. Moduli are only as accurate as these values; calibrate before you use them."));
    return;
  }
  const late = new Date(one.valid_until_utc) < new Date();
  const found = one.result?.identifiable ?? {};
  const facts = [
    ["In force", `calibration ${one.number} of ${moment(one.finished_utc)}`],
    ["Next one due", `${day(one.valid_until_utc)}, ${inDays(one.valid_until_utc)}`],
    ...QUANTITIES.filter(([key]) => found[key]).map(([key, name, unit]) => [`${name} ± U (95 %)`, `${measured(found[key])} ${unit === "1" ? "" : unit}`]),
    ["Drops", String(one.drops.length)],
  ];
  fill(place,
    h("div", { class: "row spread" }, h("h2", {}, "The load cell"), h("span", { class: `badge ${late ? "bad" : "good"}` }, late ? "overdue" : "valid")),
    h("dl", { class: "facts" }, facts.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)))));
}

function showBegin(place, plan) {
  const drops = plan.reduce((sum, one) => sum + one.repeats, 0);
  const go = async (event) => {
    if (event.currentTarget.getAttribute("aria-disabled") === "true") return;
    try {
      const made = await post("/v1/calibrations", {}, { key: freshKey() });
      tell("info", `Calibration ${made.number} has begun: ${counted(drops, "drop")}.`, { passing: true });
      live.refresh();
    } catch (problem) {
      tell("bad", problem.message);
    }
  };
  fill(place,
    h("h2", { id: "begin-title" }, "Calibrate"),
    drops ? h("p", {}, `${counted(drops, "drop")} of spheres and surfaces of known modulus, then one fit. Stay at the rig: the page says which sphere comes next.`) : h("p", {}, "The settings hold no plan of drops; fill in [[calibration.plan]]."),
    h("ul", { class: "soft" }, plan.map((one) => h("li", {}, `${one.repeats} × ${materials(one.sphere, one.surface)} from ${millimetres(one.drop_height_m)}`))),
    may("operate") && drops > 0 && h("div", { class: "row" }, h("button", { class: "button main-action", type: "button", "aria-disabled": String(!live.status?.ready), on: { click: go } }, "Start a calibration")));
}

function showDrift(place, series, inForce, signal) {
  if (!series.length) {
    fill(place, h("h2", { id: "drift-title" }, "Drift"), h("p", { class: "soft" }, "The chart begins with the first calibration."));
    return;
  }
  const chart = h("div", { class: "chart flat" });
  let at = 0;
  const show = () => {
    const [key, title, unit] = QUANTITIES[at];
    drawDrift(chart, { series, key, title, unit, due: inForce?.valid_until_utc }, signal);
    buttons.forEach((button, index) => button.setAttribute("aria-pressed", String(index === at)));
  };
  const buttons = QUANTITIES.map(([, name], index) => h("button", { class: "button", type: "button", on: { click: () => { at = index; show(); } } }, name));
  fill(place, h("h2", { id: "drift-title" }, "Drift"), h("div", { class: "row", role: "group", "aria-label": "What is drawn" }, buttons), chart, moved(series.at(-1)));
  requestAnimationFrame(show);
}

/** Say how far the cell moved, in the daemon's sentence and with the words of this page. */
function moved({ since_previous: before, since_first: first }) {
  if (!before) return h("p", { class: "soft" }, "The drift of the cell is known after the second calibration.");
  const plain = (sentence) => QUANTITIES.reduce((text, [key, name]) => text.replace(key, name), sentence);
  return h("p", { class: before.drifted ? "wrong" : null }, `Since the previous calibration: ${plain(before.sentence)} Since the first: ${plain(first.sentence)}`);
}

/** Say how a calibration is made; of one under way, how many drops are behind it. */
function kindOf(one) {
  if (one.kind !== "drops") return "weights";
  const count = counted(one.drops.length, "drop");
  return one.finished_utc ? count : `${count} so far`;
}

/** Return how one ended: whoever pressed Abort reads that, and not that it failed. */
const endOf = (one) => (one.problem?.type?.endsWith(":aborted") ? "aborted" : one.state);

function showHistory(place, items) {
  fill(place, h("h2", { id: "history-title" }, "All calibrations"),
    items.length ? h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of calibrations" }, h("table", {},
      h("thead", {}, h("tr", {}, ["Number", "State", "Kind", "By", "When", "Valid until"].map((name) => h("th", { scope: "col" }, name)))),
      h("tbody", {}, items.map((one) => h("tr", {},
        h("th", { scope: "row" }, String(one.number)),
        h("td", {}, h("span", { class: `badge ${stateBadge(endOf(one))}` }, endOf(one)), one.problem && h("p", { class: "soft" }, one.problem.detail)),
        h("td", {}, kindOf(one)),
        h("td", {}, one.owner),
        h("td", {}, moment(one.requested_utc)),
        h("td", {}, day(one.valid_until_utc))))))) : h("p", { class: "empty" }, "None yet."));
}
