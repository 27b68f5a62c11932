// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses behind the #, so that every view and every search has a link: #/search?image=ID   #/add   #/objects
// #/object?name=NAME   #/images   #/image?id=ID   #/collection, and in=NAME for collections other than "default". Back
// leads to the same place of the page before.
import { collectionName, setCollection } from "./api.js";
import { byId } from "./dom.js";

const views = new Map();

// view: { title, show(parameters, { isNew, isReturn }), hide() }; its section has the id view-NAME. isNew: another view was
// shown before; isReturn: by Back or Forward. show may return a promise that ends when the contents are there.
export const addView = (name, view) => views.set(name, view);

// parameters.in: another collection than this one.
export function link(view, { in: collection = collectionName(), ...parameters } = {}) {
  const query = new URLSearchParams();
  if (collection !== "default") query.set("in", collection);
  for (const [name, value] of Object.entries(parameters)) if (value !== undefined && value !== null) query.set(name, value);
  const text = query.toString();
  return `#/${view}${text ? `?${text}` : ""}`;
}

export const go = (view, parameters) => { location.hash = link(view, parameters); };

// --- places in the history

// This page's entries of the browser's history, by a number in their state: how far down the page was, and the link that
// was followed.
const places = new Map();
let entry = null;
let entries = 0;
const nextEntry = () => { entry = `${Date.now()}-${++entries}`; };

function leavePlace() {
  if (entry !== null) places.set(entry, { down: scrollY, href: document.activeElement?.getAttribute?.("href") ?? null });
}

// Whether the entry was there before.
function enterPlace() {
  const known = history.state?.entry;
  if (known === entry && entry !== null) return false;
  leavePlace();
  if (known) {
    entry = known;
    return true;
  }
  const inside = entry !== null;
  nextEntry();
  history.replaceState({ entry, inside }, "");
  return false;
}

function returnToPlace(name) {
  const place = places.get(entry);
  if (!place) return;
  if (place.href) byId(`view-${name}`).querySelector(`a[href="${CSS.escape(place.href)}"]`)?.focus({ preventScroll: true });
  scrollTo(0, place.down);
}

// A new address for what is shown already.
export function pushAddress(hash) {
  leavePlace();
  nextEntry();
  history.pushState({ entry, inside: true }, "", hash);
}

// Another address for the same entry.
export const noteAddress = (hash) => history.replaceState(history.state, "", hash);

// The same, and shows it.
export function replaceAddress(hash) {
  noteAddress(hash);
  return showCurrent();
}

// A link back: to the page before, or for people who opened this page by its link, to its href.
export const makeBackLink = (anchor) => anchor.addEventListener("click", (event) => {
  if (!history.state?.inside) return;
  event.preventDefault();
  history.back();
});

// --- views

let shown = null;
let onCollection = () => {};
export const whenCollectionChanges = (call) => { onCollection = call; };
export const showing = () => shown;
export const setTitle = (text) => { document.title = `${text} – Pliant`; };

// The links in index.html: they stay in the collection.
const fixedLinks = [...document.querySelectorAll('a[href^="#/"]')].map((anchor) => [anchor, anchor.getAttribute("href").slice(2)]);

function markNavigation(name) {
  for (const [anchor, view] of fixedLinks) anchor.href = link(view);
  for (const anchor of document.querySelectorAll("nav [data-view]")) {
    const { view } = anchor.dataset;
    if (view === name || (view === "objects" && ["object", "images", "image"].includes(name))) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
}

export function showCurrent() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const name = views.has(path) ? path : "search";
  const parameters = new URLSearchParams(query);
  const isReturn = enterPlace();
  const wanted = parameters.get("in") ?? "default";
  if (wanted !== collectionName()) {
    setCollection(wanted);
    onCollection();
  }
  const isNew = name !== shown;
  const first = shown === null;
  if (isNew) {
    views.get(shown)?.hide?.();
    for (const section of document.querySelectorAll(".view")) section.hidden = section.id !== `view-${name}`;
    shown = name;
  }
  markNavigation(name);
  const view = views.get(name);
  setTitle(view.title);
  const mine = entry;
  const ready = Promise.resolve(view.show(parameters, { isNew, isReturn }));
  if (isNew && !first) {
    scrollTo(0, 0);
    byId(`view-${name}`).querySelector("h1").focus({ preventScroll: true });
  }
  if (isReturn) ready.then(() => { if (mine === entry) returnToPlace(name); });
  return ready;
}

export function startRouter() {
  history.scrollRestoration = "manual";
  addEventListener("popstate", showCurrent);  // hashchange comes too late: noteAddress() would overwrite the new address
  return showCurrent();
}
