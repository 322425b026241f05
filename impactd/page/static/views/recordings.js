// Own recordings: drag files in, state what was measured, fit and diagnose, read the answer.

import { ask, get, post } from "../js/api.js";
import { fill, freshKey, h, say } from "../js/dom.js";
import { on } from "../js/live.js";
import { counted, moment, significant } from "../js/numbers.js";
import { may } from "../js/session.js";
import { UNDER_WAY, diagnosis } from "../parts/diagnosis.js";
import { dropZone } from "../parts/drop_zone.js";
import { choice, field, numberIn, tellWrong } from "../parts/fields.js";
import { modulusCard } from "../parts/modulus_card.js";
import { valuesForm } from "../parts/values_form.js";

const WATCH_MS = 1500;
const PATIENCE_MS = 180000;
const UNITS = { voltage: "V", force_N: "N", acceleration_m_per_s2: "m/s²" };
// What the command line calls an option, the page calls a field.
const OPTIONS = { "--rate": "Sample rate", "--unit": "Unit", "--column": "Column", "--time": "Times are in", "--scale": "Scale", "--threshold": "Least hit", "--values": "the form below" };
const inPageWords = (sentence) => sentence.replace(/(--[a-z]+)(?: HZ)?/g, (said, option) => (OPTIONS[option] ? `“${OPTIONS[option]}”` : said));

/** Values of a file that was dragged in with the recordings. */
let dragged = null;

export async function showRecordings(place, { signal, parameters: [name] }) {
  const wrong = h("p", { class: "wrong", role: "alert" });
  const rest = h("div", { class: "cards" });
  const zone = may("operate") && dropZone({ signal, onFiles: (files) => upload(files, name, wrong) });
  fill(place, h("h1", {}, "Own recordings"),
    !name && h("p", {}, "Recordings of any instrument become a modulus with its uncertainty, and a verdict on the model. They are kept on this computer; nothing of the rig moves."),
    zone ? h("section", { class: "card", "aria-label": "Bring recordings" }, name ? h("details", {}, h("summary", {}, "Add recordings"), zone) : zone, wrong) : h("p", {}, "Your token may read only; to bring recordings it needs the scope operate."),
    rest);
  try {
    if (name) await showSet(rest, name, signal);
    else await showAll(rest, signal);
  } catch (problem) {
    if (!signal.aborted) fill(rest, h("p", { class: "wrong" }, problem.message));
  }
}

/** Upload files one after another, then show them; what states values or drops goes into the form. */
async function upload(files, name, wrong) {
  wrong.textContent = "";
  const others = files.filter((file) => !/\.json$/i.test(file.name));
  const recordings = [];
  const tables = [];
  try {
    for (const file of files) if (!others.includes(file)) dragged = await valuesOf(file);
    for (const file of others) ((await isTableOfDrops(file)) ? tables : recordings).push(file);
    const to = name ?? freshName(recordings[0]?.name);
    if (!to) throw new Error("Drag the recordings in first, then their values.");
    for (const file of recordings) {
      say(`Uploading ${file.name}`);
      await ask("PUT", `/v1/recordings/${to}/files/${encodeURIComponent(file.name)}`, { file, timeoutMs: PATIENCE_MS });
    }
    for (const file of tables) {
      const { values } = await ask("PUT", `/v1/recordings/${to}/drops`, { file, timeoutMs: PATIENCE_MS });
      dragged = { ...values, ...dragged, shots: { ...dragged?.shots, ...values.shots } };
    }
    if (to === name) dispatchEvent(new HashChangeEvent("hashchange"));
    else location.hash = `#/recordings/${to}`;
  } catch (problem) {
    wrong.textContent = inPageWords(problem.message);
  }
}

/** A table says which drop was which: its first line heads columns name and sphere, surface or height. */
async function isTableOfDrops(file) {
  if (!/\.(csv|tsv|txt)$/i.test(file.name)) return false;
  const [head] = (await file.slice(0, 4096).text()).replace(/^\ufeff/, "").trimStart().split(/[\r\n]/);
  const columns = head.split(/[;,\t]/).map((one) => one.trim());
  return columns.includes("name") && ["sphere", "surface", "drop_height_mm"].some((one) => columns.includes(one));
}

async function valuesOf(file) {
  try {
    return JSON.parse(await file.text());
  } catch {
    throw new Error(`${file.name} is no JSON of measured values.`);
  }
}

/** Return a name for new recordings: their first file's, and when. */
function freshName(file) {
  if (!file) return null;
  const stem = file.replace(/\.[^]*$/, "").replace(/[^A-Za-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 40) || "recordings";
  const now = new Date();
  const two = (number) => String(number).padStart(2, "0");
  return `${stem}-${now.getFullYear()}${two(now.getMonth() + 1)}${two(now.getDate())}-${two(now.getHours())}${two(now.getMinutes())}${two(now.getSeconds())}`;
}

async function showAll(place, signal) {
  const { items } = await get("/v1/recordings");
  if (signal.aborted) return;
  fill(place, h("section", { class: "card", "aria-label": "Earlier recordings" },
    h("h2", {}, "Earlier recordings"),
    items.length ? h("ul", { class: "sentences" }, items.map((one) => h("li", {}, h("a", { class: "shot-link", href: `#/recordings/${one.name}` }, one.name), h("span", { class: "soft" }, ` ${said(one)}`)))) : h("p", { class: "empty" }, "None yet.")));
}

function said({ files, diagnoses: [newest] }) {
  const count = counted(files.length, "file");
  return newest ? `${count}; diagnosed ${moment(newest.created_utc)}: ${newest.verdict ?? newest.state}` : `${count}, not yet diagnosed`;
}

async function showSet(place, name, signal) {
  const found = await get(`/v1/recordings/${name}`);
  if (signal.aborted) return;
  const answer = h("div", { class: "cards answer", "aria-label": "Answer", role: "group" });
  const hits = h("div", { class: "cards" }, h("p", { role: "status" }, "Reading …"));
  fill(place, answer, hits, may("operate") && deletion(name));
  if (found.diagnoses.length) watch(answer, found.diagnoses[0].id, signal);
  if (!may("operate")) { fill(hits); return; }
  let given = dragged ?? found.values;
  let form = null;
  dragged = null;
  const options = optionsForm(found.choices);
  const { spheres, surfaces } = await get("/v1/materials").catch(() => ({ spheres: [], surfaces: [] }));
  const read = async () => {
    const wrong = h("p", { class: "wrong", role: "alert" });
    const again = h("div", { class: "row" }, h("button", { class: "button", type: "button", on: { click: () => { wrong.textContent = ""; read(); } } }, "Read again"));
    const how = (open) => h("details", { open }, h("summary", {}, "How to read the files"), h("div", { class: "cards" }, options, again));
    try {
      given = form?.read() ?? given; // what was typed outlives another reading
    } catch {
      // it is not complete yet
    }
    try {
      const choices = options.read();
      const ask = (values) => post(`/v1/recordings/${name}/reading`, { ...choices, values }, { timeoutMs: PATIENCE_MS });
      let doubtful = null;
      const reading = await ask(given).catch((problem) => { doubtful = problem; return ask(null); });
      if (signal.aborted) return;
      say(`Found: ${counted(reading.shots.length, "hit")}.`);
      form = valuesForm(reading.shots, given ?? {}, { spheres, surfaces });
      fill(hits, readingCard(name, reading, how(false)), stateForm({ name, form, choices: () => options.read(), started: (id) => watch(answer, id, signal).then(() => answer.scrollIntoView()) }));
      if (doubtful) hits.querySelector("form .wrong").textContent = doubtful.message;
    } catch (problem) {
      if (signal.aborted) return;
      fill(hits, h("section", { class: "card", "aria-label": "What was read" }, h("h2", {}, name), wrong, how(true)));
      tellWrong(wrong, Object.assign(problem, { message: inPageWords(problem.message) }));
    }
  };
  await read();
}

/** A button that asks once more before it deletes a set. */
function deletion(name) {
  const wrong = h("p", { class: "wrong", role: "alert" });
  const remove = async () => {
    try {
      await ask("DELETE", `/v1/recordings/${name}`);
      say(`The recordings ${name} are deleted.`);
      location.hash = "#/recordings";
    } catch (problem) {
      wrong.textContent = problem.message;
    }
  };
  return h("details", { class: "card" }, h("summary", {}, "Delete these recordings"),
    h("p", {}, "Deletes the files and what was read in them from this computer; nothing brings them back. The documents of their diagnoses stay, and the log says who deleted them."),
    h("div", { class: "row" }, h("button", { class: "button", type: "button", on: { click: remove } }, `Delete ${name}`)), wrong);
}

/** Fields for what the files do not say; `.read()` gives the body's members. */
function optionsForm(now) {
  const text = { autocomplete: "off", maxlength: 40 };
  const unit = field("Unit", { ...text, value: now.unit ?? "" }, { hint: "V, mV, N, kN, g, m/s2 or strain" });
  const rate = field("Sample rate / Hz", { ...text, inputmode: "decimal", value: now.rate_hz ?? "" });
  const column = field("Column", { ...text, value: (now.columns ?? []).join(", ") }, { hint: "Name or number of the signal; all takes each" });
  const times = choice("Times are in", [["", "as the file says"], ["s", "s"], ["ms", "ms"], ["us", "µs"], ["ns", "ns"]], now.time_unit ?? "");
  const scale = field("Scale", { ...text, inputmode: "decimal", value: now.scale === 1 ? "" : now.scale ?? "" }, { hint: "From the file's numbers to the unit" });
  const least = field("Least hit", { ...text, inputmode: "decimal", value: now.threshold ?? "" }, { hint: "A hit exceeds this value, in the unit" });
  const element = h("div", { class: "material-fields" }, unit, rate, column, times, scale, least);
  element.read = () => ({
    unit: unit.input.value.trim() || null,
    rate_Hz: numberIn(rate.input, "The sample rate"),
    columns: column.input.value.split(",").map((one) => one.trim()).filter(Boolean),
    time_unit: times.input.value || null,
    scale: numberIn(scale.input, "The scale") ?? 1,
    threshold: numberIn(least.input, "The least hit"),
  });
  return element;
}

function readingCard(name, { shots, assumptions, missing, links }, how) {
  const unit = UNITS[shots[0].quantity];
  const columns = [["Begins / s", (one) => significant(one.starts_s, 6), "number hide-narrow"], [`Peak / ${unit}`, (one) => significant(one.peak, 4), "number"], ["Contact / ms", (one) => significant(1e3 * one.contact_s), "number"], ["Sampled at / kHz", (one) => significant(one.sample_rate_Hz / 1e3, 6), "number"]];
  return h("section", { class: "card", "aria-label": "What was read" },
    h("h2", {}, `${name}: ${counted(shots.length, "hit")}`),
    h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": "Table of the hits" }, h("table", {},
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Shot"), columns.map(([head, , look]) => h("th", { scope: "col", class: look }, head)), h("td", {}))),
      h("tbody", {}, shots.map((one) => h("tr", {}, h("th", { scope: "row" }, one.name),
        columns.map(([, text, look]) => h("td", { class: look }, text(one))),
        h("td", { class: "soft" }, inPageWords(one.remark))))))),
    h("details", {}, h("summary", {}, "Look at the hits: is each grey band one hit?"), h("img", { class: "wide-picture", loading: "lazy", alt: `The recordings ${name}, and each hit that was found`, src: links.picture })),
    h("details", { open: true }, h("summary", {}, "Read and assumed"), h("ul", { class: "sentences" }, assumptions.filter((one) => !one.startsWith("These values are unknown")).map((one) => h("li", {}, inPageWords(one))))),
    missing.length > 0 && h("div", { class: "stack" }, h("h3", {}, "Not stated yet"), h("ul", { class: "sentences" }, missing.map((one) => h("li", {}, one)))),
    how);
}

function stateForm({ name, form, choices, started }) {
  const wrong = h("p", { class: "wrong", role: "alert" });
  const button = h("button", { class: "button main-action", type: "submit" }, "Fit and diagnose");
  let told = "";
  const submit = async (event) => {
    event.preventDefault();
    wrong.textContent = "";
    button.disabled = true;
    try {
      const body = { ...choices(), values: form.read() };
      const { missing } = await post(`/v1/recordings/${name}/reading`, body, { timeoutMs: PATIENCE_MS });
      const lacks = missing.join(" ");
      if (lacks && lacks !== told) {
        told = lacks;
        throw new Error(`Not stated yet. ${lacks} Press again to go on without.`);
      }
      const made = await post(`/v1/recordings/${name}/diagnoses`, body, { key: freshKey(), timeoutMs: PATIENCE_MS });
      await started(made.id);
    } catch (error) {
      tellWrong(wrong, error);
    } finally {
      button.disabled = false;
    }
  };
  return h("form", { class: "card", novalidate: true, "aria-label": "What you measured", on: { submit } },
    h("h2", {}, "What you measured"),
    h("p", { class: "soft" }, "u is the standard uncertainty (k = 1), in the unit of its value; without it the value counts as exact. What you leave empty is unknown: the answer then says which modulus that withholds. A values.json of impactd new --values and a table of drops of --drops can be dragged in, too."),
    form, wrong, h("div", { class: "row" }, button));
}

/** Show a diagnosis of these recordings, until it has ended and its moduli are there. */
function watch(place, id, signal) {
  let timer = null;
  const look = async () => {
    clearTimeout(timer);
    try {
      const one = await get(`/v1/diagnoses/${id}`);
      if (signal.aborted) return;
      fill(place, h("section", { class: "card", "aria-label": "Diagnosis" }, diagnosis(one, look)),
        one.result && h("div", { class: "cards two" }, Object.entries(one.result.after.moduli ?? {}).sort(([, a], [, b]) => (b.status === "fitted") - (a.status === "fitted")).map(([name, entry]) => modulusCard(name, entry))));
      if (UNDER_WAY.includes(one.state)) timer = setTimeout(look, WATCH_MS);
      else if (one.sentence) say(one.sentence);
    } catch {
      timer = setTimeout(look, 2 * WATCH_MS);
    }
  };
  signal.addEventListener("abort", () => clearTimeout(timer));
  on("happened", ({ kind, id: which }) => { if (kind === "diagnosis.done" && which === id) look(); }, signal);
  return look();
}
