// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Small helpers for the document: elements, messages, questions, and numbers in words.
import { language, plural, t } from "./texts.js";

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

export const makeButton = (text, onclick, more = {}) => make("button", { type: "button", text, onclick, ...more });
export const smallButton = (text, onclick, more = {}) => makeButton(text, onclick, { class: "small", ...more });

export const onSubmit = (form, act) => form.addEventListener("submit", (event) => {
  event.preventDefault();
  act();
});

// A name and a value in a <dl>.
export const fact = (name, ...value) => make("div", {}, make("dt", { text: name }), make("dd", {}, ...value));

// Writes into a live region, which is read aloud once; an error looks like one.
export function say(place, text, isError = false) {
  if (place.textContent !== text) place.textContent = text;
  place.classList.toggle("error", isError);
}

// Says what went wrong. If the same may work later (no answer, or a busy server), a button calls again().
export function sayError(place, { message, status }, again) {
  if (!again || ![0, 408, 429, 500, 502, 503, 504].includes(status)) {
    say(place, message, true);
  } else if (place.dataset.problem !== message || !place.querySelector("button")) {  // else the button keeps the focus
    place.dataset.problem = message;
    say(place, message, true);
    place.append(" ", smallButton(t`Try again`, () => {
      (place.closest(".view") ?? document).querySelector("h1").focus();
      again();
    }));
  }
}

// Runs the action, and says what went wrong. Returns whether nothing did.
export const attempt = (place, action, again) => Promise.resolve().then(action).then(() => true, (error) => {
  sayError(place, error, again);
  return false;
});

// The result of an action, or another value if it throws.
export function resultOr(other, action) {
  try {
    return action();
  } catch {
    return other;
  }
}

// A small button for what cannot be undone: a question replaces it, and act() runs after "yes".
export function askingButton(text, label, { question, yes, act }) {
  const button = smallButton(text, () => {
    button.replaceWith(group);
    group.querySelector("button").focus();
  }, { class: "small", "aria-label": label });
  const keep = () => { group.replaceWith(button); button.focus(); };
  const group = make("span", { class: "row", role: "group", "aria-label": `${label}?` }, make("span", { text: question }), smallButton(t`Keep`, keep),
                     smallButton(yes, () => { keep(); act(); }, { class: "small danger" }));
  return button;
}

// show(items) for the list with this id. It draws only changes, so that buttons keep the focus and questions stay open.
export function makeLiveList(id, itemOf, none) {
  let shown = "";
  return (items) => {
    if (JSON.stringify(items) === shown) return;
    shown = JSON.stringify(items);
    byId(id).replaceChildren(...items.map(itemOf));
    if (!items.length) byId(id).append(make("li", { class: "quiet", text: none }));
  };
}

// Whether the browser allowed it; without https it does not.
export const copyText = (text) => Promise.resolve(navigator.clipboard?.writeText(text) ?? Promise.reject()).then(() => true, () => false);

export const figure = (n) => n.toLocaleString(language, { maximumFractionDigits: 1 });
// "1 image", "2 images"
export const count = (n, word, words = `${word}s`) => plural(n, figure(n), word, words);

export function fileSize(bytes) {
  if (bytes < 1000) return count(bytes, "byte");
  const [value, unit] = bytes < 1e6 ? [bytes / 1e3, "kB"] : bytes < 1e9 ? [bytes / 1e6, "MB"] : [bytes / 1e9, "GB"];
  return `${figure(value < 10 ? value : Math.round(value))} ${unit}`;
}

export const shortTime = (iso) => new Date(iso).toLocaleString(language, { dateStyle: "medium", timeStyle: "short" });
// Ends early when the signal is aborted.
export const wait = (ms, signal) => new Promise((wake) => {
  setTimeout(wake, ms);
  signal?.addEventListener("abort", wake, { once: true });
});

// Calls action(item) for each item, a few at a time. Returns the failures: [{ item, error }].
export async function eachOf(items, action, atOnce = 4) {
  const queue = [...items];
  const failed = [];
  const work = async () => {
    for (let item; queue.length && (item = queue.shift());) await action(item).catch((error) => failed.push({ item, error }));
  };
  await Promise.all(Array.from({ length: atOnce }, work));
  return failed;
}

// Cuts the middle, so that the file type stays visible.
export const shorten = (name, most = 40) => (name.length <= most ? name : `${name.slice(0, most - 14)}…${name.slice(-13)}`);
