// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The last pictures that were searched with, kept in this browser, so that a search survives Reload and
// Back. They never leave it but to be searched with.

const kDatabase = "pliant";
const kStore = "queries";
const kMost = 6;
const kLongestMs = 24 * 3600 * 1000;

const done = (request) => new Promise((good, bad) => {
  request.onsuccess = () => good(request.result);
  request.onerror = () => bad(request.error);
});

async function store(mode) {
  const opening = indexedDB.open(kDatabase, 1);
  opening.onupgradeneeded = () => opening.result.createObjectStore(kStore, { keyPath: "key" });
  return (await done(opening)).transaction(kStore, mode).objectStore(kStore);
}

// Its key; null where the browser keeps nothing, as in some private windows.
export async function keepQuery(file) {
  try {
    const queries = await store("readwrite");
    const now = Date.now();
    const key = `${now.toString(36)}-${Math.floor(Math.random() * 36 ** 4).toString(36)}`;
    await done(queries.put({ key, file, name: file.name, at: now }));
    const all = (await done(queries.getAll())).sort((a, b) => b.at - a.at);
    for (const [i, { key: old, at }] of all.entries()) {
      if (i >= kMost || now - at > kLongestMs) queries.delete(old);
    }
    return key;
  } catch {
    return null;
  }
}

// The file; null when it is no longer there.
export async function keptQuery(key) {
  try {
    return (await done((await store("readonly")).get(key)))?.file ?? null;
  } catch {
    return null;
  }
}

export async function forgetQueries() {
  await done((await store("readwrite")).clear()).catch(() => {});
}
