// Several traces in one chart, and below it how each differs from the first.

import { axis, colour, draw } from "./plotly.js";
import { materials } from "../js/words.js";

const COLOURS = ["kv", "hsd", "named", "bad", "measured", "warn", "accent", "ink"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "solid", "dash"];

/** Draw shots over each other; `byPeak` makes every peak one. */
export function drawCompared(place, found, byPeak, signal) {
  const unit = byPeak ? "" : ` / ${found[0]?.trace.unit ?? "V"}`;
  return draw(place, () => {
    const lines = found.map(({ shot, trace }, index) => ({
      x: trace.time_s.map((t) => t * 1e6),
      y: byPeak ? trace.signal.map((value) => value / shot.peak) : trace.signal,
      name: `${shot.number}: ${materials(shot.sphere, shot.surface)}`,
      mode: "lines",
      line: { color: colour(COLOURS[index]), dash: DASHES[index], width: 1.75 },
    }));
    const [first, ...others] = lines;
    const names = found.map(({ shot }) => shot.number);
    return {
      traces: [...lines, ...others.map((line, index) => ({
        ...line, y: difference(line, first), yaxis: "y2", showlegend: false, hovertemplate: `%{y:.4f}<extra>${names[index + 1]} − ${names[0]}</extra>`,
      }))],
      layout: {
        xaxis: axis("time since the trigger / µs", { anchor: others.length ? "y2" : "y", zeroline: false }),
        yaxis: axis(byPeak ? "signal / peak" : `signal${unit}`, { domain: others.length ? [0.43, 1] : [0, 1] }),
        ...(others.length ? { yaxis2: axis(`minus shot ${names[0]}${unit}`, { domain: [0, 0.35], zeroline: true, zerolinecolor: colour("edge") }) } : {}),
        hovermode: "x unified",
      },
      words: `The overlaid traces of shots ${names.join(", ")}${others.length ? `; below them how each differs from shot ${names[0]}` : ""}.`,
    };
  }, signal);
}

/** Return a line minus another at its own times; null where the other has none. */
export function difference(line, other) {
  let at = 0;
  return line.x.map((x, index) => {
    while (at < other.x.length - 2 && other.x[at + 1] < x) at += 1;
    const [before, after] = [other.x[at], other.x[at + 1]];
    if (!(before <= x && x <= after)) return null;
    const share = (x - before) / (after - before);
    return line.y[index] - (other.y[at] * (1 - share) + other.y[at + 1] * share);
  });
}
