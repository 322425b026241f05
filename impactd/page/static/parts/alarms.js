// Alarms in the header: the most severe one in a line, and behind it every one with what to do.

import { get, post } from "../js/api.js";
import { byId, fill, h, withCode } from "../js/dom.js";
import { on } from "../js/live.js";
import { moment } from "../js/numbers.js";
import { may } from "../js/session.js";
import { tell } from "./notices.js";

let unfolded = false;
let drawn = "";
let known = () => false;

/** Keep the alarms up to date; `signedIn` says whether they may be asked for. */
export function startAlarms(signedIn) {
  known = signedIn;
  on("happened", ({ kind }) => { if (kind.startsWith("alarm.")) showAlarms(); });
  on("found", showAlarms);
}

/** Ask for the open alarms and show them. */
export async function showAlarms() {
  if (!known()) { draw([]); return; }
  const found = await get("/v1/alarms").catch(() => null); // the light says that nobody answers
  if (found) draw([...found.open].sort((a, b) => a.severity.localeCompare(b.severity)));
}

/** Return how severe an alarm is, in a word and a colour. */
export const severityBadge = ({ severity }) => h("span", { class: `badge ${severity === "major" ? "bad" : "warn"}` }, severity === "major" ? "Major alarm" : "Minor alarm");

function draw(alarms) {
  // Drawn only when something changed: a button must not vanish under a finger.
  const now = JSON.stringify([alarms, may("operate")]);
  if (now === drawn) return;
  drawn = now;
  const place = byId("alarms");
  place.hidden = !alarms.length;
  if (!alarms.length) { unfolded = false; fill(place); return; }
  const [worst, ...others] = alarms;
  const list = h("ul", { id: "alarm-list", hidden: !unfolded }, alarms.map(whole));
  const button = h("button", { class: "button", type: "button", "aria-expanded": String(unfolded), "aria-controls": "alarm-list", on: { click: () => {
    unfolded = !unfolded;
    list.hidden = !unfolded;
    button.setAttribute("aria-expanded", String(unfolded));
  } } }, "What to do");
  place.dataset.severity = worst.severity;
  fill(place,
    h("div", { class: "row" }, severityBadge(worst), h("p", { role: "alert" }, withCode(worst.sentence)),
      others.length > 0 && h("span", { class: "soft" }, `and ${others.length} more`), button),
    list);
}

function whole(alarm) {
  const often = alarm.times > 1 ? `, ${alarm.times} times since ${moment(alarm.first_utc)}` : "";
  const acknowledge = async (event) => {
    event.currentTarget.disabled = true;
    await post(`/v1/alarms/${alarm.id}/acknowledge`).catch((problem) => tell("bad", problem.message));
    await showAlarms();
    byId("main").focus({ preventScroll: true });
  };
  return h("li", { data: { severity: alarm.severity } },
    h("div", {},
      h("p", {}, severityBadge(alarm), " ", h("strong", {}, withCode(alarm.sentence))),
      h("ol", {}, alarm.guidance.map((step) => h("li", {}, withCode(step)))),
      h("p", { class: "soft" }, `${moment(alarm.last_utc)}${often}`)),
    may("operate") && h("button", { class: "button", type: "button", on: { click: acknowledge }, "aria-label": `Acknowledge: ${alarm.sentence}` }, "Acknowledge"));
}
