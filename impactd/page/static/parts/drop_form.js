// What to drop on what, from how high, by whom and how often.

import { h } from "../js/dom.js";
import { millimetres } from "../js/numbers.js";
import { recall, remember } from "../js/memory.js";
import { may, session } from "../js/session.js";
import { material } from "../js/words.js";
import { field, stepper, tiles } from "./fields.js";
import { readings } from "./readings.js";

const MOST_DROPS = 50;

/** Return the form, filled with what was dropped last; `onGo(request, count, note)` gets what was chosen. */
export function dropForm(rig, latest, onGo) {
  const before = recall("drop", latest ?? {});
  const low = rig.min_drop_height_m * 1e3;
  const high = rig.max_drop_height_m * 1e3;
  const known = (list, name) => (list.some((one) => one.name === name) ? name : list[0]?.name);
  const height = stepper({ label: "Drop height", unit: "mm", value: within(before.drop_height_m * 1e3 || 30, low, high), min: low, max: high, step: 1, hint: `${millimetres(rig.min_drop_height_m)} to ${millimetres(rig.max_drop_height_m)}` });
  const count = stepper({ label: "Drops", unit: "", value: 1, min: 1, max: MOST_DROPS, step: 1, hint: `1 to ${MOST_DROPS}` });
  const operator = field("Operator", { value: recall("operator", session.name ?? ""), maxlength: 64, required: true, autocomplete: "name" });
  const around = readings();
  const note = field("Note", { maxlength: 400, autocomplete: "off" });
  const wrong = h("p", { class: "wrong", role: "alert" });
  const go = h("button", { class: "button main-action large", type: "submit" }, "Arm and drop");

  const chosen = () => {
    const data = new FormData(form);
    return {
      sphere: data.get("sphere"),
      surface: data.get("surface"),
      drop_height_m: Number((Number(height.input.value) / 1e3).toPrecision(9)),
      operator: operator.input.value.trim(),
    };
  };
  const check = () => {
    const mm = Number(height.input.value);
    const drops = Number(count.input.value);
    for (const input of [height.input, count.input, operator.input, ...around.inputs]) input.removeAttribute("aria-invalid");
    if (!(mm >= low && mm <= high)) return fault(height.input, `This rig drops from ${millimetres(rig.min_drop_height_m)} to ${millimetres(rig.max_drop_height_m)}.`);
    if (!(Number.isInteger(drops) && drops >= 1 && drops <= MOST_DROPS)) return fault(count.input, `A series has 1 to ${MOST_DROPS} drops.`);
    if (!operator.input.value.trim()) return fault(operator.input, "Who hangs the sphere? A name or initials are kept with the shot.");
    const missing = around.missing();
    if (missing) return fault(missing.input, missing.words);
    return true;
  };
  const fault = (input, words) => {
    wrong.textContent = words;
    input.setAttribute("aria-invalid", "true");
    input.focus();
    return false;
  };
  const submit = (event) => {
    event.preventDefault();
    wrong.textContent = "";
    if (go.getAttribute("aria-disabled") === "true" || !check()) return;
    const request = chosen();
    remember("drop", request);
    remember("operator", request.operator);
    onGo({ ...request, ...around.chosen() }, Number(count.input.value), note.input.value.trim());
    around.clear(); // what the room was like then says nothing of the next time
  };

  const form = h("form", { class: "card drop-form", novalidate: true, on: { submit } },
    h("h2", {}, "What is dropped"),
    tiles({ legend: "Sphere", name: "sphere", value: known(rig.spheres, before.sphere), options: rig.spheres.map((one) => ({ value: one.name, name: material(one.name), detail: millimetres(one.diameter_m) })) }),
    tiles({ legend: "Surface", name: "surface", value: known(rig.surfaces, before.surface), options: rig.surfaces.map((one) => ({ value: one.name, name: material(one.name), detail: one.reference ? "reference" : null })) }),
    h("div", { class: "pair" }, height, count),
    operator,
    around.element,
    h("details", { class: "readings" }, h("summary", {}, "A note, for a series of drops"), note),
    h("div", { class: "go" }, wrong, go,
      !may("operate") && h("p", { class: "soft" }, `The token ${session.name} may only look; a drop needs a token with scope operate.`)));

  return {
    form,
    /** Say whether a drop may be asked for, and why not. */
    allow(ready, words, action = "Arm and drop") {
      const fine = ready && may("operate");
      go.setAttribute("aria-disabled", String(!fine));
      go.textContent = fine ? action : words ?? "Not ready";
    },
    say(words) { wrong.textContent = words; },
  };
}

const within = (value, low, high) => Math.min(high, Math.max(low, value));
