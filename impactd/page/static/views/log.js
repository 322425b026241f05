// The log: who asked for what and what came of it; alarms that were seen; who is signed in.

import { get } from "../js/api.js";
import { fill, h, withCode } from "../js/dom.js";
import { on } from "../js/live.js";
import { moment } from "../js/numbers.js";
import { end, session } from "../js/session.js";
import { eventSentence } from "../js/words.js";
import { severityBadge } from "../parts/alarms.js";
import { manualLink } from "../parts/nav.js";
import { choice } from "../parts/fields.js";
import { tell } from "../parts/notices.js";

const KINDS = [["both", "everything"], ["people", "what people asked for"], ["results", "what came of it"]];

export async function showLog(place, { signal }) {
  const about = choice("Show", KINDS, "both");
  const list = h("section", { class: "card", "aria-label": "Log" });
  const alarms = h("section", { class: "card", "aria-labelledby": "alarms-title" });
  const out = async () => {
    await end().catch((problem) => tell("bad", problem.message));
    window.dispatchEvent(new Event("signed-out"));
  };
  fill(place, h("h1", {}, "Log"),
    h("section", { class: "card", "aria-label": "Signed in" }, h("div", { class: "row spread" },
      h("p", {}, "Signed in with the token ", h("strong", {}, session.name), `, scope ${session.scope}.`),
      h("div", { class: "row" }, manualLink({ class: "button" }), h("button", { class: "button", type: "button", on: { click: out } }, "Sign out")))),
    alarms, h("div", {}, about), list);

  const load = async () => {
    try {
      const page = await get(`/v1/log?limit=50&about=${about.input.value}`);
      if (signal.aborted) return;
      const body = h("tbody");
      fill(list, page.items.length
        ? h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of what happened" }, h("table", {}, h("caption", { class: "unseen" }, "What happened, newest first"),
          h("thead", {}, h("tr", {}, ["When", "What"].map((name) => h("th", { scope: "col" }, name)))), body))
        : h("p", { class: "empty" }, "Nothing has happened yet."));
      add(page, body);
    } catch (problem) {
      fill(list, h("p", { class: "wrong" }, problem.message));
    }
  };
  const add = (page, body) => {
    body.append(...page.items.map((entry) => h("tr", {}, h("td", { class: "when" }, moment(entry.utc)), h("td", {}, eventSentence(entry)))));
    if (!page.next) return;
    const more = h("button", { class: "button", type: "button", on: { click: async () => {
      const next = await get(page.next).catch(() => null);
      more.remove();
      if (next) add(next, body);
    } } }, "Earlier");
    list.append(more);
  };
  const loadAlarms = async () => {
    const found = await get("/v1/alarms").catch(() => null);
    if (!found || signal.aborted) return;
    const seen = found.acknowledged;
    fill(alarms, h("h2", { id: "alarms-title" }, "Alarms"),
      h("p", { class: found.open.length ? "wrong" : "soft" }, found.open.length ? `Open: ${found.open.length}, in the header of every view until acknowledged.` : "None is open."),
      seen.length > 0 && h("details", {}, h("summary", { class: "button" }, `Acknowledged alarms (${seen.length})`),
        h("ul", {}, seen.map((alarm) => h("li", { class: "diagnosis" },
          h("p", {}, severityBadge(alarm), " ", withCode(alarm.sentence)),
          h("p", {}, withCode(alarm.guidance.join(" "))),
          h("p", { class: "soft" }, `${moment(alarm.first_utc)}${alarm.times > 1 ? `, ${alarm.times} times` : ""}; acknowledged by ${alarm.acknowledged_by}, ${moment(alarm.acknowledged_utc)}`))))));
  };
  about.input.addEventListener("change", load, { signal });
  on("happened", ({ kind }) => { if (kind.startsWith("alarm.")) loadAlarms(); }, signal);
  await Promise.all([load(), loadAlarms()]);
}
