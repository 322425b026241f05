// One shot: result, whole record, circumstances, downloads.

import { get, post } from "../js/api.js";
import { fill, freshKey, h } from "../js/dom.js";
import { on } from "../js/live.js";
import { measured, millimetres, moment, significant } from "../js/numbers.js";
import { remember } from "../js/memory.js";
import { may } from "../js/session.js";
import { material, materials } from "../js/words.js";
import { drawRecord } from "../charts/trace.js";
import { showResult } from "../parts/shot_result.js";
import { tell } from "../parts/notices.js";

export async function showShot(place, { parameters: [number], signal }) {
  const result = h("section", { class: "card", "aria-label": "Result" });
  const rest = h("div", { class: "cards" });
  const wholeRecord = h("section", { class: "card", "aria-labelledby": "record" });
  fill(place, h("h1", {}, `Shot ${number}`), result, rest);
  const show = async () => {
    const shot = await showResult(result, number, signal);
    if (signal.aborted) return;
    if (!shot) {
      if (!rest.hasChildNodes()) fill(rest, h("p", {}, h("a", { class: "button", href: "#/shots" }, "All shots")));
      return;
    }
    if (!wholeRecord.isConnected) fill(rest, actions(shot), circumstances(shot), wholeRecord);
    if (!wholeRecord.querySelector(".chart")) await showRecord(wholeRecord, shot, signal);
  };
  on("happened", ({ kind, shot, number: which }) => {
    if (String(kind === "fit.done" ? shot : kind === "shot.unlike" ? which : "") === number) show();
  }, signal);
  on("found", show, signal);
  await show();
}

function actions(shot) {
  const again = () => {
    remember("drop", { sphere: shot.sphere, surface: shot.surface, drop_height_m: shot.drop_height_m });
    location.hash = "#/rig";
  };
  const fit = async (event) => {
    event.currentTarget.disabled = true;
    const button = event.currentTarget;
    try {
      for (const model of ["hsd", "kv", "kv2"]) await post("/v1/fits", { shots: [shot.number], model }, { key: freshKey() });
      tell("info", `Shot ${shot.number} is being fitted again.`, { passing: true });
    } catch (problem) {
      tell("bad", problem.message);
    }
    button.disabled = false;
  };
  const name = `shot-${String(shot.number).padStart(6, "0")}`;
  return h("section", { class: "card", "aria-label": "Download and go on" },
    h("div", { class: "row" },
      h("a", { class: "button", href: `/v1/shots/${shot.number}.h5`, download: `${name}.h5` }, "Download HDF5"),
      h("a", { class: "button", href: `/v1/shots/${shot.number}.csv`, download: `${name}.csv` }, "Download CSV"),
      h("a", { class: "button", href: `/v1/shots/${shot.number}`, download: `${name}.json` }, "Download JSON")),
    h("p", { class: "soft" }, "HDF5 has the raw codes and all metadata; CSV has time and signal; JSON has the fits."),
    may("operate") && h("div", { class: "row" },
      shot.sphere && shot.surface && shot.drop_height_m && h("button", { class: "button", type: "button", on: { click: again } }, "Drop with the same settings"),
      h("button", { class: "button", type: "button", on: { click: fit } }, "Fit again"),
      h("a", { class: "button", href: `#/diagnoses?shots=${shot.number}` }, "Diagnose")));
}

function circumstances(shot) {
  const facts = [
    ["Sphere and surface", materials(shot.sphere, shot.surface)],
    ["Drop height", millimetres(shot.drop_height_m)],
    ["Operator", shot.operator || "–"],
    ["Recorded", moment(shot.started_utc)],
    ...surroundings(shot.environment),
    ["Peak", `${significant(shot.peak, 4)} ${{ voltage: "V", force_N: "N", acceleration_m_per_s2: "m/s²" }[shot.quantity] ?? ""}`],
    ["Samples", `${shot.samples.toLocaleString("en-GB")} at ${significant(shot.sample_rate_hz / 1e6, 4)} MHz`],
    ["Source", shot.source === "import" ? `import: ${shot.origin}` : `this rig, ${material("drop")} ${shot.number}`],
    ["SHA-256 of the file", shot.sha256],
  ];
  return h("section", { class: "card", "aria-labelledby": "circumstances" },
    h("h2", { id: "circumstances" }, "Conditions"),
    h("dl", { class: "facts" }, facts.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value)))));
}

function surroundings(environment) {
  const { temperature_C: temperature, relative_humidity: humidity } = environment ?? {};
  const known = [temperature && `${measured(temperature)} °C`, humidity && `${measured(humidity, 100)} %`].filter(Boolean);
  return known.length ? [["Temperature and humidity", known.join(", ")]] : [];
}

async function showRecord(place, shot, signal) {
  const title = h("h2", { id: "record" }, "The whole record");
  try {
    const trace = await get(`/v1/shots/${shot.number}/trace?points=4000`);
    const chart = h("div", { class: "chart flat" });
    requestAnimationFrame(() => drawRecord(chart, trace, signal));
    fill(place, title, chart,
      h("p", { class: "soft" }, `${trace.samples.toLocaleString("en-GB")} samples${trace.decimated ? `, drawn as ${trace.time_s.length.toLocaleString("en-GB")}: the smallest and the largest of each interval` : ""}. Later peaks are bounces of the sphere.`));
  } catch (problem) {
    fill(place, title, h("p", { class: "wrong" }, problem.message));
  }
}
