// The page begins here: who is there, then the frame, then the view of the address.

import { whenSignedOut } from "./api.js";
import { byId } from "./dom.js";
import { live } from "./live.js";
import { addView, endView, showView } from "./router.js";
import { codeOfAddress, forget, resume, session } from "./session.js";
import { startAbort } from "../parts/abort.js";
import { startLight } from "../parts/light.js";
import { showNav } from "../parts/nav.js";
import { showAlarms, startAlarms } from "../parts/alarms.js";
import { startNotices, tell } from "../parts/notices.js";
import { showRig } from "../views/rig.js";
import { showShots } from "../views/shots.js";
import { showShot } from "../views/shot.js";
import { showCompare } from "../views/compare.js";
import { showResults } from "../views/results.js";
import { showCalibration } from "../views/calibration.js";
import { showDiagnoses } from "../views/diagnoses.js";
import { showRecordings } from "../views/recordings.js";
import { showModels } from "../views/models.js";
import { showMaterials } from "../views/materials.js";
import { showLog } from "../views/log.js";
import { showHealth } from "../views/health.js";
import { showSignIn } from "../views/sign_in.js";

addView(/^\/rig$/, "Drop", showRig);
addView(/^\/shots$/, "Shots", showShots);
addView(/^\/shots\/(\d+)$/, (match) => `Shot ${match[1]}`, showShot);
addView(/^\/compare\/([\d,]+)$/, "Compare shots", showCompare);
addView(/^\/(?:results|moduli)$/, "Results", showResults);
addView(/^\/calibration$/, "Calibration", showCalibration);
addView(/^\/diagnoses$/, "Diagnoses", showDiagnoses);
addView(/^\/recordings(?:\/([\w-]+))?$/, "Own recordings", showRecordings);
addView(/^\/models$/, "Models", showModels);
addView(/^\/health$/, "Rig", showHealth);
addView(/^\/materials$/, "Materials", showMaterials);
addView(/^\/log$/, "Log", showLog);

let signedIn = false;

function enter() {
  signedIn = true;
  byId("nav").hidden = false;
  showNav();
  live.start({ withEvents: true });
  showAlarms();
  showView();
}

function leave(why, code) {
  const first = !signedIn && byId("main").querySelector("form");
  if (first && !why && !code) return;
  signedIn = false;
  forget();
  showAlarms();
  endView();
  byId("nav").hidden = true;
  live.start({ withEvents: false });
  showSignIn(byId("main"), { why, code, enter });
}

/** Keep whoever is signed in: a link must not make somebody act under another name. */
function stay() {
  tell("info", `You are signed in already, with the token ${session.name}. The link's code was not used. To use it, sign out under Log and open the link again.`);
}

function follow() {
  const code = codeOfAddress();
  if (!signedIn) {
    if (code) leave("", code);
    return;
  }
  if (code) stay();
  showView();
}

async function begin() {
  startLight();
  startNotices(() => signedIn);
  startAlarms(() => signedIn);
  startAbort(() => signedIn);
  whenSignedOut(() => { if (signedIn) leave("You were signed out: your twelve hours or your token have ended. Nothing is lost."); });
  live.addEventListener("found", async () => { if (!signedIn && await resume().catch(() => false)) enter(); });
  window.addEventListener("hashchange", follow);
  window.addEventListener("signed-out", () => leave());
  const code = codeOfAddress();
  try {
    if (await resume()) {
      enter();
      if (code) stay();
    } else {
      leave("", code);
    }
  } catch {
    live.start({ withEvents: false });
    leave("", code);
  }
}

begin();
