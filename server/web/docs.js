// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A reader of /v1/openapi.json: every operation with its parameters, bodies and responses, and a form to try it.
import { ask, getKey, keyHeaders, setKey } from "./api.js";
import { attempt, byId, count, figure, fileSize, make, onSubmit, resultOr, say } from "./dom.js";

const kDeepest = 3;  // open levels of a schema; deeper ones are opened by hand
const kMethods = ["get", "post", "put", "patch", "delete"];
const kTags = { jobs: "Background jobs", demo: "Demonstration", page: "The page and this document" };  // the others are words already

let schemas = {};  // of the document, by name

const quiet = (text) => make("span", { class: "quiet", text });
const code = (text) => make("code", { text });
const heading = (text) => make("h3", { text });
// Code between ` becomes code; nothing becomes markup.
const prose = (text) => make("span", {}, ...String(text ?? "").split("`").map((part, i) => (i % 2 ? code(part) : part)));

// --- schemas

const nameOf = (ref) => ref.split("/").at(-1);
const resolved = (schema) => (schema.$ref ? schemas[nameOf(schema.$ref)] : schema) ?? {};
const partsOf = ({ allOf, anyOf, oneOf }) => allOf ?? anyOf ?? oneOf;

// A few words: "integer 1 to 500, default 50", "list of Image".
function shortType(schema) {
  const { $ref, type, items = {}, format, minimum, maximum } = schema;
  if ($ref) return nameOf($ref);
  const parts = partsOf(schema)?.map(shortType) ?? (schema.const === undefined ? schema.enum : [schema.const])?.map((one) => JSON.stringify(one)) ??
    (type === "array" ? [`list of ${shortType(items)}`] : [type ?? "anything"].flat());
  const words = [parts.join(schema.allOf ? " and " : " or ")];
  if (format) words.push(`(${format})`);
  if (minimum !== undefined && maximum !== undefined) words.push(`${minimum} to ${maximum}`);
  else if (minimum !== undefined) words.push(`at least ${minimum}`);
  else if (maximum !== undefined) words.push(`up to ${maximum}`);
  return words.join(" ") + (schema.default === undefined ? "" : `, default ${JSON.stringify(schema.default)}`);
}

const requiredMark = (isRequired) => (isRequired ? make("span", { class: "needed", text: " required" }) : "");

const propertyList = ({ properties, required = [] }, depth) => make("ul", { class: "schema" }, ...Object.entries(properties).map(([name, one]) =>
  make("li", {}, code(name), requiredMark(required.includes(name)), " ", quiet(shortType(one)),
    one.description ? ` – ${one.description}` : "", inner(one, depth + 1))));

// The contents of a property, if it is more than a value.
function inner(schema, depth) {
  const target = resolved(schema);
  const held = target.type === "array" ? target.items ?? {} : schema;
  const object = resolved(held);
  if (!object.properties && !partsOf(object)) return "";
  if (depth < kDeepest && !held.$ref) return schemaView(held, depth);
  return laterBox({ class: "inner" }, [held.$ref ? nameOf(held.$ref) : "properties"], () => schemaView(object));
}

function schemaView(schema, depth = 0) {
  const target = resolved(schema);
  const view = make("div", { class: "schema-view" }, schema.$ref ? quiet(` ${nameOf(schema.$ref)}`) : "");
  if (target.description && depth === 0) view.append(make("p", { class: "quiet", text: target.description }));
  if (target.properties) view.append(propertyList(target, depth));
  else if (partsOf(target)) view.append(...partsOf(target).map((one) => schemaView(one, depth + 1)));
  else view.append(quiet(` ${shortType(target)}`), target.type === "array" ? inner(target, depth) : "");
  return view;
}

// A box whose contents are made when it is opened first.
function laterBox(properties, summary, contents) {
  const box = make("details", properties, make("summary", {}, ...summary));
  box.addEventListener("toggle", () => { if (box.open && box.children.length === 1) box.append(contents()); });
  return box;
}

// --- a form that sends one request exactly as typed, and shows the whole response

const kLongestText = 200_000;  // characters of a response that are shown
const kShownHeaders = ["content-type", "etag", "location", "cache-control", "retry-after", "x-request-id"];
const kDefaults = { c: "default" };  // of parameters in the path

function field(parameter) {
  const { schema = {} } = parameter;
  const control = schema.enum ?
    make("select", {}, make("option", { value: "", text: "default" }), ...schema.enum.map((one) => make("option", { text: one }))) :
    make("input", { type: "text", autocomplete: "off", spellcheck: "false", placeholder: schema.default ?? "" });
  if (parameter.in === "path") control.value = kDefaults[parameter.name] ?? "";
  control.required = Boolean(parameter.required);
  return { parameter, control, label: make("label", {}, make("span", { text: parameter.name }), control) };
}

// The body: JSON as text, or an image as a file.
function bodyFields(requestBody) {
  const types = Object.keys(requestBody?.content ?? {});
  const json = types.find((type) => type.endsWith("json"));
  const label = (text, control) => make("label", { class: "wide" }, make("span", { text }), control);
  const parts = { json, text: null, file: null, labels: [] };
  if (json) {
    parts.text = make("textarea", { rows: 4, spellcheck: "false", autocomplete: "off", placeholder: "{ }" });
    parts.labels.push(label(`Body, ${json}`, parts.text));
  }
  if (types.includes("image/*") || types.includes("multipart/form-data")) {
    parts.file = make("input", { type: "file", accept: "image/*", multiple: !types.includes("image/*") });
    parts.labels.push(label(json ? "Or an image" : "Image", parts.file));
  }
  return parts;
}

const quoted = (text) => `'${text.replaceAll("'", "'\\''")}'`;

// The request of the form: { url, options, curl }. Throws an Error with a sentence.
function requestOf(method, path, fields, body) {
  const query = new URLSearchParams();
  const headers = {};
  let url = path.slice(1);  // relative: a proxy can serve the page below any path
  for (const { parameter, control } of fields) {
    const value = control.value.trim();
    if (parameter.in === "path") {
      if (!value) throw new Error(`${parameter.name} is required.`);
      url = url.replace(`{${parameter.name}}`, encodeURIComponent(value));
    } else if (value && parameter.in === "query") query.set(parameter.name, value);
    else if (value && parameter.in === "header") headers[parameter.name] = value;
  }
  if (query.size) url += `?${query}`;
  const options = { method: method.toUpperCase(), headers };
  const curl = ["curl", ...(method === "get" ? [] : ["-X", options.method])];
  const files = [...(body.file?.files ?? [])];
  const text = body.text?.value.trim();
  if (files.length) {
    options.body = new FormData();
    for (const file of files) {
      options.body.append("image", file);
      curl.push("-F", quoted(`image=@${file.name}`));
    }
  } else if (text) {
    try {
      JSON.parse(text);
    } catch (error) {
      throw new Error(`The body is not valid JSON: ${error.message}`);
    }
    options.body = text;
    headers["Content-Type"] = body.json;
    curl.push("-d", quoted(text));
  }
  for (const [name, value] of Object.entries(headers)) curl.push("-H", quoted(`${name}: ${value}`));
  if (getKey()) curl.push("-H", '"Authorization: Bearer $KEY"');
  Object.assign(headers, keyHeaders());
  return { url, options, curl: [...curl, quoted(new URL(url, location.href).href)].join(" ") };
}

async function contentView(blob, type) {
  if (type.startsWith("image/")) {
    const image = make("img", { alt: "The response", class: "answer-image", src: URL.createObjectURL(blob) });
    image.addEventListener("load", () => URL.revokeObjectURL(image.src), { once: true });
    return [image];
  }
  if (!/json|text/.test(type)) return [make("p", { text: `${fileSize(blob.size)} of ${type || "an unknown type"}` })];
  let text = await blob.text();
  if (/json$|json;/.test(type) && text.length < 10 * kLongestText) {
    const lines = text;
    text = resultOr(lines, () => JSON.stringify(JSON.parse(lines), null, 2));
  }
  const view = [make("pre", { class: "answer-text", tabindex: "0", text: text.slice(0, kLongestText) })];
  if (text.length > kLongestText) view.push(make("p", { class: "quiet", text: `The first ${figure(kLongestText)} of ${figure(text.length)} characters.` }));
  return view;
}

async function answerView(answer, tookMs) {
  const { ok, status, statusText, headers } = answer;
  const lines = kShownHeaders.filter((name) => headers.has(name)).map((name) => `${name}: ${headers.get(name)}`);
  const blob = await answer.blob();
  return [make("p", {}, make("strong", { class: ok ? "good" : "bad", text: `${status} ${statusText}`.trim() }), ` in ${Math.round(tookMs)} ms`),
          make("pre", { class: "quiet", tabindex: "0", text: lines.join("\n") }),
          ...(blob.size ? await contentView(blob, headers.get("content-type") ?? "") : [])];
}

function tryForm(method, path, operation) {
  const fields = (operation.parameters ?? []).map(field);
  const body = bodyFields(operation.requestBody);
  const status = make("p", { role: "status" });
  const curl = make("pre", { tabindex: "0", hidden: true });
  const result = make("div", { class: "result" });
  const send = make("button", { type: "submit", class: "primary", text: `Send ${method.toUpperCase()}` });
  return make("form", { class: "try", novalidate: true, "aria-label": `Try ${method.toUpperCase()} ${path}`, async onsubmit(event) {
    event.preventDefault();
    result.replaceChildren();
    try {
      const request = requestOf(method, path, fields, body);
      curl.hidden = false;
      curl.textContent = request.curl;
      say(status, "Waiting for the response…");
      send.disabled = true;
      const start = performance.now();
      const answer = await fetch(request.url, request.options);
      result.replaceChildren(...await answerView(answer, performance.now() - start));
      say(status, "");
    } catch (error) {
      say(status, error instanceof TypeError ? "The server cannot be reached." : error.message, true);
    } finally {
      send.disabled = false;
    }
  } }, heading("Try it"), make("div", { class: "fields" }, ...fields.map(({ label }) => label), ...body.labels),
     make("div", { class: "row" }, send), status, curl, result);
}

// --- operations

const titleOf = (tag) => kTags[tag] ?? tag[0].toUpperCase() + tag.slice(1);

function parameterTable(parameters) {
  const rows = parameters.map((one) => make("tr", {},
    make("th", { scope: "row" }, code(one.name), requiredMark(one.required)), make("td", { text: one.in }),
    make("td", { text: shortType(one.schema ?? one.content?.["application/json"]?.schema ?? {}) }), make("td", {}, prose(one.description))));
  const titles = ["Name", "In", "Type", "Meaning"].map((text) => make("th", { scope: "col", text }));
  return make("div", { class: "scroll wrap", role: "region", "aria-label": "Parameters", tabindex: "0" },
    make("table", {}, make("thead", {}, make("tr", {}, ...titles)), make("tbody", {}, ...rows)));
}

const bodyView = (body) => make("ul", { class: "plain" }, ...Object.entries(body.content).map(([type, { schema }]) =>
  make("li", {}, code(type), schema ? schemaView(schema) : " the bytes of an image")));

const responsesView = (responses) => make("ul", { class: "plain answers" }, ...Object.entries(responses).map(([status, answer]) => {
  const good = status < "400";
  const [type, content] = (good && Object.entries(answer.content ?? {})[0]) || [];
  return make("li", {}, make("strong", { class: good ? "good" : "bad", text: status }), " ", prose(answer.description),
              type ? quiet(` ${type}`) : "", content?.schema ? schemaView(content.schema) : "");
}));

function operationContents(method, path, operation) {
  const { description, parameters = [], requestBody, responses, "x-scope": scope, "x-codeSamples": samples } = operation;
  const inside = make("div", { class: "inside" });
  if (description) inside.append(make("p", {}, prose(description)));
  const needs = scope === "public" ? "Needs no key." : `Needs a key with scope ${scope} if the server has keys.`;
  if (scope) inside.append(make("p", { class: "quiet", text: needs }));
  if (parameters.length) inside.append(heading("Parameters"), parameterTable(parameters));
  if (requestBody) inside.append(heading("Body"), bodyView(requestBody));
  inside.append(heading("Responses"), responsesView(responses));
  if (samples?.[0]) inside.append(heading("Example"), make("pre", { tabindex: "0", text: samples[0].source }));
  inside.append(tryForm(method, path, operation));
  return inside;
}

// A box that is found by its words.
function entry(id, words, summary, contents) {
  const box = laterBox({ class: "operation", id }, summary, contents);
  box.words = words.toLowerCase();
  return box;
}

function operationView(method, path, operation) {
  const { operationId, summary } = operation;
  const box = entry(operationId, `${method} ${path} ${JSON.stringify(operation)}`,
    [make("span", { class: `method ${method}`, text: method.toUpperCase() }), " ", code(path), make("span", { class: "says" }, prose(summary))],
    () => operationContents(method, path, operation));
  box.addEventListener("toggle", () => { if (box.open) history.replaceState(null, "", `#${operationId}`); });
  return box;
}

function show({ components, tags = [], paths, info }) {
  schemas = components.schemas;
  const meanings = new Map(tags.map(({ name, description }) => [name, description]));
  const groups = new Map();
  for (const [path, item] of Object.entries(paths)) {
    for (const method of kMethods.filter((one) => item[one])) {
      const operation = item[method];
      const tag = operation.tags?.[0] ?? operation.operationId.split(".")[0];
      groups.set(tag, [...(groups.get(tag) ?? []), operationView(method, path, operation)]);
    }
  }
  const section = (title, ...inside) => make("section", { class: "panel", "aria-label": title }, make("h2", { text: title }), ...inside);
  byId("docs-title").textContent = `HTTP API of ${info.title} ${info.version}`;
  byId("docs").replaceChildren(
    ...(info.description ? [make("p", {}, prose(info.description))] : []),
    ...[...groups].map(([tag, list]) => section(titleOf(tag), make("p", { class: "quiet", text: meanings.get(tag) ?? "" }), ...list)),
    section("Schemas", ...Object.entries(schemas).map(([name, schema]) =>
      entry(`schema-${name}`, `${name} ${JSON.stringify(schema)}`, [code(name)], () => schemaView(schema)))));
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
onSubmit(byId("docs-tools"), () => {});
byId("docs-key").value = getKey();
byId("docs-key").addEventListener("change", () => setKey(byId("docs-key").value.trim()));

attempt(byId("docs-status"), async () => {
  show(await ask("v1/openapi.json"));
  openFromAddress();
  addEventListener("hashchange", openFromAddress);
}, () => location.reload());
