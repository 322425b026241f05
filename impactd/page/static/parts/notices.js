// What must be seen on every view: a lost line, what needs attention, what just happened. Alarms: `alarms.js`.

import { byId, fill, h } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { clock } from "../js/numbers.js";
import { eventSentence } from "../js/words.js";

const PASSING_MS = 12000;

let passing = [];
let lost = null;
let standing = [];
let said = "";
let known = () => false;

/** Keep the notices up to date; `signedIn` says whether anybody may read what needs attention. */
export function startNotices(signedIn) {
  known = signedIn;
  on("lost", () => {
    lost = live.seenAt ? `The screen shows the state at ${clock(live.seenAt)}.` : "No answer has arrived yet.";
    draw();
  });
  on("found", () => {
    if (lost) tell("info", "The connection is back; the screen is up to date.", { passing: true });
    lost = null;
    draw();
  });
  on("status", ({ alarms, ready, sentence }) => {
    // What the light says of a rig that is ready is not said twice; nor does it come and go with each drop.
    if (ready) said = sentence.toLowerCase();
    standing = (alarms ?? []).filter((one) => !said.includes(one.toLowerCase().replace(/\.$/, "")));
    draw();
  });
  on("happened", (data) => {
    // At once, on whatever view: the sphere may still be in the hand.
    if (data.kind === "shot.unlike") tell("warn", eventSentence({ kind: data.kind, data }));
  });
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
  const notes = known() ? standing : [];
  // Drawn only when something changed: a button must not vanish under a finger.
  const now = JSON.stringify([lost, passing.map((one) => one.sentence), notes]);
  if (now === drawn) return;
  drawn = now;
  fill(
    byId("notices"),
    lost && h("div", { class: "notice bad", role: "alert" },
      h("div", {}, h("strong", {}, "The connection is lost. "), lost, " The page tries again every 2 s.")),
    passing.map((one) => h("div", { class: `notice ${one.kind}`, role: one.kind === "bad" ? "alert" : "status" },
      h("div", {}, one.sentence),
      h("button", { class: "button", type: "button", on: { click: () => dismiss(one) } }, "Close"))),
    notes.map((sentence) => h("div", { class: "notice warn" }, h("div", {}, sentence))),
  );
}
