// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to the server. Every failure becomes a Problem whose message is a sentence for people.
import { attempt, make, say, wait } from "./dom.js";
import { inNaturalOrder, shownName } from "./names.js";
import { t } from "./texts.js";
import { problemWords } from "./words.js";

const kKeyName = "pliant-key";
const kAttempts = 5;
const kLongestWaitS = 30;
const kAwayPollS = 2;
const kJson = { "Content-Type": "application/json" };

class Problem extends Error {
  constructor(message, { status = 0, code = "", retryAfterS = 0, imageId = "" } = {}) {
    super(message);
    Object.assign(this, { status, code, retryAfterS, imageId });
  }
}

// --- the key, kept until the tab is closed or on this device, and what it allows

export const isRemembered = () => Boolean(localStorage.getItem(kKeyName));
export const getKey = () => sessionStorage.getItem(kKeyName) ?? localStorage.getItem(kKeyName) ?? "";
export function setKey(key, remember) {
  for (const store of [sessionStorage, localStorage]) store.removeItem(kKeyName);
  if (key) (remember ? localStorage : sessionStorage).setItem(kKeyName, key);
}
export const keyHeaders = () => (getKey() ? { Authorization: `Bearer ${getKey()}` } : {});

const kScopes = ["admin", "write", "read"];  // each includes the scopes after it
let serverHas = {};
let tell;
const told = new Promise((done) => { tell = done; });

// Throws the Problem of a key that does not work. The style sheet hides elements with data-needs="write" or "admin"
// from others, and shows those with data-only="read" to readers.
export async function refreshScope() {
  try {
    const { scopes, ...rest } = await ask("v1/me");
    serverHas = rest;
    document.documentElement.dataset.scope = kScopes.find((scope) => scopes.includes(scope)) ?? "read";
  } finally {
    tell();
  }
}
// Waits until the scope is known.
export const mayWrite = () => told.then(() => document.documentElement.dataset.scope !== "read");
export const isAdmin = () => document.documentElement.dataset.scope === "admin";
// Whether the server fetches images by their addresses; waits until that is known.
export const mayFetch = () => told.then(() => serverHas.image_url);
export const hasBackups = () => told.then(() => serverHas.backups);

// --- addresses, all relative: a proxy can serve the page below any path

let current = "default";
export const collectionName = () => current;
export const setCollection = (name) => { current = name; };
export const address = (rest = "", collection = current) => `v1/collections/${encodeURIComponent(collection)}${rest}`;
export const imagePath = (id, what = "", collection = current) => address(`/images/${encodeURIComponent(id)}${what}`, collection);
export const objectPath = (object, collection = current) => address(`/objects/${encodeURIComponent(object)}`, collection);

// --- requests

function problemOf(status, body, retryAfter) {
  const retryAfterS = Math.max(0, Number(retryAfter) || 0);
  if (status === 401) document.dispatchEvent(new CustomEvent("pliant-key-wanted"));
  return new Problem(problemWords(status, body, retryAfterS, status === 401 && Boolean(getKey())),
                     { status, code: body?.code ?? "", retryAfterS, imageId: body?.image_id ?? "" });
}

const unreachable = () => new Problem(t`The server cannot be reached. Check that it is running and that this device is online.`);
const stopped = () => new DOMException("Stopped.", "AbortError");

async function answerOf(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, { ...options, headers: { ...keyHeaders(), ...options.headers } });
  } catch (error) {
    throw error.name === "AbortError" ? error : unreachable();
  }
  if (answer.ok) return answer;
  throw problemOf(answer.status, await answer.json().catch(() => null), answer.headers.get("Retry-After"));
}

// The server, or a proxy before it, may do the same request later.
const isAway = ({ status }) => [0, 408, 429, 502, 503, 504].includes(status);
const answers = () => answerOf("v1/me").then(() => true, (error) => !isAway(error));

// Asks again a few times while the server is busy. With a signal, also waits until a server that is away is back, or until
// the signal is aborted; onWait(error) is told.
async function patiently(attempt, onWait = () => {}, signal = undefined) {
  for (let tries = 1; ; ++tries) {
    try {
      return await attempt();
    } catch (error) {
      const later = error.retryAfterS || (signal && isAway(error) ? kAwayPollS : 0);
      if (!later || (!signal && later > kLongestWaitS) || tries === kAttempts) throw error;
      onWait(error);
      do {
        await wait(later * 1000, signal);
        if (signal?.aborted) throw stopped();
      } while (signal && !await answers());
    }
  }
}

const answerTo = (path, options) => patiently(() => answerOf(path, options));

export async function ask(path, options) {
  const answer = await answerTo(path, options);
  return answer.status === 204 ? null : answer.json();
}
export const askJson = (path, method, body) => ask(path, { method, headers: kJson, body: JSON.stringify(body) });
export const deletePath = (path) => ask(path, { method: "DELETE" });
export const blobOf = async (path, options) => (await answerTo(path, options)).blob();
// A small preview of an image elsewhere, which the server fetches.
export const previewBlob = (url) => blobOf("v1/preview", { method: "POST", headers: kJson, body: JSON.stringify({ image_url: url }) });
export const qrBlob = (text) => blobOf("v1/qr", { method: "POST", headers: kJson, body: JSON.stringify({ text }) });
export async function collections() {
  const { collections: all } = await ask("v1/collections");
  return { collections: all.sort((a, b) => inNaturalOrder(shownName(a), shownName(b))) };
}

// A record with its ETag. A proxy that compresses makes the ETag weak, and no If-Match would match it.
export async function record(path) {
  const answer = await answerTo(path);
  return { value: await answer.json(), etag: answer.headers.get("ETag")?.replace(/^W\//, "") };
}

// changes: a JSON merge patch. With an etag, only a record that still has it is changed.
export const patch = (path, changes, etag = null) => ask(path, {
  method: "PATCH", body: JSON.stringify(changes), headers: { "Content-Type": "application/merge-patch+json", ...(etag && { "If-Match": etag }) } });

// A link that saves a file. A link sends no key, so with a key the page fetches the file; `status` says how that goes.
export const downloadLink = (path, name, status, properties) => make("a", { href: path, download: name, text: t`Download`, onclick(event) {
  if (!getKey()) return;
  event.preventDefault();
  say(status, t`Downloading…`);
  attempt(status, async () => {
    const href = URL.createObjectURL(await blobOf(path));
    make("a", { href, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(href), 60_000);
    say(status, t`Downloaded.`);
  });
}, ...properties });

// Shows a stored image in an <img>. With a key the page fetches it, because an <img> sends no key.
export function showImage(image, path) {
  if (getKey()) showBlob(image, () => blobOf(path));
  else image.src = path;
}

// Shows the Blob that load() gives once the <img> is in view. If there is none, its "error" event has the reason.
export function showBlob(image, load) {
  const watcher = new IntersectionObserver(async (entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    watcher.disconnect();
    try {
      const url = URL.createObjectURL(await load());
      image.addEventListener("load", () => URL.revokeObjectURL(url), { once: true });
      image.src = url;
    } catch (error) {
      image.dispatchEvent(new ErrorEvent("error", { error }));
    }
  });
  watcher.observe(image);
}

// Fields of a request as a multipart form.
function formOf(fields) {
  const form = new FormData();
  for (const [name, value] of Object.entries(fields)) {
    form.append(name, Array.isArray(value) ? value.join() : value instanceof File || typeof value !== "object" ? value : JSON.stringify(value));
  }
  return form;
}

// query: { file }, { id } of a stored image, or { url } that the server fetches. settings: the parameters of a search.
export function search(query, settings, signal) {
  if (query.file) return ask(address("/search"), { method: "POST", signal, body: formOf({ ...settings, image: query.file }) });
  const body = JSON.stringify({ ...(query.id ? { image_id: query.id } : { image_url: query.url }), ...settings });
  return ask(address("/search"), { method: "POST", signal, headers: kJson, body });
}

// Where an object is in a camera frame. Asked once: the next frame is better than a late answer.
export const locate = async (object, file) => (await answerOf(`${objectPath(object)}/locate`, {
  method: "POST", headers: { "Content-Type": file.type }, body: file })).json();

// fetch() tells nothing of the progress of an upload. body: a form, or an object to send as JSON.
const upload = (path, body, onProgress, signal) => new Promise((done, fail) => {
  const request = new XMLHttpRequest();
  const stop = () => request.abort();
  request.open("POST", path);
  request.responseType = "json";
  const isForm = body instanceof FormData;
  for (const [name, value] of Object.entries({ ...keyHeaders(), ...(!isForm && kJson) })) request.setRequestHeader(name, value);
  request.upload.onprogress = (event) => onProgress(event.loaded / event.total);
  request.onload = () => {
    signal.removeEventListener("abort", stop);
    if (request.status < 300) done({ created: request.status === 201, image: request.response });
    else fail(problemOf(request.status, request.response, request.getResponseHeader("Retry-After")));
  };
  request.onerror = () => fail(unreachable());
  request.onabort = () => fail(stopped());
  signal.addEventListener("abort", stop, { once: true });
  if (signal.aborted) fail(stopped());
  else request.send(isForm ? body : JSON.stringify(body));
});

// Uploads an image, or lets the server fetch it from file.address. onProgress gets 0..1 of the bytes sent, onWait the
// Problem for which the upload pauses.
export function addImage({ file, object, metadata, collection }, { onProgress, onWait, signal }) {
  const fields = { object, ...(metadata && { metadata }) };
  const body = file.address ? { ...fields, image_url: file.address } : formOf({ ...fields, image: file });
  return patiently(() => upload(address("/images", collection), body, onProgress, signal), onWait, signal);
}
