// A diagnosis as every view shows it.

import { ask, post } from "../js/api.js";
import { freshKey, h } from "../js/dom.js";
import { moment } from "../js/numbers.js";
import { recall } from "../js/memory.js";
import { may, session } from "../js/session.js";
import { VERDICTS, material, materials, modelName, stateBadge } from "../js/words.js";
import { tell } from "./notices.js";

export const UNDER_WAY = ["queued", "running"];

/** Return a diagnosis: how far it is or what it found, with what can be done about it. */
export function diagnosis(one, changed) {
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
      h("p", { class: "soft" }, `${one.subject.replace(/(?<=from the base )\S+$/, modelName)}, ${moment(one.created_utc)}`)),
    one.sentence && h("p", {}, one.sentence),
    one.reason && !one.sentence && h("p", {}, one.reason),
    one.model && h("p", { class: "soft" }, `It named the model ${modelName(one.model.name)}, version ${one.model.version}.`),
    underWay && progress(one),
    h("div", { class: "row" },
      one.links.report && h("a", { class: "button", href: one.links.report, target: "_blank", rel: "noopener" }, "Read the report", h("span", { class: "unseen" }, ` of diagnosis ${one.id}, in a new tab`)),
      one.links.report_pdf && h("a", { class: "button", href: one.links.report_pdf, target: "_blank", rel: "noopener" }, "One page as PDF", h("span", { class: "unseen" }, ` of diagnosis ${one.id}, in a new tab`)),
      one.links.next_drop && may("operate") && h("button", { class: "button", type: "button", on: { click: nextDrop } }, "Make the proposed drop"),
      underWay && may("operate") && h("button", { class: "button", type: "button", on: { click: cancel } }, "Cancel", h("span", { class: "unseen" }, ` diagnosis ${one.id}`))));
}

function progress({ state, progress: told }) {
  if (!told) return h("p", { class: "soft" }, state === "queued" ? "It is waiting in the queue." : "It has begun.");
  return h("div", { class: "stack" }, h("p", { class: "soft" }, material(told.text)), h("progress", { max: 1, value: told.share, "aria-label": told.text }));
}
