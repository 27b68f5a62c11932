// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and images, in lists without an end, and the page of an object.
import * as api from "./api.js";
import { deleteHereButton, imageCard, objectCard } from "./cards.js";
import { byId, count, make, say } from "./dom.js";
import { renameButton } from "./edit.js";
import { makeFinder, makeList } from "./list.js";
import { link, makeBackLink, setTitle, showCurrent, showing } from "./router.js";
import { makeSelection } from "./select.js";
import { isLeaving } from "./undo.js";

const kObjectSorts = [["object", "by name"], ["-created", "newest first"], ["-updated", "last changed"], ["-images", "most images first"]];
const kImageSorts = [["-created", "newest first"], ["created", "oldest first"], ["-updated", "last changed"], ["object", "by name"], ["source", "by file"]];

// A page of the server's list; say(total) is told once.
async function page(kind, { q, sort, object }, cursor, limit, say) {
  const query = new URLSearchParams({ limit, sort, ...(q && { q }), ...(object !== undefined && { object }), ...(cursor ? { cursor } : { count: true }) });
  const answer = await api.ask(api.address(`/${kind}?${query}`));
  if (!cursor) say(answer.total);
  return { items: answer[kind], next: answer.next };
}
const imagesPage = ({ object, q, sort = "-created" }, cursor, limit, say = () => {}) => page("images", { object, q, sort }, cursor, limit, say);

// Images without a name belong to no object, so the server's list has no entry for them. The page shows one for all.
async function objectsPage(wanted, cursor, limit, say) {
  const wantsUnnamed = !cursor && !wanted.q && wanted.sort === "object";
  const [{ items, next }, { images }] = await Promise.all([
    page("objects", wanted, cursor, limit, say), wantsUnnamed ? api.ask(api.address("/images?object=&limit=1")) : { images: [] }]);
  return { items: [...images.map(({ id }) => ({ object: "", image_id: id })), ...items], next };
}

const nothingYet = (what) => make("span", { class: "nothing" }, `There are no ${what} yet.`,
  make("a", { class: "button primary", href: link("add"), text: "Add images", "data-needs": "write" }));

// keep: parameters of the address beside those of the finder; title(parameters): the heading.
function makeView({ word, sorts, fetchPage, card, keep = [], title }) {
  const place = `${word}s`;
  const bar = byId(`${place}-bar`);
  const finder = makeFinder({ view: place, bar, word, sorts });
  const items = makeList({
    place, card, fetchPage: (wanted, cursor, limit) => fetchPage(wanted, cursor, limit, finder.say),
    none: ({ object, q }) => (q ? `No name or file contains "${q}".` : object === undefined ? nothingYet(place) : "There are no images without a name.") });
  const selection = makeSelection({ list: items.list, bar, word, refresh: showCurrent });
  return {
    title: title({}),
    show(parameters, how) {
      for (const tab of document.querySelectorAll(`#view-${place} [data-tab]`)) tab.href = link(tab.dataset.tab);
      const kept = Object.fromEntries(keep.filter((name) => parameters.has(name)).map((name) => [name, parameters.get(name)]));
      byId(`${place}-title`).textContent = title(kept);
      return items.show({ ...kept, ...finder.read(parameters, kept), in: api.collectionName() }, how);
    },
    hide: selection.end,
  };
}

export const objectsView = makeView({ word: "object", sorts: kObjectSorts, fetchPage: objectsPage, card: objectCard, title: () => "Objects" });
export const imagesView = makeView({
  word: "image", sorts: kImageSorts, fetchPage: imagesPage, card: imageCard, keep: ["object"],
  title: ({ object }) => (object === undefined ? "Images" : object ? `Images of ${object}` : "Images without a name") });

// --- the page of an object

const images = makeList({
  place: "object", card: imageCard, none: () => "This object has no images.",
  fetchPage: (wanted, cursor, limit) => imagesPage(wanted, cursor, limit) });
const selection = makeSelection({ list: images.list, bar: byId("object-bar"), word: "image", refresh: showCurrent });
makeBackLink(byId("object-back"));

let latest = 0;

function showActions({ object, image_id: cover, images: number }) {
  const card = byId("object-edit");
  byId("object-actions").replaceChildren(
    make("a", { class: "button primary", href: link("search", { image: cover }), text: "Find similar" }),
    make("a", { class: "button", href: link("add", { object }), text: "Add images", "data-needs": "write", "aria-label": `Add images of ${object}` }),
    renameButton({ card, object, large: true, onRenamed: (name) => {
      card.replaceChildren();
      location.replace(link("object", { name }));
    } }),
    deleteHereButton({ path: api.objectPath(object), label: `Delete ${object} with its images`, text: `Deleted: ${object}, ${count(number, "image")}.`,
                       here: ["object", { name: object }], next: ["objects"] }));
}

export const objectView = {
  title: "Object",
  async show(parameters, how) {
    const number = ++latest;
    const name = parameters.get("name") ?? "";
    byId("object-back").href = link("objects");
    byId("object-title").textContent = name;
    for (const id of ["object-edit", "object-actions", "object-count"]) byId(id).replaceChildren();  // of another object
    byId("object-edit").classList.remove("editing");
    byId("object-bar").hidden = false;
    setTitle(name);
    const listed = images.show({ object: name, in: api.collectionName() }, how);
    try {
      const record = await api.ask(api.objectPath(name));
      if (number !== latest || showing() !== "object") return;
      byId("object-count").textContent = isLeaving(api.objectPath(name)) ? "This object is being deleted." : count(record.images, "image");
      showActions(record);
    } catch (error) {
      if (number !== latest) return;
      await listed;
      byId("object-bar").hidden = error.status === 404;
      say(byId("object-status"), error.status === 404 ? `There is no object named ${name}.` : error.message, true);
    }
    await listed;
  },
  hide: selection.end,
};
