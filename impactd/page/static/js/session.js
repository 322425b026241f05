// Who is here: a token or a code shown once becomes a cookie that no script reads.

import { ask, get, post, useCsrf } from "./api.js";
import { recall, remember } from "./memory.js";

export const session = { name: null, scope: null };

const RANK = { read: 1, operate: 2, admin: 3 };

/** Return whether whoever is signed in may do what needs that scope. */
export const may = (scope) => (RANK[session.scope] ?? 0) >= RANK[scope];

/** Find the session that a page loaded again still has; return whether there is one. */
export async function resume() {
  // A first visit has none: asking would only write a refusal to the browser's console.
  if (!recall("signed-in", false)) return false;
  try {
    return take(await get("/v1/session"));
  } catch (problem) {
    if (problem.status === 401) return false;
    throw problem;
  }
}

/** Begin a session with a token. */
export async function begin(token) {
  return take(await post("/v1/session", undefined, { token }));
}

/** Begin a session with a code of `impactd sign-in-code`. */
export async function beginByCode(code) {
  return take(await post("/v1/session/by-code", { code }));
}

/** Return the code of a sign-in link, and take it out of the address and the history. */
export function codeOfAddress() {
  const found = /^#\/sign-in\/([\w-]{1,64})$/.exec(location.hash);
  if (!found) return null;
  history.replaceState(null, "", location.pathname);
  return found[1];
}

/** End the session. */
export async function end() {
  await ask("DELETE", "/v1/session");
  forget();
}

/** Forget who was here, because the daemon has. */
export function forget() {
  session.name = session.scope = null;
  remember("signed-in", false);
  useCsrf(null);
}

function take(answer) {
  remember("signed-in", true);
  session.name = answer.name;
  session.scope = answer.scope;
  useCsrf(answer.csrf);
  return true;
}
