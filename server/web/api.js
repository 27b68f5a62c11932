// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Requests to the server; every failure becomes an Error with a sentence for people.

const base = "/v1/collections/default";

async function ask(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Error("The server cannot be reached.");
  }
  if (answer.status === 204) return null;
  const body = await answer.json().catch(() => null);
  if (answer.ok) return body;
  const error = new Error(body?.detail ?? `The server answered ${answer.status}.`);
  error.retryAfterS = Number(answer.headers.get("Retry-After")) || 0;
  throw error;
}

// Asks again a few times when the server is busy.
async function askPatiently(path, options) {
  for (let attempt = 0; ; ++attempt) {
    try {
      return await ask(path, options);
    } catch (error) {
      if (!error.retryAfterS || attempt === 5) throw error;
      await new Promise((wake) => setTimeout(wake, error.retryAfterS * 1000));
    }
  }
}

export const collection = () => ask(base);

export function addPicture(file, object) {
  const form = new FormData();
  form.append("image", file);
  form.append("object", object);
  return askPatiently(`${base}/images`, { method: "POST", body: form });
}

export function search(file, settings) {
  const form = new FormData();
  form.append("image", file);
  for (const [name, value] of Object.entries(settings)) form.append(name, value);
  return askPatiently(`${base}/search`, { method: "POST", body: form });
}

export function listPictures(cursor) {
  const query = new URLSearchParams({ limit: "24" });
  if (cursor) query.set("cursor", cursor);
  return ask(`${base}/images?${query}`);
}

export const deletePicture = (id) =>
  ask(`${base}/images/${encodeURIComponent(id)}`, { method: "DELETE" });

export const thumbnail = (id) => `${base}/images/${encodeURIComponent(id)}/thumbnail`;
