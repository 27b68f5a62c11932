// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and pictures, to look through.
import * as api from "./api.js";
import { objectCard, pictureCard } from "./cards.js";
import { byId, make } from "./dom.js";
import { makeFinder, noneFound } from "./finder.js";
import { makeList } from "./list.js";
import { link, showCurrent } from "./router.js";
import { makeSelection } from "./select.js";

export const listQuery = (cursor, limit, more = {}) => {
  const query = new URLSearchParams({ limit, ...more });
  if (cursor) query.set("cursor", cursor);
  return query;
};

// Pictures that nobody has named belong to no object, so they are no entry of the server's list: one
// entry for all of them, if there are any.
async function pictureWithoutName() {
  const { images } = await api.ask(api.address("/images?object=&limit=1"));
  return images.map(({ id }) => ({ object: "", image_id: id }));
}

// Where one begins.
const nothingYet = (what) => make("span", { class: "nothing" }, `There are no ${what} yet.`,
  make("a", { class: "button primary", href: link("add"), text: "Add pictures", "data-needs": "write" }));

const objectFinder = makeFinder({
  view: "objects", bar: byId("objects-bar"), word: "object",
  sorts: [["object", "by name"], ["-created", "newest first"], ["-updated", "changed last"], ["-images", "most pictures first"]] });
const pictureFinder = makeFinder({
  view: "pictures", bar: byId("pictures-bar"), word: "picture",
  sorts: [["-created", "newest first"], ["created", "oldest first"], ["-updated", "changed last"], ["object", "by name"], ["source", "by file"]] });

const objects = makeList({
  place: "objects",
  async fetchPage({ q, sort }, cursor, limit) {
    const wantsUnnamed = !cursor && !q && sort === "object";
    const query = listQuery(cursor, limit, { sort, ...(q && { q }), ...(!cursor && { count: true }) });
    const [{ objects: some, next, total }, unnamed] = await Promise.all([
      api.ask(api.address(`/objects?${query}`)), wantsUnnamed ? pictureWithoutName() : []]);
    if (!cursor) objectFinder.say(total);
    return { items: [...unnamed, ...some], next };
  },
  card: objectCard,
  none: ({ q }) => (q ? noneFound(q) : nothingYet("objects")),
});

// onTotal(n) is told how many there are.
export async function picturesPage({ object, q, sort = "-created" }, cursor, limit, onTotal = () => {}) {
  const query = listQuery(cursor, limit, { sort, ...(q && { q }), ...(object !== undefined && { object }), ...(!cursor && { count: true }) });
  const { images, next, total } = await api.ask(api.address(`/images?${query}`));
  if (!cursor) onTotal(total);
  return { items: images, next };
}

const pictures = makeList({
  place: "pictures",
  fetchPage: (wanted, cursor, limit) => picturesPage(wanted, cursor, limit, pictureFinder.say),
  card: pictureCard,
  none: ({ object, q }) => (q ? noneFound(q) : object === undefined ? nothingYet("pictures") : "No picture without a name is left."),
});

const objectSelection = makeSelection({
  list: objects.list, bar: byId("objects-bar"), word: "object", refresh: showCurrent });
const pictureSelection = makeSelection({
  list: pictures.list, bar: byId("pictures-bar"), word: "picture", refresh: showCurrent });

function markTabs(view) {
  for (const tab of document.querySelectorAll(`#view-${view} [data-tab]`)) tab.href = link(tab.dataset.tab);
}

const plain = (parameters, ...names) => Object.fromEntries(
  names.filter((name) => parameters.has(name)).map((name) => [name, parameters.get(name)]));

export const objectsView = {
  title: "Objects",
  show(parameters, how) {
    markTabs("objects");
    return objects.show({ ...objectFinder.read(parameters), in: api.collectionName() }, how);
  },
  hide: objectSelection.end,
};

export const picturesView = {
  title: "Pictures",
  show(parameters, how) {
    markTabs("pictures");
    const wanted = plain(parameters, "object");
    byId("pictures-title").textContent =
      wanted.object === undefined ? "Pictures" :
      wanted.object ? `Pictures of ${wanted.object}` : "Pictures without a name";
    return pictures.show({ ...wanted, ...pictureFinder.read(parameters, wanted), in: api.collectionName() }, how);
  },
  hide: pictureSelection.end,
};
