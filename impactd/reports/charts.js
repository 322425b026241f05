// Draws the charts of a report. Where it cannot, the pictures beside them say the same.
(async () => {
  const text = (id) => document.getElementById(id).textContent;
  const packed = Uint8Array.from(atob(text("plotly")), (letter) => letter.charCodeAt(0));
  const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.src = URL.createObjectURL(new Blob([await new Response(plain).arrayBuffer()], { type: "text/javascript" }));
  await new Promise((done, failed) => { script.onload = done; script.onerror = failed; document.head.append(script); });
  const charts = JSON.parse(text("charts"));
  for (const figure of document.querySelectorAll("figure[data-chart]")) {
    const { layout, x, choices } = charts[figure.dataset.chart];
    const place = document.createElement("div");
    const draw = ({ traces }) => window.Plotly.react(place,
      traces.map((trace) => ({ ...trace, x: x[trace.x] })), structuredClone(layout), { displayModeBar: false, responsive: true });
    figure.prepend(place);
    figure.hidden = false;
    if (choices.length > 1) {
      const select = document.createElement("select");
      select.setAttribute("aria-label", "what is drawn");
      select.append(...choices.map(({ name }, at) => new Option(name, at)));
      select.onchange = () => draw(choices[select.value]);
      figure.prepend(select);
    }
    await draw(choices[0]);
  }
})();
