// What must be seen on every view: a lost line, alarms until they are acknowledged, what just happened.

import { get, post } from "../js/api.js";
import { byId, fill, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { clock, moment } from "../js/numbers.js";
import { may } from "../js/session.js";
import { eventSentence } from "../js/words.js";

const PASSING_MS = 12000;

let open = [];
let answered = [];
let passing = [];
let lost = null;
let standing = [];
let known = () => false;

/** Keep the notices up to date; `signedIn` says whether alarms may be asked for. */
export function startNotices(signedIn) {
  known = signedIn;
  on("lost", () => {
    lost = live.seenAt ? `The screen shows the state at ${clock(live.seenAt)}.` : "No answer has arrived yet.";
    draw();
  });
  on("found", () => {
    if (lost) tell("info", "The connection is back; the screen is up to date.", { passing: true });
    lost = null;
    if (known()) showNotices();
    else draw();
  });
  on("status", (status) => { standing = status.alarms ?? []; draw(); });
  on("happened", (data) => {
    if (data.kind.startsWith("alarm.") && known()) showNotices();
    // At once, on whatever view: the sphere may still be in the hand.
    if (data.kind === "shot.unlike") tell("warn", eventSentence({ kind: data.kind, data }));
  });
}

/** Ask for the alarms and show them. */
export async function showNotices() {
  try {
    const found = await get("/v1/alarms");
    open = found.open;
    answered = found.acknowledged;
  } catch {
    // The light says that the daemon does not answer.
  }
  draw();
}

/** Show a sentence on top of every view: `kind` is info, warn or bad. */
export function tell(kind, sentence, { passing: brief = false } = {}) {
  const one = { kind, sentence };
  passing = [...passing.filter((other) => other.sentence !== sentence), one].slice(-3);
  if (brief) setTimeout(() => dismiss(one), PASSING_MS);
  draw();
}

function dismiss(one) {
  passing = passing.filter((other) => other !== one);
  draw();
}

let drawn = "";

function draw() {
  const signedIn = known();
  // The sentence of an alarm that somebody has seen needs no second mention.
  const told = new Set([...open, ...answered].map((alarm) => alarm.sentence));
  const notes = signedIn ? standing.filter((sentence) => !told.has(sentence)) : [];
  const alarms = signedIn ? open : [];
  // Drawn only when something changed: a button must not vanish under a finger.
  const now = JSON.stringify([lost, alarms, passing.map((one) => one.sentence), notes]);
  if (now === drawn) return;
  drawn = now;
  fill(
    byId("notices"),
    lost && h("div", { class: "notice bad", role: "alert" },
      h("div", {}, h("strong", {}, "The connection is lost. "), lost, " The page tries again every 2 s.")),
    [...alarms].sort((a, b) => a.severity.localeCompare(b.severity)).map(alarmNotice),
    passing.map((one) => h("div", { class: `notice ${one.kind}`, role: one.kind === "bad" ? "alert" : "status" },
      h("div", {}, one.sentence),
      h("button", { class: "button", type: "button", on: { click: () => dismiss(one) } }, "Close"))),
    notes.map((sentence) => h("div", { class: "notice warn" }, h("div", {}, sentence))),
  );
}

function alarmNotice(alarm) {
  const often = alarm.times > 1 ? `, ${alarm.times} times since ${moment(alarm.first_utc)}` : "";
  const acknowledge = async (event) => {
    event.currentTarget.disabled = true;
    try {
      await post(`/v1/alarms/${alarm.id}/acknowledge`);
    } catch (problem) {
      tell("bad", problem.message);
    }
    await showNotices();
    byId("main").focus({ preventScroll: true });
  };
  const major = alarm.severity === "major";
  return h("div", { class: `notice ${major ? "bad" : "warn"}`, role: "alert", data: { severity: alarm.severity } },
    h("div", {},
      h("p", {}, h("strong", {}, major ? "Alarm. " : "Minor alarm. "), alarm.sentence),
      alarm.remedy && h("p", {}, alarm.remedy),
      h("p", { class: "soft" }, `${moment(alarm.last_utc)}${often}`)),
    may("operate") && h("button", { class: "button", type: "button", on: { click: acknowledge }, "aria-label": `Acknowledge: ${alarm.sentence}` }, "Acknowledge"));
}
