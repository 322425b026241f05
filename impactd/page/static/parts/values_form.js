// What a person measured beside the recordings, as `impactd new --values` has it.

import { fill, h } from "../js/dom.js";
import { choice, field, numberIn, quantity, scaled } from "./fields.js";

// Key of campaign.json, label with unit, scale from SI, and whether it needs its uncertainty.
const SPHERE = [["radius_m", "Radius / mm", 1e3], ["mass_kg", "Mass / g", 1e3], ["youngs_modulus_Pa", "E / GPa", 1e-9, true], ["poissons_ratio", "ν", 1, true]];
const COUPON = [["coupon_mass_kg", "Mass / g", 1e3], ["coupon_thickness_m", "Thickness / mm", 1e3], ["youngs_modulus_Pa", "E / GPa", 1e-9, true], ["poissons_ratio", "ν", 1, true]];
const CELL = [["compliance_m_per_V", "Compliance / (nm/V)", 1e9, true], ["crystal_mass_kg", "Crystal mass / g", 1e3, true], ["crystal_stiffness_N_per_m", "Crystal stiffness / (MN/m)", 1e-6, true], ["crystal_damping_N_s_per_m", "Crystal damping / (N s/m)", 1, true]];

/** Return fields for values beside `shots`; `.read()` gives them as an object, or throws with words and the field. */
export function valuesForm(shots, given, ofRig) {
  const choices = [];
  const refresh = () => choices.forEach((update) => update());
  const stated = shots.map((shot) => given.shots?.[shot.name] ?? given.shots?.[shot.file] ?? {});
  const named = (key) => [...new Set(stated.map((entry) => entry[key]).filter(Boolean))];
  const spheres = things("Sphere", SPHERE, given.spheres, named("sphere"), refresh, ofRig.spheres);
  const coupons = things("Coupon", COUPON, given.surfaces, named("surface"), refresh, ofRig.surfaces, "Leave E of what you want to know empty; a coupon of known E (aluminium, say) is the reference.");
  const cell = columns(CELL, given.sensor);
  const scatter = scaled({ label: "Scatter of the impact speed / %", scale: 100, now: given.release?.speed_repeatability });
  const rows = shots.map((shot, at) => row(shot, stated[at], { spheres, coupons, choices }));
  const element = h("div", { class: "cards" }, spheres, coupons,
    shots.some((shot) => shot.quantity === "voltage") && h("fieldset", { class: "stack" }, h("legend", {}, "Load cell"), h("p", { class: "soft" }, "From its certificate or calibration, each with its standard uncertainty u."), h("div", { class: "material-fields" }, cell.map((one) => one.part))),
    h("fieldset", { class: "stack" }, h("legend", {}, "Which drop was which"),
      h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of the drops" }, h("table", { class: "drops" },
        h("thead", {}, h("tr", {}, ["Shot", "Sphere", "Coupon", "Drop height / mm"].map((head) => h("th", { scope: "col" }, head)))),
        h("tbody", {}, rows.map((one) => one.line)))),
      h("div", { class: "material-fields" }, scatter)));
  refresh();
  element.read = () => ({
    ...given,
    spheres: spheres.read(),
    surfaces: coupons.read(),
    sensor: { ...given.sensor, ...readAll(cell) },
    release: { ...given.release, ...known("speed_repeatability", numberIn(scatter.input, "The scatter of the impact speed", 100)) },
    shots: Object.fromEntries(rows.map((one) => [one.name, one.read()])),
  });
  return element;
}

const UNNAMED = "sphere";

const known = (key, value) => (value === null || value === undefined || value === "" ? {} : { [key]: value });

const columns = (list, entry) => list.map(([key, label, scale, needsU]) => ({ key, part: quantity({ label, scale, now: entry?.[key], needsU }) }));

const readAll = (parts) => Object.assign({}, ...parts.map(({ key, part }) => known(key, part.read())));

/** Spheres or coupons, each with its name and numbers; more can be added, also from the rig's own. */
function things(word, list, given, named, changed, ofRig, hint) {
  let all = [];
  const place = h("div", { class: "stack" });
  const add = (name, entry) => {
    const title = field(`Name of the ${word.toLowerCase()}`, { value: name, maxlength: 64, autocomplete: "off" });
    const parts = columns(list, entry);
    title.input.addEventListener("input", changed);
    const group = h("div", { class: "material-fields", role: "group", "aria-label": `${word} ${all.length + 1}` }, title, parts.map((one) => one.part));
    const blank = () => parts.every(({ part }) => [...part.querySelectorAll("input")].every((input) => !input.value));
    all.push({ group, blank, name: () => title.input.value.trim(), read: () => ({ ...entry, ...readAll(parts) }) });
    place.append(group);
  };
  const entries = Object.entries({ ...Object.fromEntries(named.map((name) => [name, {}])), ...given });
  for (const [name, entry] of entries.length ? entries : [[word === "Sphere" ? UNNAMED : "specimen", {}]]) add(name, entry);
  const more = h("button", { class: "button", type: "button", on: { click: () => { add("", {}); changed(); place.lastChild.querySelector("input").focus(); } } }, `Add a ${word.toLowerCase()}`);
  const rigs = choice(`Take a ${word.toLowerCase()} of the rig`, [["", "choose"], ...ofRig.map(({ name }) => [name, name])]);
  rigs.input.addEventListener("change", () => {
    const taken = ofRig.find(({ name }) => name === rigs.input.value);
    rigs.input.value = "";
    if (!taken) return;
    // It replaces one of its name, and the line that stands for no sphere yet.
    const replaced = all.filter((one) => one.name() === taken.name || ([UNNAMED, ""].includes(one.name()) && one.blank()));
    for (const one of replaced) one.group.remove();
    all = all.filter((one) => !replaced.includes(one));
    add(taken.name, ofCampaign(taken.entry, list));
    changed();
  });
  const element = h("fieldset", { class: "stack" }, h("legend", {}, `${word}s`), hint && h("p", { class: "soft" }, hint), place, h("div", { class: "row" }, more, ofRig.length > 0 && rigs));
  element.all = () => all;
  element.read = () => Object.fromEntries(all.filter((one) => one.name()).map((one) => [one.name(), one.read()]));
  return element;
}

/** A material's numbers under the keys of campaign.json, which differ in the case of their units. */
function ofCampaign(entry, list) {
  const plain = Object.fromEntries(Object.entries(entry).map(([key, value]) => [key.toLowerCase(), value]));
  return Object.assign({}, ...list.map(([key]) => known(key, plain[key.toLowerCase()])));
}

/** One shot's line: which sphere, which coupon, from what height. */
function row(shot, entry, { spheres, coupons, choices }) {
  const pick = (source, word, now) => {
    const input = h("select", { "aria-label": `${word} of ${shot.name}` });
    let chosen = null;
    let name = now;
    // Of several none is taken for granted: a wrong coupon gives a wrong modulus.
    const open = () => (source.all().length > 1 ? 1 : 0);
    input.addEventListener("change", () => { chosen = source.all()[input.selectedIndex - open()] ?? null; name = chosen?.name(); });
    choices.push(() => {
      const all = source.all();
      chosen = all.includes(chosen) ? chosen : all.find((one) => one.name() === name) ?? null; // one of the rig's replaces its namesake
      name = chosen?.name() ?? name;
      fill(input, open() === 1 && h("option", { value: "" }, "choose"), all.map((one) => h("option", { value: one.name() }, one.name() || "unnamed")));
      input.selectedIndex = open() ? all.indexOf(chosen) + 1 : 0;
    });
    return input;
  };
  const sphere = pick(spheres, "Sphere", entry.sphere);
  const coupon = pick(coupons, "Coupon", entry.surface);
  const height = scaled({ label: "", scale: 1e3, now: entry.drop_height_m?.value ?? entry.drop_height_m, placeholder: "mm", "aria-label": `Drop height of ${shot.name} / mm` }).input;
  return {
    name: shot.name,
    line: h("tr", {}, h("th", { scope: "row" }, shot.name), [sphere, coupon, height].map((input) => h("td", {}, input))),
    read: () => ({ ...entry, ...known("sphere", sphere.value), ...known("surface", coupon.value), ...known("drop_height_m", numberIn(height, `The drop height of ${shot.name}`, 1e3)) }),
  };
}
