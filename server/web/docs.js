// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A reader of /v1/openapi.json: every operation with its parameters, bodies and responses, and a form to try it.
import { ask, getKey, setKey } from "./api.js";
import { requiredMark, schemaView, shortType } from "./docs_schema.js";
import { tryForm } from "./docs_try.js";
import { byId, count, make, say } from "./dom.js";

const kMethods = ["get", "post", "put", "patch", "delete"];
const kTags = { jobs: "Background jobs", demo: "Demonstration", page: "The page and this document" };  // the others are words already
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

try {
  show(await ask("/v1/openapi.json"));
  openFromAddress();
  addEventListener("hashchange", openFromAddress);
} catch (error) {
  say(byId("docs-status"), error.message, true);
}
