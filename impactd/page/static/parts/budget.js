// What a modulus' uncertainty is made of: what all shots share apart from what more shots lessen.

import { h } from "../js/dom.js";
import { modulus, modulusUnit, significant } from "../js/numbers.js";

const NAMES = { youngs_modulus_Pa: "E", plane_strain_modulus_Pa: "E/(1−ν²)" };
const GROUPS = [
  [true, "Common to all shots: repetitions do not reduce it"],
  [false, "Of the single shots: more shots reduce it"],
];
// The share comes first: a tablet shows the first columns, and the others when it is pushed aside.
const HEAD = ["Input", "Share", "Value", "u", "Distribution", "Sensitivity", "Contribution", "Degrees of freedom", "Traceable to"];
const WORDS = [0, 4, 8];
const SHOWN_SHARE = 1e-3;

const DECISIONS = {
  pass: { sign: "✓", advice: "use", word: "Pass" },
  undecided: { sign: "!", advice: "check-it", word: "Undecided" },
  fail: { sign: "✕", advice: "repeat", word: "Fail" },
};

const percent = (value) => `${significant(100 * value, 2)} %`;
const share = (value) => `${(100 * value).toFixed(1)} %`;

/** Return the budgets of one material, Young's modulus first. */
export function budgetsOf(name, budgets) {
  return Object.keys(NAMES).filter((key) => budgets[key]).map((key) => one(NAMES[key], name, budgets[key]));
}

/** Return whether a modulus passes, in words, a sign and a colour. */
export function decision(found) {
  const { sign, advice, word } = DECISIONS[found.decision];
  return h("div", { class: `advice ${advice}`, role: "status", data: { decision: found.decision } },
    h("p", {}, h("strong", {}, h("span", { "aria-hidden": "true" }, `${sign} `), `${word}. `), found.sentence));
}

function one(symbol, name, budget) {
  return h("section", { class: "stack budget", "aria-label": `Budget of ${symbol} of ${name}` },
    h("h3", {}, `${symbol} = ${modulus(budget)} (95 %)`),
    h("p", { class: "improve" }, budget.improve),
    h("p", { class: "soft" }, `u = ${percent(budget.relative_u)}: ${percent(budget.relative_u_common)} common to all shots, ${percent(budget.relative_u_averaged)} reduced by more shots.`),
    h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": `Table of the budget of ${symbol}` },
      h("table", {},
        h("caption", { class: "unseen" }, `Uncertainty budget of ${symbol} of ${name}`),
        h("thead", {}, h("tr", {}, HEAD.map((word, index) => h("th", { scope: "col", class: WORDS.includes(index) ? null : "number" }, word)))),
        GROUPS.map(([common, words]) => group(words, budget.rows.filter((row) => row.common === common))))));
}

function group(words, rows) {
  if (!rows.length) return null;
  const large = rows.filter((row) => row.share >= SHOWN_SHARE);
  const small = rows.length - large.length;
  const together = rows.reduce((sum, row) => sum + row.share, 0);
  return h("tbody", {},
    h("tr", {}, h("th", { scope: "rowgroup", colspan: HEAD.length, class: "group" }, words)),
    large.map(line),
    h("tr", {},
      h("th", { scope: "row" }, small ? `Together, with ${small} smaller` : "Together"),
      h("td", { class: "number" }, share(together)),
      h("td", { colspan: HEAD.length - 2 })));
}

/** Return a number of a row with its unit; pascals as one reads them. */
function inUnit(value, row, digits) {
  if (value === null) return "–";
  if (row.unit !== "Pa") return `${significant(value, digits)}${row.unit === "1" ? "" : ` ${row.unit}`}`;
  const [scale, unit] = modulusUnit(row.value ?? value);
  return `${significant(value * scale, digits)} ${unit}`;
}

function line(row) {
  const unit = row.unit === "1" ? "" : ` ${row.unit}`;
  const number = (text) => h("td", { class: "number" }, text);
  return h("tr", {},
    h("th", { scope: "row" }, row.label),
    h("td", { class: "number" }, h("progress", { max: 1, value: row.share, "aria-hidden": "true" }), share(row.share)),
    number(inUnit(row.value, row, 6)),
    number(inUnit(row.u, row, 2)),
    h("td", {}, row.distribution),
    number(row.sensitivity === null ? "–" : `${significant(row.sensitivity)}${row.sensitivity_to === "logarithm" || !unit ? "" : ` per${unit}`}`),
    number(percent(row.contribution)),
    number(row.degrees_of_freedom === null ? "∞" : significant(row.degrees_of_freedom, 3)),
    h("td", {}, row.traceable_to ?? (row.common ? "not stated" : "–")));
}
