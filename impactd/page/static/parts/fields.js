// Fields for gloves: tiles to choose from, numbers to step, words to type.

import { h } from "../js/dom.js";

let last = 0;
const freshId = () => `field-${(last += 1)}`;

/** Return a group of tiles; `options` are { value, name, detail }. */
export function tiles({ legend, name, options, value, onChange }) {
  return h("fieldset", {},
    h("legend", {}, legend),
    h("div", { class: "tiles" }, options.map((option) => h("label", { class: "tile" },
      h("input", { type: "radio", name, value: option.value, checked: option.value === value, on: { change: () => onChange?.(option.value) } }),
      h("span", {}, option.name),
      option.detail && h("small", {}, option.detail)))));
}

/** Return a number with buttons beside it; its `.input` is the field. */
export function stepper({ label, unit, value, min, max, step, coarse = step, hint }) {
  const id = freshId();
  const input = h("input", { id, type: "number", inputmode: "decimal", value, min, max, step: "any", required: true, "aria-describedby": hint ? `${id}-hint` : null });
  const move = (by) => () => {
    const next = Math.round((Number(input.value) + by) / step) * step;
    input.value = Number(Math.min(max, Math.max(min, next)).toFixed(6));
    input.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const what = label.toLowerCase();
  const element = h("div", { class: "stack" },
    h("label", { class: "label", for: id }, unit ? `${label} / ${unit}` : label),
    h("div", { class: "stepper" },
      h("button", { class: "button", type: "button", "aria-label": `Less ${what}`, on: { click: move(-coarse) } }, "−"),
      input,
      h("button", { class: "button", type: "button", "aria-label": `More ${what}`, on: { click: move(coarse) } }, "+")),
    hint && h("p", { class: "soft", id: `${id}-hint` }, hint));
  element.input = input;
  return element;
}

/** Return a labelled field; its `.input` is the field itself. */
export function field(label, attributes = {}, { hint } = {}) {
  const id = freshId();
  const input = h("input", { type: "text", ...attributes, id, "aria-describedby": hint ? `${id}-hint` : null });
  const element = h("div", { class: "stack" },
    h("label", { class: "label", for: id }, label), input,
    hint && h("p", { class: "soft", id: `${id}-hint` }, hint));
  element.input = input;
  return element;
}

/** Return a labelled choice; `options` are [value, words] pairs. */
export function choice(label, options, value = "") {
  const id = freshId();
  const input = h("select", { id }, options.map(([key, words]) => h("option", { value: key, selected: key === value }, words)));
  const element = h("div", { class: "stack" }, h("label", { class: "label", for: id }, label), input);
  element.input = input;
  return element;
}

const asText = (number, scale) => (number === undefined || number === null ? "" : String(Number((number * scale).toPrecision(12))));

/** Return the number of a field in SI, null where it is empty; throw with words and the field as `input`. */
export function numberIn(input, what, scale = 1) {
  const text = input.value.trim().replace(",", ".");
  if (!text) return null;
  if (!Number.isFinite(Number(text))) throw Object.assign(new Error(`${what} is no number.`), { input });
  return Number((Number(text) / scale).toPrecision(12));
}

/** Return a number of SI as a field in another unit; `.input` is the field. */
export function scaled({ label, scale, now, ...attributes }) {
  return field(label, { inputmode: "decimal", autocomplete: "off", maxlength: 24, value: asText(now, scale), ...attributes });
}

/** A value and its standard uncertainty side by side; `.read()` gives the entry's value, undefined where it is empty, or throws with words. */
export function quantity({ label, scale, now, needed = false, needsU = false }) {
  const value = scaled({ label, scale, now: now?.value ?? now });
  const u = scaled({ label: "u (k = 1)", scale, now: now?.u, "aria-label": `Standard uncertainty of ${label}` });
  const element = h("div", { class: "value-u" }, value, u);
  element.read = () => {
    const size = numberIn(value.input, label, scale);
    const sure = numberIn(u.input, `The uncertainty of ${label}`, scale);
    if (size === null && needed) throw Object.assign(new Error(`${label} is needed.`), { input: value.input });
    if (size === null) return undefined;
    if (sure === null) {
      if (needsU) throw Object.assign(new Error(`${label} needs its standard uncertainty.`), { input: u.input });
      return size;
    }
    return { ...(now && typeof now === "object" ? now : {}), value: size, u: sure };
  };
  return element;
}

/** Say what a field's error says, and go to the field. */
export function tellWrong(wrong, error) {
  wrong.textContent = error.message;
  error.input?.setAttribute("aria-invalid", "true");
  error.input?.focus();
}
