// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A form that sends one request as it is typed, and shows all of the answer.
import { getKey } from "./api.js";
import { fileSize, make, say } from "./dom.js";

const kLongestText = 200_000;  // characters of an answer that are shown
const kShownHeaders = ["content-type", "etag", "location", "cache-control", "retry-after", "x-request-id"];

const guess = { c: "default" };

function field(parameter) {
  const { schema = {} } = parameter;
  const choices = schema.enum;
  const id = `try-${crypto.randomUUID()}`;
  const control = choices ?
    make("select", { id }, make("option", { value: "", text: "as it is" }), ...choices.map((one) => make("option", { text: one }))) :
    make("input", { id, type: "text", autocomplete: "off", spellcheck: "false", placeholder: schema.default ?? "" });
  if (parameter.in === "path") control.value = guess[parameter.name] ?? "";
  control.required = Boolean(parameter.required);
  const label = make("label", { for: id }, make("span", { text: parameter.name }), control);
  return { parameter, control, label };
}

// The body: JSON as text, or a picture as a file.
function bodyFields(requestBody) {
  const types = Object.keys(requestBody?.content ?? {});
  const json = types.find((type) => type.endsWith("json"));
  const takesPicture = types.includes("image/*") || types.includes("multipart/form-data");
  const parts = { json, text: null, file: null, labels: [] };
  if (json) {
    parts.text = make("textarea", { rows: 4, spellcheck: "false", autocomplete: "off", placeholder: "{ }" });
    parts.labels.push(make("label", { class: "wide" }, make("span", { text: `Body, ${json}` }), parts.text));
  }
  if (takesPicture) {
    parts.file = make("input", { type: "file", accept: "image/*", multiple: !types.includes("image/*") });
    parts.labels.push(make("label", { class: "wide" }, make("span", { text: json ? "Or a picture" : "Picture" }), parts.file));
  }
  return parts;
}

// The request that the form describes: { url, options, curl }. Throws an Error in words.
function requestOf(method, path, fields, body) {
  const query = new URLSearchParams();
  const headers = {};
  let url = path;
  for (const { parameter, control } of fields) {
    const value = control.value.trim();
    if (parameter.in === "path") {
      if (!value) throw new Error(`${parameter.name} is needed.`);
      url = url.replace(`{${parameter.name}}`, encodeURIComponent(value));
    } else if (value && parameter.in === "query") query.set(parameter.name, value);
    else if (value && parameter.in === "header") headers[parameter.name] = value;
  }
  if ([...query].length) url += `?${query}`;
  const options = { method: method.toUpperCase(), headers };
  const quoted = (text) => `'${text.replaceAll("'", "'\\''")}'`;
  const curl = ["curl", ...(method === "get" ? [] : ["-X", options.method])];
  const files = [...(body.file?.files ?? [])];
  const text = body.text?.value.trim();
  if (files.length) {
    const form = new FormData();
    for (const file of files) {
      form.append("image", file);
      curl.push("-F", quoted(`image=@${file.name}`));
    }
    options.body = form;
  } else if (text) {
    try {
      JSON.parse(text);
    } catch (error) {
      throw new Error(`The body is no JSON: ${error.message}`);
    }
    options.body = text;
    headers["Content-Type"] = body.json;
    curl.push("-d", quoted(text));
  }
  for (const [name, value] of Object.entries(headers)) curl.push("-H", quoted(`${name}: ${value}`));
  if (getKey()) {
    headers.Authorization = `Bearer ${getKey()}`;
    curl.push("-H", '"Authorization: Bearer $KEY"');
  }
  curl.push(quoted(new URL(url, location.href).href));
  return { url, options, curl: curl.join(" ") };
}

async function answerView(answer, tookMs) {
  const head = make("p", {}, make("strong", { class: answer.ok ? "good" : "bad", text: `${answer.status} ${answer.statusText}`.trim() }),
                    ` in ${Math.round(tookMs)} ms`);
  const lines = kShownHeaders.filter((name) => answer.headers.has(name)).map((name) => `${name}: ${answer.headers.get(name)}`);
  const view = make("div", {}, head, make("pre", { class: "quiet", tabindex: "0", text: lines.join("\n") }));
  const type = answer.headers.get("content-type") ?? "";
  const blob = await answer.blob();
  if (!blob.size) return view;
  if (type.startsWith("image/")) {
    const image = make("img", { alt: "The answer", class: "answer-image" });
    image.src = URL.createObjectURL(blob);
    image.addEventListener("load", () => URL.revokeObjectURL(image.src), { once: true });
    view.append(image);
    return view;
  }
  if (!/json|text/.test(type)) {
    view.append(make("p", { text: `${fileSize(blob.size)} of ${type || "unknown kind"}` }));
    return view;
  }
  let text = await blob.text();
  if (/json$|json;/.test(type) && text.length < 10 * kLongestText) {
    try {
      text = JSON.stringify(JSON.parse(text), null, 2);
    } catch {
      // as it came, then: lines of JSON, for example
    }
  }
  const all = text.length <= kLongestText;
  view.append(make("pre", { class: "answer-text", tabindex: "0", text: all ? text : text.slice(0, kLongestText) }));
  if (!all) view.append(make("p", { class: "quiet", text: `The first ${kLongestText.toLocaleString("en")} characters of ${text.length.toLocaleString("en")}.` }));
  return view;
}

export function tryForm(method, path, operation) {
  const fields = (operation.parameters ?? []).map(field);
  const body = bodyFields(operation.requestBody);
  const status = make("p", { role: "status" });
  const curl = make("pre", { tabindex: "0" });
  const result = make("div", { class: "result" });
  const send = make("button", { type: "submit", class: "primary", text: `Send ${method.toUpperCase()}` });
  const form = make("form", { class: "try", "aria-label": `Try ${method.toUpperCase()} ${path}` },
                    make("h3", { text: "Try it" }), make("div", { class: "fields" }, ...fields.map(({ label }) => label), ...body.labels),
                    make("div", { class: "row" }, send), status, curl, result);
  curl.hidden = true;
  form.noValidate = true;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    result.replaceChildren();
    try {
      const request = requestOf(method, path, fields, body);
      curl.hidden = false;
      curl.textContent = request.curl;
      say(status, "Waiting for the answer…");
      send.disabled = true;
      const start = performance.now();
      const answer = await fetch(request.url, request.options);
      result.replaceChildren(await answerView(answer, performance.now() - start));
      say(status, "");
    } catch (error) {
      say(status, error instanceof TypeError ? "The server cannot be reached." : error.message, true);
    } finally {
      send.disabled = false;
    }
  });
  return form;
}
