// Abort: on every view, one press, no question asked.

import { post } from "../js/api.js";
import { byId, say } from "../js/dom.js";
import { live } from "../js/live.js";
import { tell } from "./notices.js";

/** Make the button and the Escape key work; `signedIn` says whether anybody is there. */
export function startAbort(signedIn) {
  const button = byId("abort");
  const abort = async () => {
    if (!signedIn()) {
      tell("warn", "Sign in to abort from here. At the rig, switch the valve off by hand.");
      return;
    }
    try {
      const answer = await post("/v1/abort", undefined, { timeoutMs: 5000 });
      tell("info", answer.sentence, { passing: true });
      say(answer.sentence);
    } catch (problem) {
      tell("bad", `Abort did not get through. ${problem.message}`);
    }
    live.refresh();
  };
  button.addEventListener("click", abort);
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input[type=search], select");
    if (event.key === "Escape" && !typing && button.dataset.underWay === "true") abort();
  });
}
