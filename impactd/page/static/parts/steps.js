// How far a drop is, as seven steps, and what a person has to do now.

import { get } from "../js/api.js";
import { fill, h, say } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { material, materials } from "../js/words.js";

const STEPS = ["Hang the sphere", "Check the input", "Arm", "Fall", "Record", "Store", "Fit"];
const BY_RIG = { LOADING: 0, CHECKING: 1, ARMING: 2, ARMED: 2, RELEASED: 3, CAPTURING: 4, STORING: 5 };
const BY_DROP = { requested: 0, arming: 2, armed: 2, released: 3, capturing: 4, storing: 5, stored: 6, analysed: 7 };
const ENDED = ["analysed", "failed", "aborted", "interrupted"];

/** Return whether nothing more will become of a drop. */
export const hasEnded = (drop) => ENDED.includes(drop.state) || (drop.state === "stored" && drop.problem);

/** Show a drop in `place` until it has ended; resolve with it, or with null when the signal ends first. */
export function watchDrop(place, number, signal) {
  return new Promise((resolve) => {
    let spoken = "";
    let busy = false;
    let again = false;

    const look = async () => {
      if (signal.aborted) return;
      if (busy) { again = true; return; }
      busy = true;
      try {
        const drop = await get(`/v1/drops/${number}`);
        if (signal.aborted) return;
        draw(drop);
        if (hasEnded(drop)) { stop.abort(); resolve(drop); }
      } catch {
        // The notice on top says that the line is lost; the next word from there tries again.
      } finally {
        busy = false;
        if (again) { again = false; look(); }
      }
    };

    const draw = (drop) => {
      const rig = live.status?.drop === number ? live.status : null;
      const at = rig && drop.state === "requested" ? BY_RIG[rig.state] ?? 0 : BY_DROP[drop.state] ?? 0;
      const failed = ["failed", "aborted", "interrupted"].includes(drop.state);
      const told = instruction(drop, rig);
      if (told.words !== spoken) say(told.words);
      spoken = told.words;
      fill(place,
        h("p", { class: "soft" }, `Drop ${drop.number}: ${materials(drop.sphere, drop.surface)} from ${+(drop.drop_height_m * 1e3).toFixed(2)} mm, ${drop.operator}`),
        h("p", { class: `instruction ${told.bad ? "bad" : ""}` }, told.words),
        h("ol", { class: "steps", "aria-label": "Progress of the drop" }, STEPS.map((name, index) => {
          const step = failed ? (index <= reached ? (index === reached ? "failed" : "done") : "todo") : index < at ? "done" : index === at ? "now" : "todo";
          const state = { done: "done", now: "now", failed: "ended here", todo: "to come" }[step];
          return h("li", { data: { step }, "aria-current": step === "now" ? "step" : null }, name, h("span", { class: "unseen" }, `: ${state}`));
        })));
      if (!failed) reached = at;
    };

    let reached = 0;
    const stop = new AbortController();
    signal.addEventListener("abort", () => { stop.abort(); resolve(null); });
    on("happened", ({ kind, number: which, drop }) => {
      if (kind === "fit.done" || which === number || drop === number) look();
    }, stop.signal);
    on("status", () => look(), stop.signal);
    on("found", () => look(), stop.signal);
    look();
  });
}

function instruction(drop, rig) {
  if (drop.problem && drop.state !== "analysed") {
    const lead = drop.state === "stored" ? "Stored, but not analysed. " : "";
    return { words: `${lead}${drop.problem.detail} ${drop.problem.remedy}`.trim(), bad: true };
  }
  const doing = {
    requested: "Getting ready …",
    arming: "Arming: hands off the table.",
    armed: "Armed: hands off the table.",
    released: "The sphere falls.",
    capturing: "Recording.",
    storing: "Storing.",
    stored: `Stored as shot ${drop.shot}. Fitting …`,
    analysed: `Shot ${drop.shot} is stored and fitted.`,
  }[drop.state];
  if (drop.state === "requested" && rig) {
    if (rig.state === "LOADING") return { words: `Load the sphere: ${material(drop.sphere)}. The drop begins by itself once it is held.` };
    if (rig.state === "CHECKING") return { words: "The sphere is held. Hands off the table: the input is being checked." };
  }
  return { words: doing ?? drop.state };
}
