// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The last photos of searches, kept in this browser so that a search survives Reload and Back. With a key, only the tab
// that searched can read them.
import { getKey } from "./api.js";

const kDatabase = "pliant";
const kStore = "queries";
const kMost = 6;
const kLongestMs = 24 * 3600 * 1000;
const kTabName = "pliant-tab";

const done = (request) => new Promise((good, bad) => {
  request.onsuccess = () => good(request.result);
  request.onerror = () => bad(request.error);
});

async function store(mode) {
  const opening = indexedDB.open(kDatabase, 1);
  opening.onupgradeneeded = () => opening.result.createObjectStore(kStore, { keyPath: "key" });
  return (await done(opening)).transaction(kStore, mode).objectStore(kStore);
}

const isOld = ({ at }) => Date.now() - at > kLongestMs;

const thisTab = () => sessionStorage.getItem(kTabName);
function nameTab() {
  if (!thisTab()) sessionStorage.setItem(kTabName, crypto.getRandomValues(new Uint32Array(4)).join("-"));
  return thisTab();
}

// Deletes what is too old or too much.
async function purge(queries) {
  const all = (await done(queries.getAll())).sort((a, b) => b.at - a.at);
  for (const [i, entry] of all.entries()) if (i >= kMost || isOld(entry)) queries.delete(entry.key);
}
export const purgeQueries = async () => purge(await store("readwrite"));

// The photo's key; null if the browser keeps nothing, as in some private windows.
export const keepQuery = (file) => store("readwrite").then(async (queries) => {
  const now = Date.now();
  const key = `${now.toString(36)}-${Math.floor(Math.random() * 36 ** 4).toString(36)}`;
  await done(queries.put({ key, file, name: file.name, at: now, tab: getKey() ? nameTab() : null }));
  await purge(queries);
  return key;
}).catch(() => null);

// The file; null if it is deleted, too old or another tab's.
export const keptQuery = (key) => store("readonly").then(async (queries) => {
  const entry = await done(queries.get(key));
  return entry && !isOld(entry) && (!entry.tab || entry.tab === thisTab()) ? entry.file : null;
}).catch(() => null);

export async function forgetQueries() {
  sessionStorage.removeItem(kTabName);
  await done((await store("readwrite")).clear()).catch(() => {});
}
