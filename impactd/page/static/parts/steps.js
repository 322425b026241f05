// How far a drop is, as seven steps, and what a person has to do now.

import { get } from "../js/api.js";
import { fill, h, say } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { millimetres } from "../js/numbers.js";
import { material, materials } from "../js/words.js";

const STEPS = ["Hang the sphere", "Check the input", "Arm", "Fall", "Record", "Store", "Fit"];
const BY_RIG = { LOADING: 0, CHECKING: 1, ARMING: 2, ARMED: 2, RELEASED: 3, CAPTURING: 4, STORING: 5 };
const BY_DROP = { requested: 0, arming: 2, armed: 2, released: 3, capturing: 4, storing: 5, stored: 6, analysed: 7 };
const FAILED = ["failed", "aborted", "interrupted"];

/** Return whether nothing more will become of a drop. */
export const hasEnded = (drop) => drop.state === "analysed" || FAILED.includes(drop.state) || (drop.state === "stored" && Boolean(drop.problem));

/** Follow a drop to its end: `seen(drop)` is called with every step. Resolve with the end, or null when the signal comes first. */
export function followDrop(number, { seen = () => {}, signal } = {}) {
  return new Promise((resolve) => {
    const stop = new AbortController();
    const finish = (drop) => { stop.abort(); resolve(drop); };
    let busy = false;
    let again = false;
    const look = async () => {
      if (stop.signal.aborted) return;
      if (busy) { again = true; return; }
      busy = true;
      try {
        const drop = await get(`/v1/drops/${number}`);
        if (stop.signal.aborted) return;
        seen(drop);
        if (hasEnded(drop)) finish(drop);
      } catch {
        // The notice on top says that the line is lost; the next word from there tries again.
      } finally {
        busy = false;
        if (again) { again = false; look(); }
      }
    };
    signal?.addEventListener("abort", () => finish(null));
    on("happened", ({ kind, number: which, drop }) => {
      if (kind === "fit.done" || which === number || drop === number) look();
    }, stop.signal);
    on("status", look, stop.signal);
    on("found", look, stop.signal);
    look();
  });
}

/** Show a drop in `place` until it has ended; resolve as `followDrop` does. */
export function watchDrop(place, number, signal) {
  let spoken = "";
  let reached = 0;
  const seen = (drop) => {
    const rig = live.status?.drop === number ? live.status : null;
    const failed = FAILED.includes(drop.state);
    const at = rig && drop.state === "requested" ? BY_RIG[rig.state] ?? 0 : BY_DROP[drop.state] ?? 0;
    if (!failed) reached = at;
    const told = instruction(drop, rig);
    if (told.words !== spoken) say(told.words);
    spoken = told.words;
    fill(place,
      h("p", { class: "soft" }, `Drop ${drop.number}: ${materials(drop.sphere, drop.surface)} from ${millimetres(drop.drop_height_m)}, ${drop.operator}`),
      h("p", { class: `instruction ${told.bad ? "bad" : ""}` }, told.words),
      h("ol", { class: "steps", "aria-label": "Progress of the drop" }, STEPS.map((name, index) => step(name, index, reached, failed))));
  };
  return followDrop(number, { seen, signal });
}

function step(name, index, reached, failed) {
  const how = index < reached ? "done" : index > reached ? "todo" : failed ? "failed" : "now";
  const state = { done: "done", now: "now", failed: "ended here", todo: "to come" }[how];
  return h("li", { data: { step: how }, "aria-current": how === "now" ? "step" : null }, name, h("span", { class: "unseen" }, `: ${state}`));
}

function instruction(drop, rig) {
  if (drop.problem && drop.state !== "analysed") {
    const lead = drop.state === "stored" ? "Stored, but not analysed. " : "";
    return { words: `${lead}${drop.problem.detail} ${drop.problem.remedy}`.trim(), bad: true };
  }
  if (drop.state === "requested" && rig?.state === "LOADING") {
    return { words: `Load the sphere: ${material(drop.sphere)}. The drop starts when the sphere is held.` };
  }
  if (drop.state === "requested" && rig?.state === "CHECKING") {
    return { words: "The sphere is held. Hands off the table: the input is being checked." };
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
  };
  return { words: doing[drop.state] ?? drop.state };
}
