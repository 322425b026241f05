// The daemon's short words in plain English. An unknown word is shown as it is, never hidden.

const words = (text) => String(text).replaceAll("_", " ");

export const ADVICE = {
  use: { word: "Use", sign: "✓", badge: "good", sentence: "Use this shot." },
  check: { word: "Check", sign: "!", badge: "warn", sentence: "Check this shot, because" },
  repeat: { word: "Repeat", sign: "↻", badge: "bad", sentence: "Repeat this drop, because" },
};

export const VERDICTS = {
  adequate: "Adequate: nothing is missing",
  identified: "Identified",
  family: "A family of effects",
  partial: "Explained in part",
  unknown: "Unknown",
  not_identifiable: "Not identifiable",
};

/** Return the badge of a state of a drop, calibration or diagnosis. */
export function stateBadge(state) {
  if (["done", "analysed", "stored"].includes(state)) return "good";
  if (["failed", "interrupted"].includes(state)) return "bad";
  if (["aborted", "cancelled"].includes(state)) return "warn";
  return "busy";
}

export const materials = (sphere, surface) => `${words(sphere ?? "unknown sphere")} on ${words(surface ?? "unknown surface")}`;
export const material = (name) => words(name ?? "unknown");
const BASES = { kv2: "closed KV" };
export const modelName = (name) => {
  const [base, ...effects] = String(name).split("+");
  return [BASES[base] ?? base.toUpperCase(), ...effects.map(words)].join(" + ");
};

const REQUESTS = [
  [/^POST \/v1\/drops$/, "requested a drop"],
  [/^PATCH \/v1\/drops\/(\d+)$/, "entered the rebound of drop $1"],
  [/^DELETE \/v1\/drops\/(\d+)$/, "aborted drop $1"],
  [/^POST \/v1\/abort$/, "pressed Abort"],
  [/^POST \/v1\/acknowledge$/, "acknowledged a fault of the rig"],
  [/^POST \/v1\/alarms\/(\d+)\/acknowledge$/, "acknowledged alarm $1"],
  [/^POST \/v1\/series$/, "requested a series of drops"],
  [/^POST \/v1\/series\/(pause|resume)$/, "requested the series to $1"],
  [/^POST \/v1\/series\/drops$/, "added drops to the series"],
  [/^PUT \/v1\/series\/order$/, "reordered the series"],
  [/^DELETE \/v1\/series$/, "ended the series"],
  [/^POST \/v1\/calibrations$/, "requested a calibration"],
  [/^POST \/v1\/fits$/, "requested a fit"],
  [/^POST \/v1\/diagnoses$/, "requested a diagnosis"],
  [/^DELETE \/v1\/diagnoses\/(\d+)$/, "cancelled diagnosis $1"],
  [/^POST \/v1\/diagnoses\/(\d+)\/next-drop$/, "made the drop that diagnosis $1 proposes"],
  [/^PUT \/v1\/recordings\/([^/]+)\/files\/(.+)$/, "uploaded $2 to the recordings $1"],
  [/^PUT \/v1\/recordings\/([^/]+)\/drops$/, "stated the drops of the recordings $1 by a table"],
  [/^DELETE \/v1\/recordings\/([^/]+)$/, "deleted the recordings $1"],
  [/^POST \/v1\/recordings\/([^/]+)\/reading$/, "had the recordings $1 read"],
  [/^POST \/v1\/recordings\/([^/]+)\/diagnoses$/, "requested a diagnosis of the recordings $1"],
  [/^PUT \/v1\/materials\/(?:sphere|surface)s\/(.+)$/, "changed the material $1"],
  [/^PUT \/v1\/models\/active$/, "chose a model"],
  [/^POST \/v1\/session$/, "signed in"],
  [/^POST \/v1\/session\/by-code$/, "signed in with a code"],
  [/^POST \/v1\/sign-in-codes$/, "made a sign-in code"],
  [/^DELETE \/v1\/session$/, "signed out"],
];

/** Return who asked for what, as one sentence. */
export function requestSentence({ by, method, path, status, location }) {
  const line = `${method} ${path}`;
  const known = REQUESTS.find(([pattern]) => pattern.test(line));
  const what = known ? line.replace(known[0], known[1]) : line;
  const where = location ? ` (${location.replace(/^\/v1\//, "").replace("diagnoses/", "diagnosis ").replace(/s\/(\d+)$/, " $1")})` : "";
  return `${by} ${what}${where}${status >= 400 ? `; refused (${status})` : ""}.`;
}

/** Return an event as one sentence. */
export function eventSentence({ kind, data }) {
  switch (kind) {
    case "request": return requestSentence(data);
    case "drop.stored": return `Drop ${data.number} of ${data.owner}: ${materials(data.sphere, data.surface)} is stored as shot ${data.shot}.`;
    case "shot.unlike": return `Shot ${data.number}: ${data.sentence}`;
    case "drop.failed": return `Drop ${data.number} failed: ${data.detail}`;
    case "drop.aborted": return data.detail ?? `Drop ${data.number} was aborted.`;
    case "drop.interrupted": return `Drop ${data.number} was interrupted by a restart.`;
    case "calibration.done": return `Calibration ${data.number} is done.`;
    case "calibration.failed": return `Calibration ${data.number} ended: ${data.reason}`;
    case "diagnosis.done": return `Diagnosis ${data.id}: ${data.sentence}`;
    case "job.failed": return `The analysis of ${data.subject} failed: ${data.reason}`;
    case "job.cancelled": return `The analysis of ${data.subject} was cancelled.`;
    case "model.chosen": return `${data.by} made ${modelName(data.name)} the active model.`;
    case "material.changed": return `${data.by} changed the ${data.role} ${words(data.name)}.`;
    case "rig.fault": return `Fault: ${data.detail}`;
    case "rig.abort": return `${data.by === "shutdown" ? "The daemon was stopped." : `${data.by} aborted.`} ${data.sentence ?? ""}`;
    case "rig.acknowledged": return `${data.by} acknowledged the fault.`;
    case "alarm.acknowledged": return `${data.by} acknowledged alarm ${data.id}.`;
    default: return words(kind);
  }
}
