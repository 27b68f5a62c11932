// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Small helpers for the document: making elements, saying things, numbers in words.

export const byId = (id) => document.getElementById(id);

// make("p", { class: "soft", text: "…", onclick: f }, child, …); text never becomes markup.
export function make(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "text") made.textContent = value;
    else if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

// Writes into a live region; an error looks like one.
export function say(place, text, isError = false) {
  place.textContent = text;
  place.classList.toggle("error", isError);
}

export const count = (n, word, words = `${word}s`) =>
  `${n.toLocaleString("en")} ${n === 1 ? word : words}`;

export function fileSize(bytes) {
  if (bytes < 1000) return count(bytes, "byte");
  const [value, unit] = bytes < 1e6 ? [bytes / 1e3, "kB"] : bytes < 1e9 ? [bytes / 1e6, "MB"] :
                                                                           [bytes / 1e9, "GB"];
  return `${value.toLocaleString("en", { maximumFractionDigits: value < 10 ? 1 : 0 })} ${unit}`;
}

export const shortTime = (iso) =>
  new Date(iso).toLocaleString("en", { dateStyle: "medium", timeStyle: "short" });

export const wait = (ms) => new Promise((wake) => setTimeout(wake, ms));

// Calls action(item) for each, a few at a time. Those that failed: [{ item, error }].
export async function eachOf(items, action, atOnce = 4) {
  const queue = [...items];
  const failed = [];
  const work = async () => {
    for (let item; queue.length && (item = queue.shift());) await action(item).catch((error) => failed.push({ item, error }));
  };
  await Promise.all(Array.from({ length: atOnce }, work));
  return failed;
}

// The longest part of a name that fits; the middle goes first, so that the type stays visible.
export const shorten = (name, most = 40) =>
  name.length <= most ? name : `${name.slice(0, most - 14)}…${name.slice(-13)}`;
