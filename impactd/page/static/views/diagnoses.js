// Diagnoses: what a model misses, and why. Start one, watch it, cancel it, read its report.

import { get, post } from "../js/api.js";
import { fill, freshKey, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { here } from "../js/router.js";
import { may } from "../js/session.js";
import { UNDER_WAY, diagnosis } from "../parts/diagnosis.js";
import { choice, field } from "../parts/fields.js";
import { tell } from "../parts/notices.js";

const WATCH_MS = 1500;

export async function showDiagnoses(place, { signal }) {
  const list = h("section", { class: "card", "aria-label": "All diagnoses" });
  fill(place, h("h1", {}, "Diagnoses"), may("operate") && startForm(() => load()), list);
  let timer = null;
  const load = async () => {
    clearTimeout(timer);
    try {
      const page = await get("/v1/diagnoses?limit=30");
      if (signal.aborted) return;
      // Drawn only when something changed: a button must not vanish under a finger.
      const text = JSON.stringify(page.items);
      if (text !== list.dataset.drawn) {
        fill(list, page.items.length ? page.items.map((one) => diagnosis(one, load)) : h("p", { class: "empty" }, "No diagnosis yet. Choose shots of one campaign; several heights and two spheres are best."));
        list.dataset.drawn = text;
      }
      if (page.items.some((one) => UNDER_WAY.includes(one.state))) timer = setTimeout(load, WATCH_MS);
    } catch (problem) {
      if (!list.hasChildNodes()) fill(list, h("p", { class: "wrong" }, problem.message));
      timer = setTimeout(load, 2 * WATCH_MS);
    }
  };
  signal.addEventListener("abort", () => clearTimeout(timer));
  on("happened", ({ kind }) => { if (kind === "diagnosis.done" || kind.startsWith("job.")) load(); }, signal);
  await load();
}

function startForm(started) {
  const given = new URLSearchParams(here().split("?")[1]).get("shots") ?? "";
  const shots = field("Shots", { value: given, required: true, inputmode: "text", maxlength: 400 }, { hint: "Numbers with commas, ranges with a dash: 3, 5, 8-19. You can also choose them in the list of shots." });
  const base = choice("From the model", [["kv2", "Closed KV: a load cell that moves, with all laws of mechanics"], ["kv", "KV: as in the paper"], ["hsd", "HSD: a rigid load cell"]], "kv2");
  const wrong = h("p", { class: "wrong", role: "alert" });
  const submit = async (event) => {
    event.preventDefault();
    wrong.textContent = "";
    const numbers = shotNumbers(shots.input.value);
    if (!numbers) {
      wrong.textContent = "Write numbers of shots with commas between them, for example 3, 5, 8-19.";
      shots.input.focus();
      return;
    }
    try {
      const made = await post("/v1/diagnoses", { shots: numbers, base: base.input.value }, { key: freshKey() });
      tell("info", `Diagnosis ${made.id} has started. It may take some minutes; you can leave this page.`, { passing: true });
      started();
    } catch (problem) {
      wrong.textContent = problem.message;
    }
  };
  return h("form", { class: "card", on: { submit } },
    h("h2", {}, "Start a diagnosis"),
    h("p", { class: "soft" }, "A diagnosis finds what the model misses on these shots. It names the effect if the data allow, and shows the result with the effect in the model."),
    shots, base, wrong, h("div", { class: "row" }, h("button", { class: "button main-action", type: "submit" }, "Start a diagnosis")));
}

/** Return the numbers in "3, 5, 8-19"; null when it is no such list. */
export function shotNumbers(text) {
  const found = new Set();
  for (const part of text.split(/[\s,;]+/).filter(Boolean)) {
    const match = /^(\d{1,9})(?:[-–](\d{1,9}))?$/.exec(part);
    if (!match) return null;
    const [first, last] = [Number(match[1]), Number(match[2] ?? match[1])];
    if (first < 1 || last < first || last - first > 500) return null;
    for (let number = first; number <= last; number += 1) found.add(number);
  }
  return found.size ? [...found].sort((a, b) => a - b) : null;
}
