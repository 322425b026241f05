// One shot: the measured trace with the models' curves, and below it what they leave.

import { axis, colour, draw } from "./plotly.js";
import { modelName } from "../js/words.js";

const FIRST_LOOK_US = [-60, 600];
const DASHES = { hsd: "dash", kv: "dot", kv2: "solid" };

/** Return how a model is drawn: colours stay apart in grey, dashes in black and white. */
export const modelLook = (model) => ({
  color: colour(model === "hsd" ? "hsd" : model === "kv" || model === "kv2" ? "kv" : "named"),
  dash: DASHES[model] ?? "dashdot",
});

/** Draw the impact: `trace` is undecimated, `curves` are the models', `left` names the one whose residual is shown. */
export function drawImpact(place, { trace, curves, left }, signal) {
  const milli = trace.unit === "V";
  const make = () => {
    const traces = [
      { x: trace.time_s.map((t) => t * 1e6), y: trace.signal, name: "measured", mode: "markers", marker: { color: colour("measured"), size: 5 }, hovertemplate: `%{y:.4f} ${trace.unit}<extra>measured</extra>` },
      ...curves.map((curve) => ({
        x: curve.signal.map((_, index) => (curve.start_s + index * curve.interval_s) * 1e6),
        y: curve.signal,
        name: modelName(curve.model),
        mode: "lines",
        line: { ...modelLook(curve.model), width: 1.75 },
        hovertemplate: `%{y:.4f} ${trace.unit}<extra>${modelName(curve.model)}</extra>`,
      })),
    ];
    const shown = curves.find((curve) => curve.model === left);
    if (shown) {
      const rest = residual(trace, shown);
      traces.push({
        x: rest.time_us, y: milli ? rest.value.map((value) => value * 1e3) : rest.value, yaxis: "y2", mode: "lines", showlegend: false,
        line: { color: modelLook(left).color, width: 1.25 }, hovertemplate: `%{y:.2f} ${milli ? "mV" : trace.unit}<extra>residual</extra>`,
      });
    }
    return {
      traces,
      layout: {
        xaxis: axis("time since the trigger / µs", { anchor: "y2", zeroline: false, range: FIRST_LOOK_US }),
        yaxis: axis(`signal / ${trace.unit}`, { domain: [0.43, 1] }),
        yaxis2: axis(`residual / ${milli ? "mV" : trace.unit}`, { domain: [0, 0.35], zeroline: true, zerolinecolor: colour("edge") }),
        hovermode: "x unified",
      },
      words: `The measured impact with the curves of ${curves.map((one) => modelName(one.model)).join(" and ") || "no model"}; below it the residual of ${left ? modelName(left) : "no model"}.`,
    };
  };
  return draw(place, make, signal);
}

/** Return measured minus model, sample by sample. */
export function residual(trace, curve) {
  const first = Math.round((curve.start_s - trace.start_s) / curve.interval_s);
  const time_us = [];
  const value = [];
  curve.signal.forEach((model, index) => {
    const measured = trace.signal[first + index];
    if (measured === undefined) return;
    time_us.push((curve.start_s + index * curve.interval_s) * 1e6);
    value.push(measured - model);
  });
  return { time_us, value };
}

/** Draw the whole record, thinned by the daemon so that no spike is lost. */
export function drawRecord(place, trace, signal) {
  return draw(place, () => ({
    traces: [{ x: trace.time_s.map((t) => t * 1e3), y: trace.signal, mode: "lines", line: { color: colour("kv"), width: 1 }, hovertemplate: `%{y:.4f} ${trace.unit}<extra></extra>` }],
    layout: { xaxis: axis("time since the trigger / ms"), yaxis: axis(`signal / ${trace.unit}`), hovermode: "x", showlegend: false },
    words: `The whole record, ${trace.samples} samples.`,
  }), signal);
}
