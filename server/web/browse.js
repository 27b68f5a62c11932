// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and images in lists without an end, the form above each list, and the page of an object.
import * as api from "./api.js";
import { deleteHereButton, imageCard, objectCard } from "./cards.js";
import { byId, count, make, makeButton, onSubmit, say, sayError } from "./dom.js";
import { renameButton } from "./edit.js";
import { link, makeBackLink, replaceAddress, setTitle, showCurrent, showing } from "./router.js";
import { makeSelection } from "./select.js";
import { t } from "./texts.js";
import { isLeaving } from "./undo.js";

const kPage = 24;
const kMost = 500;      // items in one answer of the server
const kNear = "600px";  // distance of the list's end from the window's edge
const kPauseMs = 250;   // after the last letter

// Makes a toolbar and a list at the end of the view. fetchPage(parameters, cursor, limit) gives { items, next }; card(item)
// an element, or null for an item that is being deleted; none(parameters) gives words or an element for an empty list.
function makeList({ place, label, fetchPage, onTotal = () => {}, card, none }) {
  const bar = make("div", { id: `${place}-bar`, class: "toolbar" });
  const status = make("p", { id: `${place}-status`, class: "status", role: "status" });
  const list = make("ul", { id: `${place}-list`, class: "cards", "aria-label": label });
  const more = makeButton(t`Show more`, extend, { id: `${place}-more`, hidden: true });
  byId(`view-${place}`).append(bar, status, list, make("p", { class: "more" }, more));
  let parameters = {};
  let next = null;    // cursor of the server
  let fetched = 0;    // items so far
  let latest = 0;     // drops an answer that comes too late

  async function fetch(cursor, limit) {
    const number = ++latest;
    observer.unobserve(more);  // a failed page is fetched again on request only
    list.setAttribute("aria-busy", "true");
    more.hidden = true;
    try {
      const page = await fetchPage(parameters, cursor, limit);
      if (number !== latest) return null;
      if (!cursor) onTotal(page.total);
      next = page.next;
      fetched = (cursor ? fetched : 0) + page.items.length;
      return page.items.map((item) => card(item)).filter(Boolean);
    } catch (error) {
      if (number !== latest) return null;
      if (!cursor) list.replaceChildren();
      sayError(status, error, cursor ? null : showCurrent);  // "Show more" asks for a page again
      next = cursor || null;
      return null;
    } finally {
      if (number === latest) {
        list.removeAttribute("aria-busy");
        more.hidden = !next;
      }
    }
  }

  async function extend() {
    if (more.hidden || list.closest(".view").hidden) return;
    const hadFocus = document.activeElement === more;
    const cards = await fetch(next, kPage);
    if (!cards) return;
    list.append(...cards);
    say(status, "");
    if (hadFocus) cards[0]?.querySelector("a, button, input").focus();
    watchEnd();
  }

  // An observer reports changes only, so it starts again after every page.
  const observer = new IntersectionObserver((seen) => { if (seen.some((one) => one.isIntersecting)) extend(); }, { rootMargin: kNear });
  const watchEnd = () => { if (!more.hidden) observer.observe(more); };

  return {
    bar, list, status,
    // On return, shows as many items as before.
    async show(wanted, { isReturn = false } = {}) {
      const same = JSON.stringify(wanted) === JSON.stringify(parameters);
      parameters = wanted;
      const cards = await fetch("", same && isReturn ? Math.min(kMost, Math.max(kPage, fetched)) : kPage);
      if (!cards) return;
      list.replaceChildren(...cards);
      say(status, "");
      if (!cards.length && !next) status.append(none(parameters));
      watchEnd();
    },
  };
}

// --- above a list: words to find, the order, and the count. The address has both.

// sorts: [[value of the server, words], ...]; the first is the default. word: what the list has.
function makeFinder({ view, bar, sorts, word }) {
  const label = word === "image" ? t`Find images` : t`Find objects`;
  const find = make("input", { type: "search", autocomplete: "off", spellcheck: "false", placeholder: t`name or file`, "aria-label": label });
  const order = word === "image" ? t`Order of the images` : t`Order of the objects`;
  const sort = make("select", { "aria-label": order }, ...sorts.map(([value, text]) => make("option", { value, text })));
  const total = make("span", { class: "quiet", role: "status" });
  const form = make("form", { class: "find", role: "search", "aria-label": label }, find, sort, total);
  onSubmit(form, apply);
  bar.prepend(form);
  let rest = {};  // other parameters of the address
  let timer = 0;

  function apply() {
    clearTimeout(timer);
    replaceAddress(link(view, { ...rest, q: find.value.trim() || undefined, sort: sort.value === sorts[0][0] ? undefined : sort.value }));
  }
  find.addEventListener("input", () => {
    clearTimeout(timer);
    timer = setTimeout(apply, kPauseMs);
  });
  sort.addEventListener("change", apply);

  return {
    // { q, sort } for the server. others: parameters to keep.
    read(parameters, others) {
      rest = others;
      const q = parameters.get("q") ?? "";
      if (document.activeElement !== find) find.value = q;
      sort.value = sorts.some(([value]) => value === parameters.get("sort")) ? parameters.get("sort") : sorts[0][0];
      return { ...(q && { q }), sort: sort.value };
    },
    // An empty list has nothing to find, to order or to select.
    say(number) {
      bar.hidden = number === 0 && !find.value;
      say(total, number === undefined ? "" : count(number, word));
    },
  };
}

// --- objects and images

const kObjectSorts = [["object", t`by name`], ["-created", t`newest first`], ["-updated", t`last changed`], ["-images", t`most images first`]];
const kImageSorts = [["-created", t`newest first`], ["created", t`oldest first`], ["-updated", t`last changed`], ["object", t`by name`],
                     ["source", t`by file`]];

// A page of the server's list; the first has the total.
async function page(kind, { q, sort, object }, cursor, limit) {
  const query = new URLSearchParams({ limit, sort, ...(q && { q }), ...(object !== undefined && { object }), ...(cursor ? { cursor } : { count: true }) });
  const { [kind]: items, next, total } = await api.ask(api.address(`/${kind}?${query}`));
  return { items, next, total };
}
const imagesPage = (wanted, cursor, limit) => page("images", { sort: "-created", ...wanted }, cursor, limit);

// Images without a name belong to no object, so the server's list has no entry for them. The page shows one for all.
async function objectsPage(wanted, cursor, limit) {
  const wantsUnnamed = !cursor && !wanted.q && wanted.sort === "object";
  const [{ items, ...rest }, { images }] = await Promise.all([
    page("objects", wanted, cursor, limit), wantsUnnamed ? api.ask(api.address("/images?object=&limit=1")) : { images: [] }]);
  return { items: [...images.map(({ id }) => ({ object: "", image_id: id })), ...items], ...rest };
}

const nothingYet = (text) => make("span", { class: "nothing" }, text,
  make("a", { class: "button primary", href: link("add"), text: t`Add images`, "data-needs": "write" }));

// keep: parameters of the address beside those of the finder; title(parameters): the heading.
function makeView({ word, sorts, fetchPage, card, keep = [], title }) {
  const place = `${word}s`;
  const nothing = word === "image" ? t`There are no images yet.` : t`There are no objects yet.`;
  const items = makeList({
    place, label: title({}), card, fetchPage, onTotal: (total) => finder.say(total),
    none: ({ object, q }) => (q ? t`No name or file contains "${q}".` : object === undefined ? nothingYet(nothing) :
      t`There are no images without a name.`) });
  const finder = makeFinder({ view: place, bar: items.bar, word, sorts });
  const selection = makeSelection({ ...items, word, refresh: showCurrent });
  return {
    title: title({}),
    show(parameters, how) {
      const kept = Object.fromEntries(keep.filter((name) => parameters.has(name)).map((name) => [name, parameters.get(name)]));
      byId(`${place}-title`).textContent = title(kept);
      return items.show({ ...kept, ...finder.read(parameters, kept), in: api.collectionName() }, how);
    },
    hide: selection.end,
  };
}

export const objectsView = makeView({ word: "object", sorts: kObjectSorts, fetchPage: objectsPage, card: objectCard, title: () => t`Objects` });
export const imagesView = makeView({
  word: "image", sorts: kImageSorts, fetchPage: imagesPage, card: imageCard, keep: ["object"],
  title: ({ object }) => (object === undefined ? t`Images` : object ? t`Images of ${object}` : t`Images without a name`) });

// --- the page of an object

const images = makeList({
  place: "object", label: t`Images of this object`, card: imageCard, fetchPage: imagesPage, none: () => t`This object has no images.` });
const selection = makeSelection({ ...images, word: "image", refresh: showCurrent });
makeBackLink(byId("object-back"));

let latest = 0;

function showActions({ object, image_id: cover, images: number }) {
  const card = byId("object-edit");
  byId("object-actions").replaceChildren(
    make("a", { class: "button primary", href: link("search", { image: cover }), text: t`Find similar` }),
    make("a", { class: "button", href: link("add", { object }), text: t`Add images`, "data-needs": "write", "aria-label": t`Add images of ${object}` }),
    renameButton({ card, object, large: true, onRenamed: (name) => {
      card.replaceChildren();
      location.replace(link("object", { name }));
    } }),
    deleteHereButton({ path: api.objectPath(object), label: t`Delete ${object} with its images`, text: t`Deleted: ${object}, ${count(number, "image")}.`,
                       here: ["object", { name: object }], next: ["objects"] }));
}

export const objectView = {
  title: t`Object`,
  async show(parameters, how) {
    const number = ++latest;
    const name = parameters.get("name") ?? "";
    if (!name) return replaceAddress(link("images", { object: "" }));  // no object has an empty name
    byId("object-title").textContent = name;
    for (const id of ["object-edit", "object-actions", "object-count"]) byId(id).replaceChildren();  // of another object
    byId("object-edit").classList.remove("editing");
    images.bar.hidden = false;
    setTitle(name);
    const listed = images.show({ object: name, in: api.collectionName() }, how);
    try {
      const record = await api.ask(api.objectPath(name));
      if (number !== latest || showing() !== "object") return;
      byId("object-count").textContent = isLeaving(api.objectPath(name)) ? t`This object is being deleted.` : count(record.images, "image");
      showActions(record);
    } catch (error) {
      if (number !== latest) return;
      await listed;
      images.bar.hidden = error.status === 404;
      sayError(images.status, error.status === 404 ? { message: t`There is no object named ${name}.` } : error, showCurrent);
    }
    await listed;
  },
  hide: selection.end,
};
