// How the load cell moved from calibration to calibration.

import { axis, colour, draw } from "./plotly.js";
import { day } from "../js/numbers.js";

export const QUANTITIES = [
  ["gain_N_per_V", "Gain S", "N/V"],
  ["natural_frequency_Hz", "Frequency f₀", "Hz"],
  ["damping_ratio", "Damping ratio", "1"],
];

/** Draw one quantity over the calibrations, oldest first, with its uncertainty and the day the next one is due. */
export function drawDrift(place, { series, key, title, unit, due }, signal) {
  const seen = series.filter((one) => one.identifiable?.[key]);
  const value = (one) => one.identifiable[key];
  return draw(place, () => ({
    traces: [{
      x: seen.map((one) => one.finished_utc),
      y: seen.map((one) => value(one).value),
      error_y: { type: "data", array: seen.map((one) => value(one).expanded?.U ?? 0), color: colour("kv"), thickness: 1.5, width: 5 },
      text: seen.map((one) => `calibration ${one.number}`),
      mode: "lines+markers",
      marker: { color: colour("kv"), size: 9 },
      line: { color: colour("edge"), width: 1, dash: "dot" },
      hovertemplate: `%{text}, %{x|%d %b %Y}<br>%{y} ${unit}<extra></extra>`,
    }],
    layout: {
      xaxis: axis("", { type: "date", range: rangeTo(seen, due ?? seen.at(-1)?.finished_utc) }),
      yaxis: axis(`${title} / ${unit}`, { zeroline: false }),
      shapes: due ? [{ type: "line", x0: due, x1: due, y0: 0, y1: 1, yref: "paper", line: { color: colour("warn"), width: 2, dash: "dash" } }] : [],
      annotations: due ? [{ x: due, y: 1, yref: "paper", text: `due ${day(due)}`, showarrow: false, xanchor: "right", xshift: -6, yanchor: "top", font: { color: colour("warn") } }] : [],
      showlegend: false,
      margin: { l: 72, r: 16, t: 12, b: 36 },
    },
    words: `${title} of the load cell over ${seen.length} calibrations.`,
  }), signal);
}

function rangeTo(seen, due) {
  const first = seen.length ? new Date(seen[0].finished_utc) : new Date();
  const last = new Date(Math.max(new Date(due), new Date(seen.at(-1)?.finished_utc ?? due)));
  const margin = Math.max((last - first) * 0.05, 86400e3); // of one calibration alone the day, not its microseconds
  return [new Date(first - margin).toISOString(), new Date(+last + margin).toISOString()];
}
