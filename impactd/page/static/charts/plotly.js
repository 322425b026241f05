// The drawing library, fetched when a chart is first wanted, and how all charts look.

let loading = null;

/** Return plotly; throw with words for a person when it is not there. */
export function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/page/vendor/plotly.min.js";
    const restore = withoutStyles();
    script.onload = () => { restore(); resolve(window.Plotly); };
    script.onerror = () => {
      restore();
      loading = null;
      script.remove();
      reject(new Error("The charts cannot be drawn: the daemon's Python package plotly is missing, or the connection is lost. The numbers are correct without it."));
    };
    document.head.append(script);
  });
  return loading;
}

/**
 * Keep the library from writing styles while it loads: it brings those of its maps, which the page
 * does not draw, and our policy allows no inline style. Returns how to undo it.
 */
function withoutStyles() {
  const { head } = document;
  head.appendChild = (node) => (node instanceof HTMLStyleElement ? node : Node.prototype.appendChild.call(head, node));
  return () => { delete head.appendChild; };
}

/** Fetch the library while nothing else is to be done, so that the first shot need not wait. */
export function prepare() {
  const idle = window.requestIdleCallback ?? ((run) => setTimeout(run, 500));
  idle(() => plotly().catch(() => {}), { timeout: 3000 });
}

/** Return a colour of the page by its name in colours.css. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const CONFIG = { displayModeBar: false, responsive: true, doubleClick: "reset", scrollZoom: false };

export const axis = (title, more = {}) => ({
  title: { text: title, standoff: 8 },
  gridcolor: colour("grid"),
  linecolor: colour("line"),
  zerolinecolor: colour("line"),
  automargin: true,
  ticks: "outside",
  tickcolor: colour("line"),
  ...more,
});

/** An axis of shots; few of them get a tick each, so that none comes twice. */
export const shotAxis = (numbers) =>
  axis("shot", { zeroline: false, tickformat: "d", ...(numbers.length < 9 ? { tickvals: numbers } : {}) });

function look(layout) {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 14, color: colour("ink") },
    margin: { l: 64, r: 12, t: 12, b: 48 },
    hoverlabel: { bgcolor: colour("card"), bordercolor: colour("edge"), font: { color: colour("ink") } },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemwidth: 30 },
    dragmode: "zoom",
    ...layout,
  };
}

/**
 * Draw in `place`, and again in other colours when the day turns to night.
 * `make()` returns { traces, layout, words }; the words are for whoever cannot see it.
 */
export async function draw(place, make, signal) {
  let library;
  try {
    library = await plotly();
  } catch (error) {
    place.textContent = error.message;
    return;
  }
  if (signal?.aborted) return;
  const again = () => {
    const { traces, layout, words } = make();
    place.setAttribute("role", "img");
    place.setAttribute("aria-label", words);
    return library.react(place, traces, look(layout), CONFIG);
  };
  await again();
  const night = matchMedia("(prefers-color-scheme: dark)");
  night.addEventListener("change", again, { signal });
  signal?.addEventListener("abort", () => library.purge(place));
}
