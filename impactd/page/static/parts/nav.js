// The ways to the views.

import { byId, fill, h } from "../js/dom.js";
import { live } from "../js/live.js";

const VIEWS = [
  ["#/rig", "Drop"],
  ["#/shots", "Shots"],
  ["#/results", "Results"],
  ["#/calibration", "Calibration"],
  ["#/diagnoses", "Diagnoses"],
  ["#/recordings", "Own recordings"],
  ["#/health", "Rig"],
  ["#/materials", "Materials"],
  ["#/models", "Models"],
  ["#/log", "Log"],
];

export function showNav() {
  fill(byId("nav"), h("ul", {}, VIEWS.map(([address, name]) => h("li", {}, h("a", { href: address }, name))), h("li", { class: "hide-narrow" }, manualLink())));
}

/** Return the link to the manual, unseen where this installation has none. */
export function manualLink(attributes = {}) {
  const link = h("a", { ...attributes, href: "/guides", hidden: !live.status?.manual }, "Manual");
  live.addEventListener("status", ({ detail }) => { link.hidden = !detail.manual; }, { once: true });
  return link;
}
