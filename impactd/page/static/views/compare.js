// Several shots over each other, each from its own trigger on, and how each differs from the first.

import { get } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { columnUnit, measured, millimetres, percent } from "../js/numbers.js";
import { materials } from "../js/words.js";
import { drawCompared } from "../charts/compare.js";
import { bestFit } from "../parts/shot_result.js";

const MOST = 8;

export async function showCompare(place, { parameters: [list], signal }) {
  const numbers = [...new Set(list.split(",").map(Number))].slice(0, MOST);
  const chart = h("div", { class: "chart tall" });
  const table = h("div", { class: "table-frame" });
  const wrong = h("p", { class: "wrong" });
  const scaled = h("button", { class: "button", type: "button", "aria-pressed": "false" }, "Scale each to its peak");
  fill(place, h("h1", {}, `Shots ${numbers.join(", ")}`),
    h("section", { class: "card", "aria-label": "Traces" }, chart, wrong, numbers.length > 1 && h("p", { class: "soft" }, `Below: each shot minus shot ${numbers[0]}. On a steep flank a trigger that is half a sample apart shows, too.`), h("div", { class: "row" }, scaled, h("a", { class: "button", href: "#/shots" }, "Choose others"))),
    h("section", { class: "card", "aria-label": "Their numbers" }, table));
  try {
    const found = await Promise.all(numbers.map(async (number) => ({
      shot: await get(`/v1/shots/${number}`),
      trace: await get(`/v1/shots/${number}/trace?points=2000&start_s=-0.0001&stop_s=0.0008`),
    })));
    if (signal.aborted) return;
    let byPeak = false;
    const show = () => drawCompared(chart, found, byPeak, signal);
    scaled.addEventListener("click", () => { byPeak = !byPeak; scaled.setAttribute("aria-pressed", String(byPeak)); show(); });
    fill(table, numbersOf(found));
    await show();
  } catch (problem) {
    wrong.textContent = problem.message;
  }
}

function numbersOf(found) {
  const stiffness = found.map(({ shot }) => (shot.advice === "repeat" ? null : bestFit(shot.fits)?.result.reduced_modulus_Pa));
  const apart = (one) => (one && stiffness[0] && one !== stiffness[0] ? percent(one.value / stiffness[0].value - 1, true) : "–");
  const [scale, unit] = columnUnit(stiffness);
  return h("table", {},
    h("caption", { class: "unseen" }, "The compared shots"),
    h("thead", {}, h("tr", {}, ["Shot", "Dropped", "Height", `E* ± U (95 %) / ${unit}`, `From shot ${found[0].shot.number}`].map((name, index) => h("th", { scope: "col", class: index > 1 ? "number" : null }, name)))),
    h("tbody", {}, found.map(({ shot }, index) => h("tr", {},
      h("th", { scope: "row" }, h("a", { class: "shot-link", href: `#/shots/${shot.number}` }, String(shot.number))),
      h("td", {}, materials(shot.sphere, shot.surface)),
      h("td", { class: "number" }, millimetres(shot.drop_height_m)),
      h("td", { class: "number" }, measured(stiffness[index], scale)),
      h("td", { class: "number" }, apart(stiffness[index]))))));
}
