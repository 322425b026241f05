// The state of the rig, in the same words as `impactd status`.

import { byId, say } from "../js/dom.js";
import { live, on } from "../js/live.js";
import { clock } from "../js/numbers.js";

/** Keep the light up to date for as long as the page is open. */
export function startLight() {
  const light = byId("light");
  let said = "";
  const header = document.querySelector(".top");
  // What sticks below the header: a long status and an alarm make it higher.
  new ResizeObserver(() => document.documentElement.style.setProperty("--header", `${header.offsetHeight}px`)).observe(header);

  const show = (look, word, why) => {
    light.dataset.light = look;
    byId("light-word").textContent = word;
    byId("light-why").textContent = why;
  };

  on("status", (status) => {
    // "NOT READY: why. What to do." The first colon parts the word from the rest.
    const at = status.sentence.indexOf(":");
    const word = status.sentence.slice(0, at + 1);
    const busy = !status.ready && status.owner !== null && status.state !== "FAULT";
    show(status.ready && status.attention ? "look" : status.ready ? "ready" : busy ? "busy" : "not-ready", word, status.sentence.slice(at + 1).trim());
    byId("rig-name").textContent = status.rig?.name ?? "";
    byId("abort").dataset.underWay = String(busy);
    if (word !== said) say(status.sentence);
    said = word;
  });
  on("lost", () => {
    const since = live.seenAt ? ` since ${clock(live.seenAt)}` : "";
    show("unknown", "NOT KNOWN", `The daemon has not answered${since}. The state of the rig is unknown: look at it.`);
    said = "";
  });
  on("unknown", () => show("unknown", "NOT KNOWN", "Sign in to see the state of the rig."));
}
