// What a shot says: modulus, advice, trace and residual. The same on the rig's view and the shot's own.

import { get, withQuery } from "../js/api.js";
import { fill, h } from "../js/dom.js";
import { columnUnit, measured, modulus, modulusUnit, significant } from "../js/numbers.js";
import { ADVICE, material as words, modelName } from "../js/words.js";
import { drawImpact } from "../charts/trace.js";

const BEFORE_S = 60e-6;
const AFTER_S = 600e-6;
const POINTS = 4000;

/** Show a shot in `place`; return the shot, or null where it did not come: what was shown then stays. */
export async function showResult(place, number, signal) {
  let shot;
  try {
    shot = await get(`/v1/shots/${number}`);
  } catch (problem) {
    if (!place.hasChildNodes()) fill(place, h("p", { class: "wrong" }, problem.message));
    return null;
  }
  if (signal.aborted) return shot;
  const material = h("div", { class: "young" });
  // The numbers are shown whether or not their picture comes.
  const picture = await chart(shot, signal).catch((problem) => h("p", { class: "wrong" }, problem.message));
  fill(place, material, verdict(shot), advice(shot), picture);
  showMaterial(material, shot);
  return shot;
}

/** Tell whether a shot's numbers may be shown as a result. */
const usable = (shot) => shot.advice !== "repeat";

/** Return the fit that speaks for a shot: of the closed base, else of the paper's, else any, as the daemon chooses. */
export const bestFit = (fits) => fits?.find((fit) => /^kv2\b/.test(fit.model)) ?? fits?.find((fit) => /^kv\b/.test(fit.model)) ?? fits?.[0] ?? null;

function verdict(shot) {
  const fit = bestFit(shot.fits);
  const found = fit?.result.reduced_modulus_Pa;
  if (!found) {
    const why = fit ? fit.result.outcome?.message ?? "The fit gives no modulus." : "It has not been fitted yet.";
    return h("p", { class: "modulus" }, h("small", {}, `No modulus. ${why}`));
  }
  const [scale, unit] = modulusUnit(found.value);
  const number = `${measured(found, scale)} ${unit}`;
  const what = `Reduced modulus E* of the pair, ± U (95 %), ${modelName(fit.model)}`;
  if (!usable(shot)) {
    return h("div", { class: "stack" },
      h("p", { class: "modulus" }, h("small", {}, "No modulus: this shot must not be used.")),
      h("details", {}, h("summary", {}, "The result of the fit"), h("p", { class: "soft" }, `${what}: ${number}`)));
  }
  return h("div", { class: "verdict" },
    h("p", { class: "modulus" }, h("span", { class: "unseen" }, "Reduced modulus "), number),
    h("p", { class: "soft" }, what));
}

/** Say what all shots together tell of the surface, larger than E* of the shot: that is what the drops are made for. */
async function showMaterial(place, shot) {
  if (!shot.surface || !usable(shot) || !bestFit(shot.fits)?.result.reduced_modulus_Pa) return;
  const found = await get(withQuery("/v1/moduli", { specimen: shot.surface })).catch(() => null);
  const one = found?.moduli[shot.surface];
  const young = one && modulus(one.youngs_modulus_Pa);
  if (!young) return;
  const what = `Young's modulus of ${words(shot.surface)}`;
  if (one.status === "fitted") fill(place, h("p", { class: "large" }, young), h("p", { class: "soft" }, `${what}, ± U (95 %), from all shots together`));
  else fill(place, h("p", { class: "soft" }, `${what}: ${young} (its stated value, combined with all shots)`));
}

function advice(shot) {
  if (!shot.advice) return null;
  const { word, sign, sentence } = ADVICE[shot.advice];
  const reasons = shot.because ?? [];
  return h("div", { class: `advice ${shot.advice === "check" ? "check-it" : shot.advice}`, data: { advice: shot.advice } },
    h("p", {}, h("strong", {}, h("span", { "aria-hidden": "true" }, `${sign} `), reasons.length ? sentence : `${word}: no check of this record failed.`)),
    !reasons.length && bestFit(shot.fits)?.calibration === null && h("p", {}, "The load cell was not calibrated: the modulus uses its certificate."),
    reasons.length ? h("ul", {}, reasons.map((reason) => h("li", {}, reason))) : null);
}

async function chart(shot, signal) {
  const curves = await get(`/v1/shots/${shot.number}/curves`);
  const [from, to] = span(curves, shot);
  const trace = await get(`/v1/shots/${shot.number}/trace?points=${POINTS}&start_s=${from}&stop_s=${to}`);
  const place = h("div", { class: "chart tall" });
  const models = curves.items.map((curve) => curve.model);
  let left = models.includes("kv2") ? "kv2" : models.at(-1);
  const active = models.find((model) => model.includes("+"));
  if (active) left = active;
  const show = () => drawImpact(place, { trace, curves: curves.items, left }, signal);
  const buttons = models.map((model) => h("button", {
    class: "button", type: "button", "aria-pressed": String(model === left),
    on: { click: () => { left = model; mark(); show(); } },
  }, modelName(model)));
  const mark = () => buttons.forEach((button, index) => button.setAttribute("aria-pressed", String(models[index] === left)));
  // Not awaited: the numbers must not wait for the drawing library.
  requestAnimationFrame(show);
  return h("figure", { class: "stack" },
    place,
    models.length > 1 && h("div", { class: "row", role: "group", "aria-label": "Model of the residual" }, h("span", { class: "label" }, "Left over by"), buttons),
    fitFacts(shot),
    curves.missing.length > 0 && h("p", { class: "soft" }, `No curve was kept for ${curves.missing.map(modelName).join(", ")}: a fit of the whole archive keeps numbers only. Fit the shot again to see it.`));
}

/** Return the stretch to draw: the impact and what was fitted of it. */
function span({ items }, shot) {
  const starts = items.map((curve) => curve.start_s);
  const stops = items.map((curve) => curve.start_s + curve.signal.length * curve.interval_s);
  const first = -shot.trigger_index / shot.sample_rate_hz;
  const last = (shot.samples - 1 - shot.trigger_index) / shot.sample_rate_hz;
  const from = Math.max(first, Math.min(-BEFORE_S, ...starts.map((start) => start - BEFORE_S / 2)));
  const to = Math.min(last, stops.length ? Math.max(...stops) + BEFORE_S / 2 : AFTER_S);
  // More points would come thinned, and a thinned trace has no residual.
  return [from, Math.min(to, from + (POINTS - 1) / shot.sample_rate_hz)];
}

function fitFacts(shot) {
  const { fits } = shot;
  if (!fits?.length) return null;
  const [scale, unit] = columnUnit(fits.map((fit) => fit.result.reduced_modulus_Pa));
  return h("div", { class: "table-frame fits", tabindex: "0", role: "group", "aria-label": "Table of the fits" }, h("table", {},
    h("caption", { class: "unseen" }, "The fits of this shot"),
    h("thead", {}, h("tr", {}, ["Model", `E* ± U (95 %) / ${unit}`, "Left over / mV rms", "R²", "χ² per degree of freedom"].map((name, index) => h("th", { scope: "col", class: index ? "number" : null }, name)))),
    h("tbody", {}, fits.map((fit) => {
      const { result } = fit;
      const found = result.reduced_modulus_Pa;
      return h("tr", {},
        h("th", { scope: "row" }, modelName(fit.model)),
        h("td", { class: "number" }, usable(shot) ? measured(found, scale) : "–"),
        h("td", { class: "number" }, significant(result.rms * 1e3)),
        h("td", { class: "number" }, significant(result.r2, 6)),
        h("td", { class: "number" }, significant(result.chi2_per_dof, 3)));
    }))));
}
