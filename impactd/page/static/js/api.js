// The REST API. Every failure is a Problem with a sentence that says what to do.

let csrf = null;
let onSignedOut = () => {};

/** Remember the second secret that every write needs. */
export function useCsrf(secret) { csrf = secret; }

/** Call this when the daemon no longer knows who we are. */
export function whenSignedOut(listener) { onSignedOut = listener; }

/** Why something did not work. */
export class Problem extends Error {
  constructor(document) {
    super([document.detail, document.remedy].filter(Boolean).join(" "));
    this.status = document.status ?? 0;
    this.type = document.type ?? "";
    this.detail = document.detail ?? "";
    this.remedy = document.remedy ?? "";
    this.document = document;
  }
}

const UNREACHABLE = {
  type: "unreachable",
  detail: "The daemon does not answer.",
  remedy: "Check that it runs and that this tablet is on the network. The page reconnects automatically.",
};

/** Return what the daemon answers to one request; throw a Problem when it refuses. */
export async function ask(method, path, { body, file, key, token, timeoutMs = 15000 } = {}) {
  const headers = { Accept: "application/json" };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (file) headers["Content-Type"] = "application/octet-stream";
  if (key) headers["Idempotency-Key"] = key;
  if (token) headers.Authorization = `Bearer ${token}`;
  else if (method !== "GET" && csrf) headers["X-CSRF-Token"] = csrf;
  let answer;
  let text;
  try {
    answer = await fetch(path, {
      method,
      headers,
      body: file ?? (body === undefined ? undefined : JSON.stringify(body)),
      signal: AbortSignal.timeout(timeoutMs),
      cache: "no-store",
    });
    text = await answer.text();
  } catch {
    throw new Problem(UNREACHABLE);
  }
  const document = read(text);
  if (answer.ok) return document;
  if (answer.status === 401 && !token) onSignedOut();
  throw new Problem(document ?? { status: answer.status, detail: `The daemon answered ${answer.status}.` });
}

function read(text) {
  try { return text ? JSON.parse(text) : null; } catch { return null; }
}

export const get = (path, options) => ask("GET", path, options);
export const post = (path, body, options) => ask("POST", path, { body, ...options });

/** Return a path with its query; what is empty is left out. */
export function withQuery(path, query) {
  const given = Object.entries(query).filter(([, value]) => value !== null && value !== undefined && value !== "");
  return given.length ? `${path}?${new URLSearchParams(given)}` : path;
}
