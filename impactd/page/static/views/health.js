// The rig: what is looked at before every drop, its devices, how noise and gain move, disk, calibration.

import { get } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { day, inDays, significant } from "../js/numbers.js";
import { drawDrift, QUANTITIES } from "../charts/drift.js";
import { drawNoise } from "../charts/noise.js";

const NAMES = { digitizer: "Digitizer", valve: "Valve", sphere: "Sphere and gauge", input: "Idle input", disk: "Disk", calibration: "Calibration" };
const EVERY_MS = 5000;

export async function showHealth(place, { signal }) {
  const checks = h("section", { class: "card", "aria-labelledby": "checks-title" });
  const facts = h("section", { class: "card", "aria-labelledby": "facts-title" });
  const noise = h("section", { class: "card", "aria-labelledby": "noise-title" });
  const gain = h("section", { class: "card", "aria-labelledby": "gain-title" });
  fill(place, h("h1", {}, "Rig"), h("div", { class: "cards two" }, checks, facts), h("div", { class: "cards two" }, noise, gain));

  let drawn = "";
  const load = async () => {
    try {
      const found = await get("/v1/rig/health");
      if (signal.aborted) return;
      showChecks(checks, found);
      showFacts(facts, found);
      const now = JSON.stringify(found.noise);
      if (now !== drawn) { drawn = now; showNoise(noise, found.noise, signal); }
    } catch (problem) {
      if (!checks.hasChildNodes()) fill(checks, h("p", { class: "wrong" }, problem.message));
    }
  };
  const loadGain = async () => {
    const page = await get("/v1/calibrations?limit=100").catch(() => null);
    if (page && !signal.aborted) showGain(gain, page, signal);
  };
  const timer = setInterval(load, EVERY_MS);
  signal.addEventListener("abort", () => clearInterval(timer));
  on("happened", ({ kind }) => {
    if (kind.startsWith("rig.") || kind === "drop.analysed") load();
    if (kind === "calibration.done") loadGain();
  }, signal);
  on("found", () => { load(); loadGain(); }, signal);
  await Promise.all([load(), loadGain()]);
}

const asSentence = (words) => `${words[0].toUpperCase()}${words.slice(1)}.`;

// A drop needs no valid calibration, but a cell without one is not OK.
const standing = (one, calibration) => {
  if (!one.ok) return ["bad", "not OK"];
  const until = calibration.valid_until_utc;
  const due = one.name === "calibration" && !(until && new Date(until) > new Date());
  return due ? ["warn", "due"] : ["good", "OK"];
};

function showChecks(place, { checks, attention, calibration }) {
  const now = JSON.stringify([checks, attention, calibration]);
  if (now === place.dataset.drawn) return;
  place.dataset.drawn = now;
  fill(place, h("h2", { id: "checks-title" }, "Checked before every drop"),
    attention && h("p", { class: "notice warn" }, asSentence(attention)),
    h("ul", { class: "checks" }, checks.map((one) => [one, ...standing(one, calibration)]).map(([one, check, said]) => h("li", { data: { check } },
      h("span", { class: `badge ${check}` }, said),
      h("div", {}, h("strong", {}, NAMES[one.name] ?? one.name), h("p", {}, asSentence(one.sentence)), one.remedy && h("p", { class: "wrong" }, one.remedy))))));
}

function showFacts(place, found) {
  const { disk, calibration } = found;
  const gigabytes = (bytes) => `${significant(bytes / 1e9)} GB`;
  const due = calibration.valid_until_utc;
  const facts = [
    ["Calibration due", due ? `${day(due)}, ${inDays(due)}` : "never calibrated: the certificate is used"],
    ["Disk", `${gigabytes(disk.free_bytes)} free of ${gigabytes(disk.total_bytes)}; drops end at ${gigabytes(disk.reserve_bytes)}`],
    ["Room for", `${disk.shots_left.toLocaleString("en-GB")} more shots`],
    ["Vacuum gauge", found.valve_has_gauge ? "wired" : "none: the rig cannot see whether a sphere is held"],
    ...found.devices.map((one) => [NAMES[one.name], `${one.sentence}${one.answers ? "" : " (does not answer)"}`]),
  ];
  const now = JSON.stringify(facts);
  if (now === place.dataset.drawn) return;
  place.dataset.drawn = now;
  fill(place, h("h2", { id: "facts-title" }, "Devices and supplies"),
    h("dl", { class: "facts" }, facts.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)))),
    h("p", {}, h("a", { class: "button", href: "#/calibration" }, "To the calibration")));
}

function showNoise(place, noise, signal) {
  const heading = h("h2", { id: "noise-title" }, "Noise before the trigger");
  if (!noise.numbers.length) { fill(place, heading, h("p", { class: "soft" }, "The chart begins with the first fitted shot.")); return; }
  const chart = h("div", { class: "chart flat" });
  const last = noise.noise_rms_V.at(-1);
  fill(place, heading, chart, h("p", { class: "soft" }, `The last shot: ${significant(last * 1e3)} mV rms. A drop is refused above ${significant(noise.highest_allowed_V * 1e3)} mV.`));
  drawNoise(chart, noise, signal);
}

function showGain(place, page, signal) {
  const heading = h("h2", { id: "gain-title" }, "Gain of the load cell");
  if (!page.series.length) { fill(place, heading, h("p", { class: "soft" }, "The chart begins with the first calibration.")); return; }
  const chart = h("div", { class: "chart flat" });
  const [key, title, unit] = QUANTITIES[0];
  fill(place, heading, chart);
  drawDrift(chart, { series: page.series, key, title, unit }, signal);
}
