// The history: search, filter, choose several to compare or to diagnose.

import { get, withQuery } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { columnUnit, measured, millimetres, moment } from "../js/numbers.js";
import { may } from "../js/session.js";
import { ADVICE, material, materials } from "../js/words.js";
import { choice, field } from "../parts/fields.js";

const PAGE = 25;
const TYPING_MS = 300;
const chosen = new Set(); // kept while one looks at a shot and comes back

export async function showShots(place, { signal }) {
  const search = field("Search", { type: "search", placeholder: "number, material, operator", maxlength: 64 });
  const sphere = choice("Sphere", [["", "all"]]);
  const surface = choice("Surface", [["", "all"]]);
  const since = field("From", { type: "date" });
  const until = field("Until", { type: "date" });
  const advice = choice("Advice", [["", "all"], ["use", "use"], ["check", "check"], ["repeat", "repeat"]]);
  search.classList.add("wide");
  const list = h("section", { class: "card", "aria-label": "Shots" });
  const withChosen = h("div", { class: "row", role: "group", "aria-label": "With the chosen shots" });
  fill(place, h("h1", {}, "Shots"),
    h("form", { class: "card filters", role: "search", on: { submit: (event) => event.preventDefault() } }, search, sphere, surface, advice, since, until),
    withChosen, list);

  const showChosen = () => {
    const numbers = [...chosen].sort((a, b) => a - b).join(",");
    const none = chosen.size === 0;
    fill(withChosen,
      h("p", { class: "soft", "aria-live": "polite" }, none ? "Choose shots to compare or to diagnose them." : `${chosen.size} chosen`),
      chosen.size > 1 && h("a", { class: "button", href: `#/compare/${numbers}` }, "Compare traces"),
      !none && may("operate") && h("a", { class: "button", href: `#/diagnoses?shots=${numbers}` }, "Diagnose"),
      !none && h("button", { class: "button", type: "button", on: { click: () => { chosen.clear(); load(); } } }, "Choose none"));
  };

  let body = null;
  let unit = null;
  let turn = 0;
  const query = () => ({
    summary: "true", limit: PAGE, search: search.input.value.trim(), sphere: sphere.input.value, surface: surface.input.value,
    since: since.input.value, until: dayAfter(until.input.value),
  });
  const nothing = () => {
    const { search: words, sphere: ball, surface: coupon, since: from, until: to } = query();
    return words || ball || coupon || from || to ? "No shot fits this search." : "No shot yet: make one under Drop.";
  };
  const wanted = (shot) => !advice.input.value || shot.advice === advice.input.value;

  const load = async () => {
    const mine = (turn += 1);
    try {
      const page = await get(withQuery("/v1/shots", query()));
      if (mine !== turn || signal.aborted) return;
      body = h("tbody");
      unit = columnUnit(page.items.map((shot) => shot.reduced_modulus_Pa));
      fill(list);
      if (!page.items.length) {
        fill(list, h("p", { class: "empty" }, nothing()));
      } else {
        fill(list, h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of shots" }, h("table", {}, h("caption", { class: "unseen" }, "Shots, newest first"), head(unit[1]), body)));
        add(page);
      }
    } catch (problem) {
      fill(list, h("p", { class: "wrong" }, problem.message));
    }
    showChosen();
  };

  const add = (page) => {
    body.append(...page.items.filter(wanted).map((shot) => row(shot, unit[0], showChosen)));
    if (!body.hasChildNodes() && !page.next) body.append(h("tr", {}, h("td", { colspan: 8 }, "No shot fits this search.")));
    if (!page.next) return;
    const more = h("button", { class: "button", type: "button", on: { click: async () => {
      more.disabled = true;
      const next = await get(page.next).catch(() => null);
      more.remove();
      if (next) add(next);
    } } }, "Older shots");
    list.append(more);
  };

  let typing = null;
  const later = () => { clearTimeout(typing); typing = setTimeout(load, TYPING_MS); };
  search.input.addEventListener("input", later, { signal });
  for (const one of [sphere, surface, since, until, advice]) one.input.addEventListener("change", load, { signal });
  on("happened", ({ kind }) => { if (kind === "drop.analysed" || kind === "drop.stored") later(); }, signal);
  on("found", later, signal);
  showChosen();
  await load();
  const rig = await get("/v1/rig").catch(() => null);
  if (!rig || signal.aborted) return;
  sphere.input.append(...rig.spheres.map(({ name }) => h("option", { value: name }, material(name))));
  surface.input.append(...rig.surfaces.map(({ name }) => h("option", { value: name }, material(name))));
}

/** A day is chosen to its end: the API wants the first moment that is too late. */
function dayAfter(day) {
  if (!day) return "";
  const next = new Date(`${day}T00:00:00Z`);
  next.setUTCDate(next.getUTCDate() + 1);
  return next.toISOString().slice(0, 10);
}

function head(unit) {
  const cell = (name, more) => h("th", { scope: "col", ...more }, name);
  return h("thead", {}, h("tr", {},
    cell(h("span", { class: "unseen" }, "Choose")), cell("Shot"), cell("Dropped"), cell("Height", { class: "number" }),
    cell(`E* ± U (95 %) / ${unit}`, { class: "number" }), cell("Advice"), cell("Operator", { class: "hide-middle" }), cell("When", { class: "hide-narrow" })));
}

function row(shot, scale, changed) {
  const choose = (event) => {
    if (event.target.checked) chosen.add(shot.number);
    else chosen.delete(shot.number);
    changed();
  };
  const advice = ADVICE[shot.advice];
  return h("tr", {},
    h("td", {}, h("label", { class: "check" }, h("span", { class: "unseen" }, `Choose shot ${shot.number}`), h("input", { type: "checkbox", checked: chosen.has(shot.number), on: { change: choose } }))),
    h("th", { scope: "row" }, h("a", { class: "shot-link", href: `#/shots/${shot.number}` }, String(shot.number))),
    h("td", {}, materials(shot.sphere, shot.surface)),
    h("td", { class: "number" }, millimetres(shot.drop_height_m)),
    h("td", { class: "number" }, shot.advice === "repeat" ? "–" : measured(shot.reduced_modulus_Pa, scale)),
    h("td", {}, advice ? h("span", { class: `badge ${advice.badge}` }, h("span", { "aria-hidden": "true" }, advice.sign), advice.word) : h("span", { class: "badge" }, "not fitted")),
    h("td", { class: "hide-middle" }, shot.operator || "–"),
    h("td", { class: "hide-narrow" }, moment(shot.started_utc).replace(/ (?=.*,)/g, "\u00a0")));
}
