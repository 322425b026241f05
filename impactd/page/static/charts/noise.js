// The noise of the idle input from shot to shot.

import { axis, colour, draw, shotAxis } from "./plotly.js";

/** Draw the noise of the latest shots, oldest first. */
export function drawNoise(place, { numbers, started_utc: started, noise_rms_V: noise }, signal) {
  return draw(place, () => ({
    traces: [{
      x: numbers,
      y: noise.map((value) => value * 1e3),
      text: started.map((utc) => utc.slice(0, 16).replace("T", " ")),
      mode: "lines+markers",
      marker: { color: colour("kv"), size: 6 },
      line: { color: colour("edge"), width: 1 },
      hovertemplate: "shot %{x}, %{text} UTC<br>%{y:.3g} mV rms<extra></extra>",
    }],
    layout: {
      xaxis: shotAxis(numbers),
      // From zero: a change of a hundredth must not look like a fault.
      yaxis: axis("noise / mV rms", { rangemode: "tozero" }),
      showlegend: false,
    },
    words: `Noise before the trigger of the latest ${numbers.length} shots.`,
  }), signal);
}
