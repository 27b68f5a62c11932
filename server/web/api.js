// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to the server. Every failure becomes a Problem whose message is a sentence for people.
import { wait } from "./dom.js";
import { problemWords } from "./words.js";

const kKeyName = "pliant-key";
const kAttempts = 5;
const kLongestWaitS = 30;

export class Problem extends Error {
  constructor(message, { status = 0, code = "", retryAfterS = 0, imageId = "" } = {}) {
    super(message);
    Object.assign(this, { status, code, retryAfterS, imageId });
  }
}

// The key stays in this tab until it is closed.
export const getKey = () => sessionStorage.getItem(kKeyName) ?? "";
export function setKey(key) {
  if (key) sessionStorage.setItem(kKeyName, key);
  else sessionStorage.removeItem(kKeyName);
}
const keyHeaders = () => (getKey() ? { Authorization: `Bearer ${getKey()}` } : {});

let current = "default";
export const collectionName = () => current;
export const setCollection = (name) => { current = name; };
export const address = (rest = "", collection = current) =>
  `/v1/collections/${encodeURIComponent(collection)}${rest}`;

function problemOf(status, body, retryAfter) {
  const retryAfterS = Math.max(0, Number(retryAfter) || 0);
  const isWrong = status === 401 && Boolean(getKey());
  if (status === 401) document.dispatchEvent(new CustomEvent("pliant-key-wanted"));
  return new Problem(problemWords(status, body, retryAfterS, isWrong),
                     { status, code: body?.code ?? "", retryAfterS, imageId: body?.image_id ?? "" });
}

const unreachable = () =>
  new Problem("The server cannot be reached. Is it running, and is this device online?");

async function answerOf(path, options = {}) {
  const headers = { ...keyHeaders(), ...options.headers };
  let answer;
  try {
    answer = await fetch(path, { ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw unreachable();
  }
  if (answer.ok) return answer;
  const body = await answer.json().catch(() => null);
  throw problemOf(answer.status, body, answer.headers.get("Retry-After"));
}

// Asks again a few times when the server says that it is busy. `onWait(seconds)` is told.
async function patiently(attempt, onWait = () => {}, signal = undefined) {
  for (let tries = 1; ; ++tries) {
    try {
      return await attempt();
    } catch (error) {
      const later = error.retryAfterS;
      if (!later || later > kLongestWaitS || tries === kAttempts) throw error;
      onWait(later);
      await wait(later * 1000);
      if (signal?.aborted) throw new DOMException("Stopped.", "AbortError");
    }
  }
}

export async function ask(path, options) {
  const answer = await patiently(() => answerOf(path, options));
  if (answer.status === 204) return null;
  return answer.json();
}

export const askJson = (path, method, body) =>
  ask(path, { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });

// A record with its ETag, for a change of what was read. A proxy that compresses makes the ETag a weak
// one, which no If-Match would match.
export async function record(path) {
  const answer = await patiently(() => answerOf(path));
  return { value: await answer.json(), etag: answer.headers.get("ETag")?.replace(/^W\//, "") };
}

// changes: a JSON merge patch. With an etag only what has it is changed.
export const patch = (path, changes, etag = null) => ask(path, {
  method: "PATCH", body: JSON.stringify(changes),
  headers: { "Content-Type": "application/merge-patch+json", ...(etag && { "If-Match": etag }) } });

export const plainText = async (path) => (await patiently(() => answerOf(path))).text();

// Bytes of a picture, for canvases.
export async function pictureBlob(path) {
  const answer = await patiently(() => answerOf(path));
  return answer.blob();
}

// What a picture elsewhere looks like, small, which the server fetches for that.
export async function previewBlob(url) {
  const answer = await patiently(() => answerOf("/v1/preview", {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ image_url: url }) }));
  return answer.blob();
}

// A long answer as it comes; onProgress gets the bytes so far.
export async function pieces(path, signal, onProgress) {
  const reader = (await patiently(() => answerOf(path, { signal }))).body.getReader();
  const parts = [];
  for (let bytes = 0;;) {
    const { done, value } = await reader.read().catch((error) => {
      throw error.name === "AbortError" ? error : unreachable();
    });
    if (done) return parts;
    parts.push(value);
    onProgress(bytes += value.length);
  }
}

// Shows a stored picture in an <img>. With a key it has to be fetched: an <img> sends none.
export function showPicture(image, path) {
  if (!getKey()) {
    image.src = path;
    return;
  }
  const load = async () => {
    const url = URL.createObjectURL(await pictureBlob(path));
    image.addEventListener("load", () => URL.revokeObjectURL(url), { once: true });
    image.src = url;
  };
  const watcher = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    watcher.disconnect();
    load().catch(() => image.dispatchEvent(new Event("error")));
  });
  watcher.observe(image);
}

export const imagePath = (id, what = "", collection = current) =>
  address(`/images/${encodeURIComponent(id)}${what}`, collection);
export const objectPath = (object, collection = current) =>
  address(`/objects/${encodeURIComponent(object)}`, collection);
export const collections = () => ask("/v1/collections");
export const collection = () => ask(address());
export const deletePath = (path, options) => ask(path, { method: "DELETE", ...options });

// Of the parameters of a search, which are text in a form, and have types in a JSON body.
const kNumbers = new Set(["limit", "offset", "min_score", "verify_depth", "expand", "instances"]);
const kFlags = new Set(["explain", "preview"]);

const typed = (settings) => Object.fromEntries(Object.entries(settings).map(([name, value]) => {
  if (kNumbers.has(name)) return [name, Number(value)];
  if (name === "region") return [name, String(value).split(",").map(Number)];
  return [name, kFlags.has(name) ? String(value) === "true" : value];
}));

// query: { file }, { id }, a stored picture, which is no answer itself, or { url }, which the server fetches;
// settings: the parameters of a search.
export function search(query, settings, signal) {
  if (query.id || query.url) {
    return ask(address("/search"), {
      method: "POST",
      signal,
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ ...(query.id ? { image_id: query.id } : { image_url: query.url }), ...typed(settings) }),
    });
  }
  const form = new FormData();
  for (const [name, value] of Object.entries(settings)) {
    form.append(name, typeof value === "object" ? JSON.stringify(value) : value);
  }
  form.append("image", query.file);
  return ask(address("/search"), { method: "POST", body: form, signal });
}

// Where an object is in a picture; asked once: the next frame of a camera is better than a late answer.
export async function locate(object, file) {
  const answer = await answerOf(`${objectPath(object)}/locate`, {
    method: "POST", headers: { "Content-Type": file.type }, body: file });
  return answer.json();
}

function sendOnce(path, form, onProgress, signal) {
  return new Promise((done, fail) => {
    const request = new XMLHttpRequest();
    const stop = () => request.abort();
    request.open("POST", path);
    request.responseType = "json";
    for (const [name, value] of Object.entries(keyHeaders())) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => onProgress(event.loaded / event.total);
    request.onload = () => {
      signal.removeEventListener("abort", stop);
      if (request.status < 300) done({ created: request.status === 201, image: request.response });
      else fail(problemOf(request.status, request.response,
                          request.getResponseHeader("Retry-After")));
    };
    request.onerror = () => fail(unreachable());
    request.onabort = () => fail(new DOMException("Stopped.", "AbortError"));
    signal.addEventListener("abort", stop, { once: true });
    if (signal.aborted) fail(new DOMException("Stopped.", "AbortError"));
    else request.send(form);
  });
}

async function sendAddress(path, picture, signal) {
  const answer = await answerOf(path, { method: "POST", signal, body: JSON.stringify(picture),
                                        headers: { "Content-Type": "application/json" } });
  return { created: answer.status === 201, image: await answer.json() };
}

// Uploads one picture into a collection, or has it fetched by its address (fileAt). onProgress gets 0..1 of the bytes sent, onWait the seconds of a pause that
// the server asked for.
export function addPicture({ file, object, metadata, collection }, { onProgress, onWait, signal }) {
  if (file.address) {
    const picture = { image_url: file.address, object, ...(metadata && { metadata }) };
    return patiently(() => sendAddress(address("/images", collection), picture, signal), onWait, signal);
  }
  const form = new FormData();
  form.append("object", object);
  if (metadata) form.append("metadata", JSON.stringify(metadata));
  form.append("image", file);
  return patiently(() => sendOnce(address("/images", collection), form, onProgress, signal), onWait, signal);
}
