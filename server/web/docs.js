// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A reader of /v1/openapi.json: every operation with its parameters, bodies and answers, and a form to try it.
import { ask, getKey, setKey } from "./api.js";
import { schemaView, shortType } from "./docs_schema.js";
import { tryForm } from "./docs_try.js";
import { byId, count, make, say } from "./dom.js";

const kMethods = ["get", "post", "put", "patch", "delete"];
const kTags = { images: "Pictures", objects: "Objects", search: "Search", collections: "Collections",
                vocabularies: "Vocabularies", jobs: "Background work", backups: "Backups", keys: "Keys", imports: "Imports",
                demo: "Demonstration", health: "Health", page: "The page and this document" };

// Code between ` becomes code; nothing becomes markup.
function prose(text) {
  const parts = String(text ?? "").split("`");
  return make("span", {}, ...parts.map((part, i) => (i % 2 ? make("code", { text: part }) : part)));
}

const heading = (text) => make("h3", { text });

function parameterTable(parameters, schemas) {
  const rows = parameters.map((one) => {
    const schema = one.schema ?? one.content?.["application/json"]?.schema ?? {};
    return make("tr", {},
      make("th", { scope: "row" }, make("code", { text: one.name }), one.required ? make("span", { class: "needed", text: " needed" }) : ""),
      make("td", { text: one.in }), make("td", { text: shortType(schema, schemas) }), make("td", {}, prose(one.description)));
  });
  return make("div", { class: "scroll wrap", role: "region", "aria-label": "Parameters", tabindex: "0" }, make("table", {},
    make("thead", {}, make("tr", {}, ...["Name", "In", "Kind", "Meaning"].map((text) => make("th", { scope: "col", text })))),
    make("tbody", {}, ...rows)));
}

function bodyView(body, schemas) {
  const list = make("ul", { class: "plain" });
  for (const [type, { schema }] of Object.entries(body.content)) {
    list.append(make("li", {}, make("code", { text: type }), schema ? schemaView(schema, schemas) : " the bytes of a picture"));
  }
  return list;
}

function answersView(responses, schemas) {
  return make("ul", { class: "plain answers" }, ...Object.entries(responses).map(([status, answer]) => {
    const content = Object.entries(answer.content ?? {})[0];
    const good = status < "400";
    return make("li", {}, make("strong", { class: good ? "good" : "bad", text: status }), " ", prose(answer.description),
                content && good ? make("span", { class: "quiet", text: ` ${content[0]}` }) : "",
                content && good && content[1].schema ? schemaView(content[1].schema, schemas) : "");
  }));
}

function operationView(method, path, operation, schemas) {
  const box = make("details", { class: "operation", id: operation.operationId });
  box.append(make("summary", {}, make("span", { class: `method ${method}`, text: method.toUpperCase() }), " ",
                  make("code", { text: path }), make("span", { class: "says" }, prose(operation.summary))));
  const fill = () => {
    if (box.children.length > 1) return;
    const parameters = operation.parameters ?? [];
    const inside = make("div", { class: "inside" });
    const scope = operation["x-scope"];
    if (operation.description) inside.append(make("p", {}, prose(operation.description)));
    if (scope) inside.append(make("p", { class: "quiet", text: scope === "public" ? "For everyone." : `Needs a key with scope ${scope}, where the server has keys.` }));
    if (parameters.length) inside.append(heading("Parameters"), parameterTable(parameters, schemas));
    if (operation.requestBody) inside.append(heading("Body"), bodyView(operation.requestBody, schemas));
    inside.append(heading("Answers"), answersView(operation.responses, schemas));
    const sample = operation["x-codeSamples"]?.[0];
    if (sample) inside.append(heading("Example"), make("pre", { tabindex: "0", text: sample.source }));
    inside.append(tryForm(method, path, operation, schemas));
    box.append(inside);
  };
  box.addEventListener("toggle", () => {
    if (!box.open) return;
    fill();
    history.replaceState(null, "", `#${operation.operationId}`);
  });
  box.words = `${method} ${path} ${JSON.stringify(operation)}`.toLowerCase();
  return box;
}

function show(document) {
  const { schemas } = document.components;
  const meanings = new Map((document.tags ?? []).map(({ name, description }) => [name, description]));
  const groups = new Map();
  for (const [path, item] of Object.entries(document.paths)) {
    for (const method of kMethods.filter((one) => item[one])) {
      const operation = item[method];
      const tag = operation.tags?.[0] ?? operation.operationId.split(".")[0];
      if (!groups.has(tag)) groups.set(tag, []);
      groups.get(tag).push(operationView(method, path, operation, schemas));
    }
  }
  byId("docs-title").textContent = `HTTP interface of ${document.info.title} ${document.info.version}`;
  byId("docs").replaceChildren(
    ...(document.info.description ? [make("p", {}, prose(document.info.description))] : []),
    ...[...groups].map(([tag, list]) => make("section", { class: "panel", "aria-label": kTags[tag] ?? tag },
      make("h2", { text: kTags[tag] ?? tag[0].toUpperCase() + tag.slice(1) }),
      make("p", { class: "quiet", text: meanings.get(tag) ?? "" }), ...list)),
    make("section", { class: "panel", "aria-label": "Schemas" }, make("h2", { text: "Schemas" }),
         ...Object.entries(schemas).map(([name, schema]) => {
           const box = make("details", { class: "operation", id: `schema-${name}` }, make("summary", {}, make("code", { text: name })));
           box.append(schemaView(schema, schemas));
           box.words = `${name} ${JSON.stringify(schema)}`.toLowerCase();
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
    for (const box of boxes) {
      box.hidden = !wanted.every((word) => box.words.includes(word));
      left += box.hidden ? 0 : 1;
    }
    section.hidden = boxes.every((box) => box.hidden);
  }
  say(byId("docs-status"), wanted[0] ? `${count(left, "entry", "entries")} left.` : "");
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
