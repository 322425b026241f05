// Results: moduli by material with their network, mean and scatter of every pair, control charts, and selections to take away.

import { get, withQuery } from "../js/api.js";
import { fill, h, withCode } from "../js/dom.js";
import { on } from "../js/live.js";
import { columnUnit, counted, measured, percent, significant } from "../js/numbers.js";
import { material, materials, modelName } from "../js/words.js";
import { drawControl } from "../charts/control.js";
import { choice, field } from "../parts/fields.js";
import { modulusCard, once } from "../parts/modulus_card.js";

const ORDER = ["fitted", "reference", "withheld"];
const FORMATS = [["csv", "Numbers as CSV"], ["csv.gz", "Numbers as CSV, packed (gzip)"], ["json", "Numbers as JSON"], ["parquet", "Numbers as Parquet"], ["hdf5", "Records as NeXus HDF5, in a zip"]];

export async function showResults(place, { signal }) {
  const since = field("From", { type: "date" });
  const until = field("Until", { type: "date" });
  const about = h("p", {});
  const report = h("a", { class: "button not-printed", target: "_blank", rel: "noopener" }, "Report of this period");
  const warnings = h("ul", { class: "soft" });
  const list = h("div", { class: "cards two" });
  const network = h("p", { class: "soft" });
  const pairs = h("section", { class: "card", "aria-labelledby": "pairs-title" });
  const chart = h("section", { class: "card", "aria-labelledby": "chart-title", hidden: true });
  const takeAway = h("section", { class: "card not-printed", "aria-labelledby": "export-title" });
  fill(place, h("h1", {}, "Results"),
    h("form", { class: "card filters dates not-printed", "aria-label": "Which shots", on: { submit: (event) => event.preventDefault() } }, since, until),
    about, h("div", { class: "row" }, report), warnings, list, network, pairs, chart, takeAway);

  const times = () => ({ since: since.input.value, until: dayAfter(until.input.value) });
  const offerPairs = exportForm(takeAway, times);
  let shown = null;
  const showChart = async (pair) => {
    shown = pair;
    chart.hidden = false;
    try {
      const found = await get(withQuery("/v1/results/chart", { sphere: pair.sphere, surface: pair.surface, ...times() }));
      if (!signal.aborted) await controlCard(chart, found, signal);
    } catch (problem) {
      fill(chart, h("p", { class: "wrong" }, problem.message));
    }
  };

  let turn = 0;
  const load = async () => {
    const mine = (turn += 1);
    report.href = withQuery("/v1/results/report.html", times());
    try {
      const found = await get(withQuery("/v1/results", times()));
      if (signal.aborted || mine !== turn) return;
      about.textContent = `Result of ${counted(found.shots, "shot")}. Each shot is fitted by itself with ${modelName(found.model)}, then all are adjusted together; ± is the expanded uncertainty (95 %). Shots of calibrations, clipped records and shots without a good fit do not take part.`;
      // Drawn only when something changed: an open budget must not close under a reader.
      const text = JSON.stringify(found);
      if (text === list.dataset.drawn) return;
      list.dataset.drawn = text;
      fill(warnings, found.warnings.map((one) => h("li", {}, withCode(one))));
      report.hidden = takeAway.hidden = !found.shots;
      const names = Object.keys(found.moduli).sort((a, b) => ORDER.indexOf(found.moduli[a].status) - ORDER.indexOf(found.moduli[b].status));
      const budgets = once(() => get(withQuery("/v1/moduli/budget", times()), { timeoutMs: 60000 }));
      fill(list, names.length ? names.map((name) => modulusCard(name, found.moduli[name], budgets)) : h("p", { class: "empty" }, "No modulus yet: drop a sphere on a reference and on the specimen."));
      network.textContent = networkWords(found.network);
      showPairs(pairs, found.pairs, showChart);
      const again = found.pairs.find((one) => shown && one.sphere === shown.sphere && one.surface === shown.surface) ?? found.pairs[0];
      if (again) showChart(again);
      else chart.hidden = true;
      offerPairs(found.pairs);
    } catch (problem) {
      if (!list.hasChildNodes()) fill(list, h("p", { class: "wrong" }, problem.message));
    }
  };
  for (const one of [since, until]) one.input.addEventListener("change", load, { signal });
  on("happened", ({ kind }) => { if (["drop.analysed", "calibration.done", "model.chosen"].includes(kind)) load(); }, signal);
  on("found", load, signal);
  await load();
}

/** A day is chosen to its end: the API wants the first moment that is too late. */
function dayAfter(text) {
  if (!text) return "";
  const next = new Date(`${text}T00:00:00Z`);
  next.setUTCDate(next.getUTCDate() + 1);
  return next.toISOString().slice(0, 10);
}

/** Say whether the pairs agree on one modulus for each material. */
function networkWords(network) {
  if (!network || !network.degrees_of_freedom) return "";
  const said = `The pairs were adjusted together: chi² ${significant(network.chi2)} at ${counted(network.degrees_of_freedom, "degree")} of freedom, p = ${significant(network.p_value, 2)}.`;
  const dark = network.dark_uncertainty > 0 ? ` They scatter by ${percent(network.dark_uncertainty)} more than their uncertainties explain; every ± includes this.` : "";
  const odd = network.contradicting?.length ? ` In contradiction to the others: ${network.contradicting.map((one) => (typeof one === "string" ? one : one.pair ?? one.name)).join(", ")}.` : "";
  return said + dark + odd;
}

function showPairs(place, pairs, show) {
  const [scale, unit] = columnUnit(pairs.map((one) => one.reduced_modulus_Pa));
  const headings = ["Pair", "", "Shots", `E* ± U (95 %) / ${unit}`, "Scatter (expected)", "First to last", "Outside"];
  fill(place, h("h2", { id: "pairs-title" }, "Pairs"),
    pairs.length ? h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of pairs" }, h("table", {},
      h("thead", {}, h("tr", {}, headings.map((name, index) => (name ? h("th", { scope: "col", class: index ? "number" : null }, name) : h("td", {}))))),
      h("tbody", {}, pairs.map((one) => h("tr", {},
        h("th", { scope: "row" }, materials(one.sphere, one.surface)),
        h("td", {}, h("button", { class: "button", type: "button", on: { click: () => show(one) } }, "Chart", h("span", { class: "unseen" }, ` of ${materials(one.sphere, one.surface)}`))),
        h("td", { class: "number" }, String(one.shots)),
        h("td", { class: "number" }, measured(one.reduced_modulus_Pa, scale)),
        h("td", { class: "number" }, one.scatter_relative === null ? "–" : `${percent(one.scatter_relative)} (${percent(one.expected_scatter_relative)})`),
        h("td", { class: "number" }, trendWords(one.trend)),
        h("td", { class: "number" }, one.control ? String(one.control.outside_count) : "–")))))) : h("p", { class: "empty" }, "No pair yet."));
}

function trendWords(trend) {
  if (!trend) return "–";
  const size = percent(trend.relative, true);
  return Math.abs(trend.relative) > 2 * trend.u ? size : "none seen";
}

async function controlCard(place, found, signal) {
  const chart = h("div", { class: "chart flat" });
  const { control } = found;
  const outside = control?.outside_count
    ? h("p", { class: "wrong" }, `Outside: ${control.outside_count === control.outside.length ? "" : "the latest are "}`, control.outside.flatMap((number, index) => [index ? ", " : "", h("a", { href: `#/shots/${number}` }, `shot ${number}`)]), ".")
    : null;
  fill(place,
    h("h2", { id: "chart-title" }, `Control chart of ${materials(found.sphere, found.surface)}`),
    chart, outside,
    h("p", { class: "soft" }, control
      ? "Limits: mean ± 3 σ, with σ from the differences of neighbouring shots (ISO 7870-2), so that a drift does not widen the limits. Bars: ± U (95 %) of a single shot, without what all shots share."
      : "Limits are drawn from eight shots on. Bars: ± U (95 %) of a single shot, without what all shots share."),
    found.decimated && h("p", { class: "soft" }, `Of ${counted(found.shots, "shot")} the extremes of each interval are drawn, and all outside the limits.`));
  await drawControl(chart, found, signal);
}

/** Draw the form once: what is chosen in it stays while shots arrive. Return what offers the pairs found. */
function exportForm(place, times) {
  const pair = choice("Pair", [["", "all"]]);
  const shots = field("Shots", { maxlength: 400, autocomplete: "off", placeholder: "all, or 3, 5, 8-19" });
  const form = choice("As", FORMATS, "csv");
  const link = h("a", { class: "button main-action", download: true }, "Download");
  const aim = () => {
    const [sphere, surface] = pair.input.value ? JSON.parse(pair.input.value) : [];
    link.href = withQuery("/v1/results/export", { format: form.input.value, sphere, surface, shots: shots.input.value.trim(), ...times() });
  };
  for (const one of [pair, shots, form]) one.input.addEventListener("input", aim);
  fill(place, h("h2", { id: "export-title" }, "Take away"),
    h("p", { class: "soft" }, "The shots of the period above. A table has one line a shot with its modulus, uncertainty and advice. Its header states the selection."),
    h("div", { class: "filters" }, pair, shots, form), h("div", { class: "row" }, link));
  return (pairs) => {
    const options = new Map([["", "all"], ...pairs.map((one) => [JSON.stringify([one.sphere, one.surface]), materials(one.sphere, one.surface)])]);
    const chosen = pair.input.value;
    if (!options.has(chosen)) options.set(chosen, `${materials(...JSON.parse(chosen))} (no shot in this period)`);
    fill(pair.input, [...options].map(([value, words]) => h("option", { value, selected: value === chosen }, words)));
    aim();
  };
}
