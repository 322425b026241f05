// A material's modulus as a card: the number, what its uncertainty is made of, and whether it passes.

import { get, withQuery } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { modulus } from "../js/numbers.js";
import { material } from "../js/words.js";
import { budgetsOf, decision } from "./budget.js";
import { choice, field } from "./fields.js";

const STATUS = {
  fitted: ["good", "measured"],
  reference: ["", "reference"],
  withheld: ["warn", "withheld"],
};
const RULES = [
  ["both", "Guard band for pass and for fail"],
  ["acceptance", "Guard band for a pass"],
  ["rejection", "Guard band for a fail"],
  ["simple", "No guard band"],
];

/** Return a function that asks at its first call, and again only after a failure. */
export function once(asked) {
  let answer = null;
  return () => {
    answer ??= asked().catch((problem) => { answer = null; throw problem; });
    return answer;
  };
}

/** Return a material's card; `budgets()`, where there is one, resolves with all budgets when one is unfolded. */
export function modulusCard(name, entry, budgets) {
  const [badge, word] = STATUS[entry.status];
  const young = modulus(entry.youngs_modulus_Pa);
  const plane = modulus(entry.plane_strain_modulus_Pa);
  return h("section", { class: "card", "aria-label": material(name) },
    h("div", { class: "row spread" },
      h("h2", {}, material(name)),
      h("span", { class: `badge ${badge}` }, word)),
    (young || plane) && h("p", { class: "modulus" }, h("small", {}, young ? "E " : "E/(1−ν²) "), young ?? plane),
    young && plane && h("p", { class: "soft" }, `E/(1−ν²) = ${plane}`),
    entry.stated_youngs_modulus_Pa && h("p", { class: "soft" }, `Stated value: ${modulus(entry.stated_youngs_modulus_Pa)}; the value above includes all shots.`),
    entry.reason && h("p", { class: "soft" }, entry.reason),
    (young || plane) && budgets && uncertainty(name, entry, budgets));
}

function uncertainty(name, entry, budgets) {
  const inside = h("div", { class: "cards" });
  const open = async (event) => {
    if (!event.currentTarget.open || inside.hasChildNodes()) return;
    fill(inside, h("p", { class: "soft" }, "Asking …"));
    try {
      const found = await budgets();
      fill(inside, budgetsOf(name, found.moduli[name] ?? {}),
        entry.side === "surface" && limitForm(name),
        h("div", { class: "row not-printed" }, h("button", { class: "button", type: "button", on: { click: () => window.print() } }, "Print, or save as PDF")));
    } catch (problem) {
      fill(inside, h("p", { class: "wrong", role: "alert" }, problem.message));
      // The next opening asks again.
      event.target.addEventListener("toggle", () => fill(inside), { once: true });
    }
  };
  return h("details", { on: { toggle: open } },
    h("summary", {}, "Uncertainty budget", h("span", { class: "unseen" }, `: ${material(name)}`)),
    inside);
}

function limitForm(name) {
  const specimen = name.replace(/^surface:/, "");
  const lower = field("At least / GPa", { inputmode: "decimal", maxlength: 20, autocomplete: "off" });
  const upper = field("At most / GPa", { inputmode: "decimal", maxlength: 20, autocomplete: "off" });
  const rule = choice("Decision rule", RULES, "both");
  const said = h("div", {});
  const pascals = ({ input }) => (input.value.trim() ? Number(input.value.replace(",", ".")) * 1e9 : null);
  const submit = async (event) => {
    event.preventDefault();
    const [low, high] = [pascals(lower), pascals(upper)];
    const wrong = (text) => fill(said, h("p", { class: "wrong", role: "alert" }, text));
    if (low === null && high === null) { wrong("Give a limit."); return; }
    if (Number.isNaN(low) || Number.isNaN(high)) { wrong("A limit is a number in GPa, for example 2.2."); return; }
    try {
      const found = await get(withQuery("/v1/moduli/budget", { specimen, lower_Pa: low, upper_Pa: high, rule: rule.input.value }));
      const budget = Object.values(found.moduli)[0].youngs_modulus_Pa;
      fill(said, decision(budget.conformity));
    } catch (problem) {
      wrong(problem.message);
    }
  };
  return h("form", { class: "stack limits", "aria-label": `Limits for E of ${material(name)}`, on: { submit } },
    h("h3", {}, "Does E pass?"),
    h("div", { class: "filters" }, lower, upper, rule),
    h("div", { class: "row not-printed" }, h("button", { class: "button", type: "submit" }, "Decide")),
    said);
}
