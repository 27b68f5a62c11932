// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses behind the #, so that every view and every search by a stored picture has a link:
//   #/search?image=ID   #/add   #/objects   #/object?name=NAME   #/pictures   #/picture?id=ID   #/collection
// and in=NAME where the collection is not "default". Back leads to where one was, as far down as one was.
import { collectionName, setCollection } from "./api.js";
import { byId } from "./dom.js";

const views = new Map();

// view: { title, show(params, { isNew, isReturn }), hide() }; its section has the id view-NAME. isNew:
// another view was shown before; isReturn: by Back or Forward. show may give a promise: until its contents are there.
export const addView = (name, view) => views.set(name, view);

export function link(view, parameters = {}) {
  const query = new URLSearchParams();
  if (collectionName() !== "default") query.set("in", collectionName());
  for (const [name, value] of Object.entries(parameters)) {
    if (value !== undefined && value !== null) query.set(name, value);
  }
  const text = query.toString();
  return `#/${view}${text ? `?${text}` : ""}`;
}

export const go = (view, parameters) => { location.hash = link(view, parameters); };

// --- where one was

// Entries of the browser's history that this page has made, by a number in their state; of each how far
// down one was, and which link one followed.
const places = new Map();
let entry = null;
let entries = 0;

function leavePlace() {
  if (entry === null) return;
  places.set(entry, { down: scrollY, href: document.activeElement?.getAttribute?.("href") ?? null });
}

// Whether it is an entry that was there before.
function enterPlace() {
  const known = history.state?.entry;
  if (known === entry && entry !== null) return false;
  leavePlace();
  if (known) {
    entry = known;
    return true;
  }
  const before = entry;
  entry = `${Date.now()}-${++entries}`;
  history.replaceState({ entry, inside: before !== null }, "");
  return false;
}

function returnToPlace(name) {
  const place = places.get(entry);
  if (!place) return;
  const followed = place.href && byId(`view-${name}`).querySelector(`a[href="${CSS.escape(place.href)}"]`);
  followed?.focus({ preventScroll: true });
  scrollTo(0, place.down);
}

// A new address for what is shown already.
export function pushAddress(hash) {
  leavePlace();
  entry = `${Date.now()}-${++entries}`;
  history.pushState({ entry, inside: true }, "", hash);
}

// Another address for the same place in the history, of what is shown already.
export const noteAddress = (hash) => history.replaceState(history.state, "", hash);

// The same, and what it says.
export function replaceAddress(hash) {
  history.replaceState(history.state, "", hash);
  return showCurrent();
}

// A link back: to where one came from, else to what its href says.
export function makeBackLink(anchor) {
  anchor.addEventListener("click", (event) => {
    if (!history.state?.inside) return;
    event.preventDefault();
    history.back();
  });
}

function parse() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const name = views.has(path) ? path : "search";
  return { name, parameters: new URLSearchParams(query) };
}

let shown = null;

function markNavigation(name) {
  byId("search-live").href = link("camera");
  for (const anchor of document.querySelectorAll("nav [data-view]")) {
    anchor.href = link(anchor.dataset.view);
    const here = anchor.dataset.view === name ||
                 (anchor.dataset.view === "objects" && ["object", "pictures", "picture"].includes(name));
    if (here) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
}

let onCollection = () => {};
export const whenCollectionChanges = (call) => { onCollection = call; };

export const showing = () => shown;
export const setTitle = (text) => { document.title = `${text} – Pliant`; };

// A promise of the view's, where it has one: until its contents are there.
export function showCurrent() {
  const { name, parameters } = parse();
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
    for (const section of document.querySelectorAll(".view")) {
      section.hidden = section.id !== `view-${name}`;
    }
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
  // Sent while the address changes, where hashchange comes later: what is given and noted in between would be lost.
  addEventListener("popstate", showCurrent);
  return showCurrent();
}
