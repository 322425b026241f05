// The description of the REST API as a page, from /openapi.json alone: nothing is fetched from elsewhere.

import { byId, fill, h } from "./dom.js";

const place = byId("main");

/** Return the schema that a reference names, or the schema itself. */
function resolved(schema, all) {
  const name = schema?.$ref?.split("/").at(-1);
  return name ? { name, ...all[name] } : schema ?? {};
}

function typeOf(schema) {
  if (!schema) return "";
  if (schema.$ref) return schema.$ref.split("/").at(-1);
  if (schema.anyOf) return schema.anyOf.map(typeOf).join(" or ");
  if (schema.enum) return schema.enum.map((one) => JSON.stringify(one)).join(", ");
  if (schema.type === "array") return `list of ${typeOf(schema.items) || "anything"}`;
  return schema.type ?? "anything";
}

function limits(schema) {
  const found = schema.anyOf ? Object.assign({}, ...schema.anyOf) : schema;
  const said = [["minimum", "at least"], ["exclusiveMinimum", "above"], ["maximum", "at most"], ["exclusiveMaximum", "below"], ["maxLength", "characters at most"], ["maxItems", "items at most"]];
  return said.filter(([key]) => found[key] !== undefined).map(([key, words]) => `${words} ${found[key]}`).join(", ");
}

function rows(head, lines) {
  return h("div", { class: "table-frame", tabindex: "0", role: "group", "aria-label": head[0] }, h("table", {},
    h("thead", {}, h("tr", {}, head.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, lines.map((cells) => h("tr", {}, cells.map((cell, at) => h(at ? "td" : "th", at ? {} : { scope: "row" }, cell)))))));
}

const members = (schema) => rows(["Member", "Type", "About"], Object.entries(schema.properties ?? {}).map(([name, one]) => [
  h("code", {}, name), `${typeOf(one)}${schema.required?.includes(name) ? "" : ", may be left out"}`, [one.description, limits(one)].filter(Boolean).join(" ")]));

function operation(path, method, one, schemas) {
  const body = resolved(one.requestBody?.content?.["application/json"]?.schema, schemas);
  const [status, good] = Object.entries(one.responses).find(([code]) => code.startsWith("2")) ?? [];
  const answer = resolved(good?.content?.["application/json"]?.schema, schemas);
  const { example } = body;
  return h("details", { class: "card" },
    h("summary", {}, h("code", {}, `${method.toUpperCase()} ${path}`), ` ${one.summary}`),
    one.description && h("p", {}, one.description),
    one.parameters?.length && rows(["Parameter", "In", "Type", "About"], one.parameters.map((each) => [h("code", {}, each.name), `${each.in}${each.required ? ", required" : ""}`, typeOf(each.schema), [each.description, limits(each.schema)].filter(Boolean).join(" ")])),
    body.properties && [h("h3", {}, "Body"), members(body)],
    example && h("pre", {}, JSON.stringify(example, null, 1)),
    answer.properties ? [h("h3", {}, `Answer ${status}`), members(answer)] : status && h("p", {}, `Answers ${status}.`));
}

try {
  const answer = await fetch("/openapi.json");
  if (!answer.ok) throw new Error(`The daemon answered ${answer.status}.`);
  const { info, paths, components } = await answer.json();
  const byTag = new Map();
  for (const [path, methods] of Object.entries(paths)) {
    for (const [method, one] of Object.entries(methods)) {
      const tag = one.tags?.[0] ?? "other";
      byTag.set(tag, [...(byTag.get(tag) ?? []), operation(path, method, one, components.schemas)]);
    }
  }
  fill(place, h("h1", {}, `The REST API of ${info.title} ${info.version}`), info.description.split("\n\n").map((text) => h("p", {}, text)),
    h("p", {}, h("a", { href: "/openapi.json" }, "The same as OpenAPI, for programs"), "."),
    [...byTag].flatMap(([tag, all]) => [h("h2", {}, tag), ...all]));
} catch (error) {
  fill(place, h("h1", {}, "The REST API"), h("p", { class: "wrong" }, `Its description cannot be loaded: ${error.message}`));
}
