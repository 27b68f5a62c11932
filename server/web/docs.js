// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A reader of /v1/openapi.json: every operation with its parameters, bodies and responses, and a form to try it.
import { ask, getKey, setKey } from "./api.js";
import { tryForm } from "./docs_try.js";
import { attempt, byId, count, make, say } from "./dom.js";

const kDeepest = 3;  // open levels of a schema; deeper ones are opened by hand
const kMethods = ["get", "post", "put", "patch", "delete"];
const kTags = { jobs: "Background jobs", demo: "Demonstration", page: "The page and this document" };  // the others are words already

// --- schemas

const nameOf = (ref) => ref.split("/").at(-1);
const resolved = (schema, schemas) => (schema?.$ref ? schemas[nameOf(schema.$ref)] : schema) ?? {};

// A few words: "integer 1 to 500, default 50", "list of Image".
function shortType(schema, schemas) {
  if (schema.$ref) return nameOf(schema.$ref);
  const joined = (list, word) => list.map((one) => shortType(one, schemas)).join(word);
  const choices = schema.anyOf ?? schema.oneOf;
  const { minimum, maximum } = schema;
  const parts = [
    choices ? joined(choices, " or ") : schema.allOf ? joined(schema.allOf, " and ") :
      schema.const !== undefined ? JSON.stringify(schema.const) : schema.enum ? schema.enum.map((one) => JSON.stringify(one)).join(" or ") :
      schema.type === "array" ? `list of ${shortType(schema.items ?? {}, schemas)}` : [schema.type ?? "anything"].flat().join(" or ")];
  if (schema.format) parts.push(`(${schema.format})`);
  if (minimum !== undefined && maximum !== undefined) parts.push(`${minimum} to ${maximum}`);
  else if (minimum !== undefined) parts.push(`at least ${minimum}`);
  else if (maximum !== undefined) parts.push(`up to ${maximum}`);
  return parts.join(" ") + (schema.default === undefined ? "" : `, default ${JSON.stringify(schema.default)}`);
}

const requiredMark = (isRequired) => (isRequired ? make("span", { class: "needed", text: " required" }) : "");
const quiet = (text) => make("span", { class: "quiet", text });

const propertyList = (properties, required, schemas, depth) => make("ul", { class: "schema" }, ...Object.entries(properties).map(([name, one]) =>
  make("li", {}, make("code", { text: name }), requiredMark(required.includes(name)), " ", quiet(shortType(one, schemas)),
    one.description ? ` – ${one.description}` : "", inner(one, schemas, depth + 1))));

// The contents of a property, if it is more than a value.
function inner(schema, schemas, depth) {
  const target = resolved(schema, schemas);
  const held = target.type === "array" ? target.items ?? {} : schema;
  const object = resolved(held, schemas);
  if (!object.properties && !object.allOf && !object.anyOf && !object.oneOf) return "";
  if (depth < kDeepest && !held.$ref) return schemaView(held, schemas, depth);
  const box = make("details", { class: "inner" }, make("summary", { text: held.$ref ? nameOf(held.$ref) : "properties" }));
  box.addEventListener("toggle", () => {
    if (box.open && box.children.length === 1) box.append(schemaView(object, schemas, 0));
  });
  return box;
}

function schemaView(schema, schemas, depth = 0) {
  const target = resolved(schema, schemas);
  const parts = target.allOf ?? target.anyOf ?? target.oneOf;
  const view = make("div", { class: "schema-view" }, schema.$ref ? quiet(` ${nameOf(schema.$ref)}`) : "");
  if (target.description && depth === 0) view.append(make("p", { class: "quiet", text: target.description }));
  if (target.properties) view.append(propertyList(target.properties, target.required ?? [], schemas, depth));
  else if (parts) view.append(...parts.map((one) => schemaView(one, schemas, depth + 1)));
  else view.append(quiet(` ${shortType(target, schemas)}`), target.type === "array" ? inner(target, schemas, depth) : "");
  return view;
}

// --- operations

const titleOf = (tag) => kTags[tag] ?? tag[0].toUpperCase() + tag.slice(1);

// Code between ` becomes code; nothing becomes markup.
const prose = (text) => make("span", {}, ...String(text ?? "").split("`").map((part, i) => (i % 2 ? make("code", { text: part }) : part)));
const heading = (text) => make("h3", { text });

function parameterTable(parameters, schemas) {
  const rows = parameters.map((one) => make("tr", {},
    make("th", { scope: "row" }, make("code", { text: one.name }), requiredMark(one.required)), make("td", { text: one.in }),
    make("td", { text: shortType(one.schema ?? one.content?.["application/json"]?.schema ?? {}, schemas) }), make("td", {}, prose(one.description))));
  const titles = ["Name", "In", "Type", "Meaning"].map((text) => make("th", { scope: "col", text }));
  return make("div", { class: "scroll wrap", role: "region", "aria-label": "Parameters", tabindex: "0" },
    make("table", {}, make("thead", {}, make("tr", {}, ...titles)), make("tbody", {}, ...rows)));
}

const bodyView = (body, schemas) => make("ul", { class: "plain" }, ...Object.entries(body.content).map(([type, { schema }]) =>
  make("li", {}, make("code", { text: type }), schema ? schemaView(schema, schemas) : " the bytes of an image")));

const responsesView = (responses, schemas) => make("ul", { class: "plain answers" }, ...Object.entries(responses).map(([status, answer]) => {
  const good = status < "400";
  const [type, content] = (good && Object.entries(answer.content ?? {})[0]) || [];
  return make("li", {}, make("strong", { class: good ? "good" : "bad", text: status }), " ", prose(answer.description),
              type ? make("span", { class: "quiet", text: ` ${type}` }) : "", content?.schema ? schemaView(content.schema, schemas) : "");
}));

// A box that is opened by hand, and found by its words.
function boxOf(id, words, ...summary) {
  const box = make("details", { class: "operation", id }, make("summary", {}, ...summary));
  box.words = words.toLowerCase();
  return box;
}

function operationView(method, path, operation, schemas) {
  const box = boxOf(operation.operationId, `${method} ${path} ${JSON.stringify(operation)}`,
    make("span", { class: `method ${method}`, text: method.toUpperCase() }), " ", make("code", { text: path }),
    make("span", { class: "says" }, prose(operation.summary)));
  const fill = () => {
    const { description, parameters = [], requestBody, responses, "x-scope": scope, "x-codeSamples": samples } = operation;
    const inside = make("div", { class: "inside" });
    if (description) inside.append(make("p", {}, prose(description)));
    const needs = scope === "public" ? "Needs no key." : `Needs a key with scope ${scope} if the server has keys.`;
    if (scope) inside.append(make("p", { class: "quiet", text: needs }));
    if (parameters.length) inside.append(heading("Parameters"), parameterTable(parameters, schemas));
    if (requestBody) inside.append(heading("Body"), bodyView(requestBody, schemas));
    inside.append(heading("Responses"), responsesView(responses, schemas));
    if (samples?.[0]) inside.append(heading("Example"), make("pre", { tabindex: "0", text: samples[0].source }));
    inside.append(tryForm(method, path, operation));
    box.append(inside);
  };
  box.addEventListener("toggle", () => {
    if (!box.open) return;
    if (box.children.length === 1) fill();
    history.replaceState(null, "", `#${operation.operationId}`);
  });
  return box;
}

function show({ components: { schemas }, tags = [], paths, info }) {
  const meanings = new Map(tags.map(({ name, description }) => [name, description]));
  const groups = new Map();
  for (const [path, item] of Object.entries(paths)) {
    for (const method of kMethods.filter((one) => item[one])) {
      const operation = item[method];
      const tag = operation.tags?.[0] ?? operation.operationId.split(".")[0];
      groups.set(tag, [...(groups.get(tag) ?? []), operationView(method, path, operation, schemas)]);
    }
  }
  const section = (title, ...inside) => make("section", { class: "panel", "aria-label": title }, make("h2", { text: title }), ...inside);
  byId("docs-title").textContent = `HTTP API of ${info.title} ${info.version}`;
  byId("docs").replaceChildren(
    ...(info.description ? [make("p", {}, prose(info.description))] : []),
    ...[...groups].map(([tag, list]) => section(titleOf(tag), make("p", { class: "quiet", text: meanings.get(tag) ?? "" }), ...list)),
    section("Schemas", ...Object.entries(schemas).map(([name, schema]) => {
      const box = boxOf(`schema-${name}`, `${name} ${JSON.stringify(schema)}`, make("code", { text: name }));
      box.append(schemaView(schema, schemas));
      return box;
    })));
}

function openFromAddress() {
  const box = byId(decodeURIComponent(location.hash.slice(1)));
  if (!box?.matches("details")) return;
  box.open = true;
  box.scrollIntoView({ block: "start" });
}

byId("docs-find").addEventListener("input", () => {
  const wanted = byId("docs-find").value.trim().toLowerCase().split(/\s+/);
  let left = 0;
  for (const section of byId("docs").querySelectorAll("section")) {
    const boxes = [...section.querySelectorAll("details.operation")];
    for (const box of boxes) box.hidden = !wanted.every((word) => box.words.includes(word));
    left += boxes.filter((box) => !box.hidden).length;
    section.hidden = boxes.every((box) => box.hidden);
  }
  say(byId("docs-status"), wanted[0] ? `${count(left, "entry", "entries")} found.` : "");
});
byId("docs-tools").addEventListener("submit", (event) => event.preventDefault());
byId("docs-key").value = getKey();
byId("docs-key").addEventListener("change", () => setKey(byId("docs-key").value.trim()));

attempt(byId("docs-status"), async () => {
  show(await ask("/v1/openapi.json"));
  openFromAddress();
  addEventListener("hashchange", openFromAddress);
});
