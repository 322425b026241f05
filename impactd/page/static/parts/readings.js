// Temperature and humidity as somebody reads them, for one press of the button; both optional.

import { h } from "../js/dom.js";
import { field } from "./fields.js";

const KINDS = [
  { key: "temperature_C", name: "Temperature", unit: "°C", unitOfU: "K", scale: 1 },
  { key: "relative_humidity", name: "Relative humidity", unit: "%", unitOfU: "%", scale: 0.01 },
];

const number = (label) => field(label, { type: "number", inputmode: "decimal", step: "any" });

/** Return the fields; a sensor of the rig counts where they are empty. */
export function readings() {
  const rows = KINDS.map((kind) => ({
    ...kind,
    value: number(`${kind.name} / ${kind.unit}`),
    u: number(`Uncertainty of ${kind.name.toLowerCase()} / ${kind.unitOfU}`),
  }));
  const inputs = rows.flatMap(({ value, u }) => [value.input, u.input]);
  const element = h("details", { class: "readings" },
    h("summary", {}, "Temperature and humidity, if you read them"),
    rows.map(({ value, u }) => h("div", { class: "pair" }, value, u)),
    h("p", { class: "soft" }, "The uncertainty is a standard one: 0.2 K for a thermometer that is accurate to 0.4 °C. It counts for this drop only."));

  return {
    element,
    inputs,
    /** Return { environment }, or nothing where nothing was read. */
    chosen() {
      const given = rows.filter(({ value }) => value.input.value !== "");
      const scaled = (input, scale) => Number((Number(input.value) * scale).toPrecision(9));
      const read = given.map(({ key, scale, value, u }) => [key, { value: scaled(value.input, scale), u: scaled(u.input, scale) }]);
      return read.length ? { environment: Object.fromEntries(read) } : {};
    },
    /** Return { input, words } of what is missing beside what was given, else null. */
    missing() {
      for (const { name, value, u } of rows) {
        if (value.input.value !== "" && !(Number(u.input.value) > 0)) return { input: u.input, words: `A ${name.toLowerCase()} needs its standard uncertainty.` };
        if (value.input.value === "" && u.input.value !== "") return { input: value.input, words: `The ${name.toLowerCase()} itself is missing.` };
      }
      return null;
    },
    clear() { for (const input of inputs) input.value = ""; },
  };
}
