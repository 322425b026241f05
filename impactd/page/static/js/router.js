// From #/shots/17 to a view. A view gets its place and a signal that ends with it.

import { byId, fill, h } from "./dom.js";

const routes = [];
let ending = new AbortController();

/** Add a view: `show(place, { signal, parameters })` fills `place`. */
export function addView(pattern, title, show) {
  routes.push({ pattern, title, show });
}

export const here = () => location.hash.replace(/^#/, "") || "/rig";

/** Show the view of the address. `quietly` leaves the focus where it is. */
export function showView({ quietly = false } = {}) {
  ending.abort();
  ending = new AbortController();
  const { signal } = ending;
  const address = here().split("?")[0];
  const found = routes.map((route) => ({ ...route, match: route.pattern.exec(address) })).find((route) => route.match);
  const place = byId("main");
  if (!found) {
    fill(place, h("h1", {}, "There is no such view"), h("p", {}, h("a", { href: "#/rig" }, "Back to the rig")));
    return;
  }
  markWay(address);
  const title = typeof found.title === "function" ? found.title(found.match) : found.title;
  document.title = `${title} · impactd`;
  fill(place);
  found.show(place, { signal, parameters: found.match.slice(1) });
  if (!quietly) {
    window.scrollTo(0, 0);
    const heading = place.querySelector("h1");
    heading?.setAttribute("tabindex", "-1");
    (heading ?? place).focus({ preventScroll: true });
  }
}

/** End the view that is shown, so that nothing of it goes on. */
export function endView() { ending.abort(); }

function markWay(view) {
  const address = view.replace(/^\/compare/, "/shots").replace(/^\/moduli/, "/results"); // which has no way of its own
  for (const link of document.querySelectorAll("#nav a")) {
    const leads = address.startsWith(link.hash.slice(1));
    if (leads) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}
