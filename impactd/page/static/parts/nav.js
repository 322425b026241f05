// The ways to the views.

import { byId, fill, h } from "../js/dom.js";

const VIEWS = [
  ["#/rig", "Drop"],
  ["#/shots", "Shots"],
  ["#/results", "Results"],
  ["#/calibration", "Calibration"],
  ["#/diagnoses", "Diagnoses"],
  ["#/health", "Rig"],
  ["#/materials", "Materials"],
  ["#/models", "Models"],
  ["#/log", "Log"],
];

export function showNav() {
  fill(byId("nav"), h("ul", {}, VIEWS.map(([address, name]) => h("li", {}, h("a", { href: address }, name)))));
}
