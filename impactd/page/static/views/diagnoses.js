// Diagnoses: what a model misses, and why. Start one, watch it, cancel it, read its report.

import { ask, get, post } from "../js/api.js";
import { fill, freshKey, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { moment } from "../js/numbers.js";
import { recall } from "../js/memory.js";
import { here } from "../js/router.js";
import { may, session } from "../js/session.js";
import { VERDICTS, material, materials, modelName, stateBadge } from "../js/words.js";
import { choice, field } from "../parts/fields.js";
import { tell } from "../parts/notices.js";

const WATCH_MS = 1500;
const UNDER_WAY = ["queued", "running"];

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

function diagnosis(one, changed) {
  const cancel = async () => {
    try {
      await ask("DELETE", `/v1/diagnoses/${one.id}`);
    } catch (problem) {
      tell("bad", problem.message);
    }
    changed();
  };
  const nextDrop = async () => {
    try {
      const drop = await post(`/v1/diagnoses/${one.id}/next-drop`, { operator: recall("operator", session.name) }, { key: freshKey() });
      tell("info", `Drop ${drop.number}: ${materials(drop.sphere, drop.surface)}.`, { passing: true });
      location.hash = "#/rig";
    } catch (problem) {
      tell("bad", problem.message);
    }
  };
  const underWay = UNDER_WAY.includes(one.state);
  return h("article", { class: "diagnosis", "aria-label": `Diagnosis ${one.id}` },
    h("div", { class: "row spread" },
      h("div", { class: "row" }, h("h2", {}, `Diagnosis ${one.id}`), h("span", { class: `badge ${stateBadge(one.state)}` }, one.verdict ? VERDICTS[one.verdict] ?? one.verdict : one.state)),
      h("p", { class: "soft" }, `${one.subject.replace(/\S+$/, modelName)}, ${moment(one.created_utc)}`)),
    one.sentence && h("p", {}, one.sentence),
    one.reason && !one.sentence && h("p", {}, one.reason),
    one.model && h("p", { class: "soft" }, `It named the model ${modelName(one.model.name)}, version ${one.model.version}.`),
    underWay && progress(one),
    h("div", { class: "row" },
      one.links.report && h("a", { class: "button", href: one.links.report, target: "_blank", rel: "noopener" }, "Read the report", h("span", { class: "unseen" }, ` of diagnosis ${one.id}, in a new tab`)),
      one.links.next_drop && may("operate") && h("button", { class: "button", type: "button", on: { click: nextDrop } }, "Make the proposed drop"),
      underWay && may("operate") && h("button", { class: "button", type: "button", on: { click: cancel } }, "Cancel", h("span", { class: "unseen" }, ` diagnosis ${one.id}`))));
}

function progress({ state, progress: told }) {
  if (!told) return h("p", { class: "soft" }, state === "queued" ? "It is waiting in the queue." : "It has begun.");
  return h("div", { class: "stack" }, h("p", { class: "soft" }, material(told.text)), h("progress", { max: 1, value: told.share, "aria-label": told.text }));
}
