// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A form that sends one request exactly as typed, and shows the whole response.
import { getKey, keyHeaders } from "./api.js";
import { figure, fileSize, make, resultOr, say } from "./dom.js";

const kLongestText = 200_000;  // characters of a response that are shown
const kShownHeaders = ["content-type", "etag", "location", "cache-control", "retry-after", "x-request-id"];
const kDefaults = { c: "default" };  // of parameters in the path

function field(parameter) {
  const { schema = {} } = parameter;
  const id = `try-${crypto.randomUUID()}`;
  const control = schema.enum ?
    make("select", { id }, make("option", { value: "", text: "default" }), ...schema.enum.map((one) => make("option", { text: one }))) :
    make("input", { id, type: "text", autocomplete: "off", spellcheck: "false", placeholder: schema.default ?? "" });
  if (parameter.in === "path") control.value = kDefaults[parameter.name] ?? "";
  control.required = Boolean(parameter.required);
  return { parameter, control, label: make("label", { for: id }, make("span", { text: parameter.name }), control) };
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
  let url = path;
  for (const { parameter, control } of fields) {
    const value = control.value.trim();
    if (parameter.in === "path") {
      if (!value) throw new Error(`${parameter.name} is required.`);
      url = url.replace(`{${parameter.name}}`, encodeURIComponent(value));
    } else if (value && parameter.in === "query") query.set(parameter.name, value);
    else if (value && parameter.in === "header") headers[parameter.name] = value;
  }
  if ([...query].length) url += `?${query}`;
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

async function bodyView(blob, type) {
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
          ...(blob.size ? await bodyView(blob, headers.get("content-type") ?? "") : [])];
}

export function tryForm(method, path, operation) {
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
  } }, make("h3", { text: "Try it" }), make("div", { class: "fields" }, ...fields.map(({ label }) => label), ...body.labels),
     make("div", { class: "row" }, send), status, curl, result);
}
