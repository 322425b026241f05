// The control chart of a pair: every shot's reduced modulus in order, between its limits.

import { axis, colour, draw, shotAxis } from "./plotly.js";
import { materials } from "../js/words.js";
import { K_95, counted, modulusUnit } from "../js/numbers.js";

/** Draw a pair's shots, oldest first; those outside the limits have another colour and shape. */
export function drawControl(place, found, signal) {
  const { numbers, control } = found;
  const [scale, unit] = modulusUnit(found.reduced_modulus_Pa[0] ?? 1e9);
  const value = found.reduced_modulus_Pa.map((one) => one * scale);
  const out = value.map((_, at) => Boolean(control) && (found.reduced_modulus_Pa[at] < control.lower_Pa || found.reduced_modulus_Pa[at] > control.upper_Pa));
  const bars = numbers.length <= 200; // more would be a carpet
  const line = (y, dash) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y * scale, y1: y * scale, line: { color: colour("soft"), width: 1.25, dash } });
  return draw(place, () => ({
    traces: [{
      x: numbers,
      y: value,
      mode: "markers",
      ...(bars ? { error_y: { type: "data", array: found.u_Pa.map((u) => K_95 * u * scale), color: colour("edge"), thickness: 1, width: 0 } } : {}),
      marker: { size: bars ? 8 : 5, color: out.map((one) => colour(one ? "bad" : "kv")), symbol: out.map((one) => (one ? "diamond" : "circle")) },
      text: found.started_utc.map((utc) => utc.slice(0, 16).replace("T", " ")),
      hovertemplate: `shot %{x}, %{text} UTC<br>%{y:.5g} ${unit}<extra></extra>`,
    }],
    layout: {
      xaxis: shotAxis(numbers),
      yaxis: axis(`E* / ${unit}`, { zeroline: false, tickformat: "~g" }),
      shapes: control ? [line(control.centre_Pa, "solid"), line(control.lower_Pa, "dash"), line(control.upper_Pa, "dash")] : [],
      showlegend: false,
    },
    words: `Reduced modulus of ${counted(found.shots, "shot")} of ${materials(found.sphere, found.surface)}${control ? `; ${control.outside_count} outside the limits` : ""}.`,
  }), signal);
}
