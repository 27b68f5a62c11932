// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses behind the #, so that every view and every search by a stored picture has a link:
//   #/search?image=ID   #/add   #/objects?after=CURSOR   #/pictures?object=NAME   #/collection
// and in=NAME where the collection is not "default".
import { collectionName, setCollection } from "./api.js";
import { byId } from "./dom.js";

const views = new Map();

// view: { title, show(params, isNew), hide() }; its section has the id view-NAME.
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

function parse() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const name = views.has(path) ? path : "search";
  return { name, parameters: new URLSearchParams(query) };
}

let shown = null;

function markNavigation(name) {
  for (const anchor of document.querySelectorAll("nav [data-view]")) {
    anchor.href = link(anchor.dataset.view);
    const here = anchor.dataset.view === name ||
                 (anchor.dataset.view === "objects" && name === "pictures");
    if (here) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
}

let onCollection = () => {};
export const whenCollectionChanges = (call) => { onCollection = call; };

// A promise of the view's, where it has one: until its contents are there.
export function showCurrent() {
  const { name, parameters } = parse();
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
  document.title = `${view.title} – Pliant`;
  const ready = view.show(parameters, isNew);
  if (isNew && !first) {
    scrollTo(0, 0);
    byId(`view-${name}`).querySelector("h1").focus({ preventScroll: true });
  }
  return ready;
}

export function startRouter() {
  addEventListener("hashchange", showCurrent);
  showCurrent();
}
