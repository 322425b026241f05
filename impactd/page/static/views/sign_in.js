// The first visit: a code or a token is shown once and becomes a session.

import { fill, h } from "../js/dom.js";
import { live } from "../js/live.js";
import { begin, beginByCode } from "../js/session.js";
import { field } from "../parts/fields.js";

// A code is two groups of four; somebody may type spaces around the hyphen. Tokens are longer.
const LONGEST_CODE = 12;
const isCode = (typed) => typed.length <= LONGEST_CODE;

/** Show the form, with the code of a link if there is one; call `enter` once somebody is signed in. */
export function showSignIn(place, { why, code, enter }) {
  document.title = "Sign in · impactd";
  const secret = field("Code or token", {
    value: code ?? "", autocomplete: "off", autocapitalize: "characters", required: true, spellcheck: "false",
    // A code is typed and must be seen. A token is pasted, and nobody else should read it.
    on: { input: () => { secret.input.type = isCode(secret.input.value.trim()) ? "text" : "password"; } },
  });
  const wrong = h("p", { class: "wrong", role: "alert" });
  const submit = async (event) => {
    event.preventDefault();
    wrong.textContent = "";
    const typed = secret.input.value.trim();
    try {
      await (isCode(typed) ? beginByCode(typed) : begin(typed));
    } catch (problem) {
      wrong.textContent = problem.message;
      secret.input.setAttribute("aria-invalid", "true");
      secret.input.focus();
      return;
    }
    enter();
  };
  const command = h("code", {}, "impactd token create --scope operate --name ME");
  // With the options of this daemon's own files, where the browser runs on the rig's computer.
  live.addEventListener("status", ({ detail }) => { command.textContent = detail.token_command ?? command.textContent; }, { once: true });
  const button = h("button", { class: "button main-action large", type: "submit" }, "Sign in");
  fill(place, h("form", { class: "card sign-in", on: { submit } },
    h("h1", {}, "Sign in"),
    why && h("p", { class: "notice warn" }, why),
    code
      ? h("p", {}, "Your link brought this code. Press ", h("strong", {}, "Sign in"), " to use it.")
      : [h("p", {}, "This page moves a rig, so you must sign in. Run this in a terminal that has a token, and type the code that it prints:"),
        h("p", {}, h("code", {}, "impactd sign-in-code"))],
    secret, wrong, button,
    h("p", { class: "soft" }, "A code works once and for five minutes. You stay signed in for twelve hours."),
    !code && [h("p", { class: "soft" }, "A token works too. It is not kept in this browser. On the rig's computer this makes one:"),
      h("p", {}, command)]));
  (code ? button : secret.input).focus();
}
