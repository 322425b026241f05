// The first visit: a token is shown once and becomes a session.

import { fill, h } from "../js/dom.js";
import { begin } from "../js/session.js";
import { field } from "../parts/fields.js";

/** Show the form; call `enter` once somebody is signed in. */
export function showSignIn(place, { why, enter }) {
  document.title = "Sign in · impactd";
  const token = field("Token", { type: "password", autocomplete: "off", required: true, spellcheck: "false" });
  const wrong = h("p", { class: "wrong", role: "alert" });
  const submit = async (event) => {
    event.preventDefault();
    wrong.textContent = "";
    try {
      await begin(token.input.value.trim());
    } catch (problem) {
      wrong.textContent = problem.message;
      token.input.setAttribute("aria-invalid", "true");
      token.input.focus();
      return;
    }
    enter();
  };
  fill(place, h("form", { class: "card sign-in", on: { submit } },
    h("h1", {}, "Sign in"),
    why && h("p", { class: "notice warn" }, why),
    h("p", {}, "This page moves a rig, so you must sign in. Make a token on the rig's computer and paste it here:"),
    h("p", {}, h("code", {}, "impactd token create --scope operate --name YOU")),
    token, wrong,
    h("button", { class: "button main-action large", type: "submit" }, "Sign in"),
    h("p", { class: "soft" }, "The token is not kept in this browser. You stay signed in for twelve hours.")));
  token.input.focus();
}
