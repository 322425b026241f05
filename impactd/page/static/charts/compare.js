// Several traces in one chart.

import { axis, colour, draw } from "./plotly.js";
import { materials } from "../js/words.js";

const COLOURS = ["kv", "hsd", "named", "bad", "measured", "warn", "accent", "ink"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "solid", "dash"];

/** Draw shots over each other; `byPeak` makes every peak one. */
export function drawCompared(place, found, byPeak, signal) {
  return draw(place, () => ({
    traces: found.map(({ shot, trace }, index) => ({
      x: trace.time_s.map((t) => t * 1e6),
      y: byPeak ? trace.signal.map((value) => value / shot.peak) : trace.signal,
      name: `${shot.number}: ${materials(shot.sphere, shot.surface)}`,
      mode: "lines",
      line: { color: colour(COLOURS[index]), dash: DASHES[index], width: 1.75 },
    })),
    layout: {
      xaxis: axis("time since the trigger / µs", { zeroline: false }),
      yaxis: axis(byPeak ? "signal / peak" : `signal / ${found[0]?.trace.unit ?? "V"}`),
      hovermode: "x unified",
    },
    words: `The overlaid traces of shots ${found.map(({ shot }) => shot.number).join(", ")}.`,
  }), signal);
}
