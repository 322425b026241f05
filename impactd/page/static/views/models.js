// Models: which there are, and with which one results are reported.

import { ask, get } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { moment } from "../js/numbers.js";
import { may } from "../js/session.js";
import { modelName } from "../js/words.js";
import { tell } from "../parts/notices.js";

export async function showModels(place, { signal }) {
  const list = h("section", { class: "card", "aria-label": "All models" });
  const history = h("section", { class: "card", "aria-labelledby": "chosen-title" });
  fill(place, h("h1", {}, "Models"),
    h("p", {}, "Every shot is fitted with HSD, KV, the closed KV and the active model; moduli are reported with the active one. Earlier results keep their model."),
    list, history);
  const show = (page) => {
    if (signal.aborted) return;
    fill(list, h("ul", {}, page.items.map((model) => h("li", { class: "diagnosis" }, one(model, show)))),
      !may("admin") && h("p", { class: "soft" }, "Choosing another model needs a token with scope admin."));
    fill(history, h("h2", { id: "chosen-title" }, "Chosen so far"),
      page.history.length ? h("ul", {}, page.history.map((entry) => h("li", {}, `${moment(entry.since_utc)}: ${modelName(entry.name)}`))) : h("p", { class: "soft" }, "Nobody has chosen a model yet; the program uses its default."));
  };
  const load = async () => {
    try {
      show(await get("/v1/models"));
    } catch (problem) {
      fill(list, h("p", { class: "wrong" }, problem.message));
    }
  };
  on("happened", ({ kind }) => { if (kind === "model.chosen" || kind === "diagnosis.done") load(); }, signal);
  await load();
}

function one(model, show) {
  const choose = async () => {
    try {
      const body = model.version === null ? { name: model.name } : { name: model.name, version: model.version };
      show(await ask("PUT", "/v1/models/active", { body }));
      tell("info", `${modelName(model.name)} is the active model from now on.`, { passing: true });
    } catch (problem) {
      tell("bad", problem.message);
    }
  };
  const from = model.provenance?.diagnosis;
  return [
    h("div", { class: "row spread" },
      h("div", { class: "row" },
        h("h2", {}, modelName(model.name), model.version === null ? null : h("span", { class: "soft" }, ` version ${model.version}`)),
        model.active && h("span", { class: "badge good" }, h("span", { "aria-hidden": "true" }, "✓"), "active")),
      !model.active && may("admin") && h("button", { class: "button", type: "button", on: { click: choose } }, "Make active", h("span", { class: "unseen" }, `: ${modelName(model.name)}`))),
    h("p", { class: "soft" }, model.about ?? `Found by diagnosis ${from ?? "?"} on ${moment(model.created_utc)}.`),
  ];
}
