// Materials: what hangs in the drawer. Change or add spheres and coupons; who did it and when is kept.

import { ask, get } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { concise, moment, significant } from "../js/numbers.js";
import { may } from "../js/session.js";
import { choice, field, quantity, tellWrong } from "../parts/fields.js";
import { tell } from "../parts/notices.js";

const KINDS = {
  spheres: { one: "sphere", title: "Spheres", columns: [["radius_m", "Radius / mm", 1e3], ["mass_kg", "Mass / g", 1e3], ["youngs_modulus_pa", "E / GPa", 1e-9], ["poissons_ratio", "ν", 1]] },
  surfaces: { one: "coupon", title: "Coupons", columns: [["coupon_mass_kg", "Mass / g", 1e3], ["coupon_thickness_m", "Thickness / mm", 1e3], ["youngs_modulus_pa", "E / GPa", 1e-9], ["poissons_ratio", "ν", 1]] },
};
const NEEDED = ["radius_m", "mass_kg", "poissons_ratio"];
const NEED_U = ["poissons_ratio", "youngs_modulus_pa"];

export async function showMaterials(place, { signal }) {
  const editor = h("div", {});
  const lists = h("div", { class: "cards" });
  const changes = h("section", { class: "card", "aria-labelledby": "changes-title" });
  fill(place, h("h1", {}, "Materials"),
    h("p", {}, "The materials that a drop can use. A change counts for later drops and fits; stored fits keep their values. In brackets: the standard uncertainty u (k = 1) of the last digits."),
    editor, lists, changes);
  const load = async () => {
    try {
      const found = await get("/v1/materials");
      if (signal.aborted) return;
      const edit = (kind, material) => { fill(editor, form(kind, material, found.grades, () => { fill(editor); load(); })); editor.querySelector("input")?.focus(); editor.scrollIntoView({ block: "nearest" }); };
      fill(lists, Object.keys(KINDS).map((kind) => list(kind, found[kind], edit)));
      showChanges(changes, found.changes);
    } catch (problem) {
      if (!lists.hasChildNodes()) fill(lists, h("p", { class: "wrong" }, problem.message));
    }
  };
  on("happened", ({ kind }) => { if (kind === "material.changed") load(); }, signal);
  on("found", load, signal);
  await load();
}

function list(kind, materials, edit) {
  const { title, one, columns } = KINDS[kind];
  return h("section", { class: "card", "aria-label": title },
    h("div", { class: "row spread" }, h("h2", {}, title), may("operate") && h("button", { class: "button", type: "button", on: { click: () => edit(kind, null) } }, `Add a ${one}`)),
    h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": `Table of ${title.toLowerCase()}` }, h("table", {},
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Name"), h("td", {}), columns.map(([, name]) => h("th", { scope: "col", class: "number" }, name)), h("th", { scope: "col", class: "hide-narrow" }, "Changed"))),
      h("tbody", {}, materials.map((material) => h("tr", {},
        h("th", { scope: "row" }, material.name, material.entry.reference && h("div", {}, h("span", { class: "badge" }, "reference"))),
        h("td", {}, may("operate") && h("button", { class: "button", type: "button", on: { click: () => edit(kind, material) } }, "Change", h("span", { class: "unseen" }, ` ${material.name}`))),
        columns.map(([key, , scale]) => h("td", { class: "number" }, shown(material.entry[key], scale))),
        h("td", { class: "hide-narrow" }, material.changed_utc ? `${moment(material.changed_utc)}, ${material.changed_by}` : "as in the file")))))));
}

function shown(value, scale) {
  if (value === undefined || value === null) return "–";
  if (typeof value === "number") return significant(value * scale, 6);
  return concise(value.value * scale, value.u * scale);
}

function form(kind, material, grades, done) {
  const { one, columns } = KINDS[kind];
  const entry = material?.entry ?? {};
  const name = field("Name", { value: material?.name ?? "", maxlength: 64, required: true, autocomplete: "off", ...(material ? { readonly: true } : {}) }, { hint: "Letters, digits, _ . -; the name is stored in every shot." });
  const values = columns.map(([key, label, scale]) => [key, quantity({ label, scale, now: entry[key], needed: NEEDED.includes(key), needsU: NEED_U.includes(key) })]);
  const grade = kind === "spheres" ? choice("Grade of the bag", [["", "none"], ...grades.map((key) => [key, key])], entry.batch?.grade ?? "") : null;
  const lot = kind === "spheres" ? field("Lot or certificate", { value: entry.batch?.traceable_to ?? "", maxlength: 200, autocomplete: "off" }) : null;
  const reference = h("input", { type: "checkbox", checked: Boolean(entry.reference) });
  const source = field("Where the values come from", { value: entry.source ?? "", maxlength: 400, required: true, autocomplete: "off" });
  const note = field("Why it is changed", { maxlength: 400, autocomplete: "off" });
  const wrong = h("p", { class: "wrong", role: "alert" });
  const submit = async (event) => {
    event.preventDefault();
    wrong.textContent = "";
    const next = { ...entry };
    try {
      for (const [key, part] of values) {
        const value = part.read();
        if (value === undefined) delete next[key];
        else next[key] = value;
      }
    } catch (error) {
      tellWrong(wrong, error);
      return;
    }
    if (grade) {
      if (grade.input.value) next.batch = { ...(entry.batch ?? {}), grade: grade.input.value, ...(lot.input.value.trim() ? { traceable_to: lot.input.value.trim() } : {}) };
      else delete next.batch;
    }
    next.reference = reference.checked;
    next.source = source.input.value.trim();
    try {
      await ask("PUT", `/v1/materials/${kind}/${encodeURIComponent(name.input.value.trim())}`, { body: { entry: next, note: note.input.value.trim() } });
      tell("info", `${name.input.value.trim()} is saved; later drops and fits use it.`, { passing: true });
      done();
    } catch (problem) {
      wrong.textContent = problem.message;
    }
  };
  return h("form", { class: "card", novalidate: true, "aria-label": material ? `Change ${material.name}` : `Add a ${one}`, on: { submit } },
    h("h2", {}, material ? `Change ${material.name}` : `Add a ${one}`),
    h("div", { class: "material-fields" }, name, values.map(([, part]) => part), grade, lot),
    h("label", { class: "row" }, reference, h("span", {}, "Its modulus counts as known: calibrations may use it")),
    source, note, wrong,
    h("div", { class: "row" },
      h("button", { class: "button main-action", type: "submit" }, "Keep it"),
      h("button", { class: "button", type: "button", on: { click: done } }, "Cancel")));
}

function showChanges(place, changes) {
  fill(place, h("h2", { id: "changes-title" }, "What was changed"),
    changes.length ? h("ul", {}, changes.map((one) => h("li", {}, `${moment(one.utc)}: ${one.by} ${one.before ? "changed" : "added"} ${one.name}${differences(one)}${one.note ? `. ${one.note}` : ""}`))) : h("p", { class: "empty" }, "Nothing yet: all materials are as the file has them."));
}

function differences({ before, after }) {
  if (!before) return "";
  const keys = [...new Set([...Object.keys(before), ...Object.keys(after)])].filter((key) => JSON.stringify(before[key]) !== JSON.stringify(after[key]));
  const plain = (value) => (value === undefined ? "nothing" : typeof value === "object" ? Object.entries(value).map(([key, part]) => (key === "value" ? part : `${key} ${part}`)).join(" ") : String(value));
  return keys.length ? ` (${keys.map((key) => `${key}: ${plain(before[key])} → ${plain(after[key])}`).join("; ")})` : "";
}
