// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and pictures, page by page; each can be deleted.
import * as api from "./api.js";
import { byId, count, make, say, shortTime, shorten } from "./dom.js";
import { editButton, renameButton } from "./edit.js";
import { refreshHeader } from "./header.js";
import { objectName } from "./names.js";
import { labelList, thumbnail } from "./results.js";
import { link, showCurrent } from "./router.js";
import { deleteLater, isLeaving } from "./undo.js";

const kPage = 24;

// The lists of both views: where a page begins is a cursor of the server, kept in the address.
function makeList({ view, fetchPage, card, none }) {
  const list = byId(`${view}-list`);
  const status = byId(`${view}-status`);
  const pager = byId(`${view}-pager`);
  const trail = [];  // cursors of the pages before this one
  let latest = 0;

  function showPager(parameters, cursor, next) {
    const to = (after) => link(view, { ...parameters, after });
    const links = [];
    if (cursor) {
      const back = trail[trail.length - 1];
      links.push(make("a", { class: "button", href: to(back || undefined),
                             text: trail.length ? "Previous page" : "First page",
                             onclick: () => trail.pop() }));
    }
    if (next) {
      links.push(make("a", { class: "button", href: to(next), text: "Next page",
                             onclick: () => trail.push(cursor) }));
    }
    pager.replaceChildren(...links);
    pager.hidden = !links.length;
  }

  return async function show(parameters, isNew) {
    const number = ++latest;
    const cursor = parameters.after ?? "";
    if (isNew && !cursor) trail.length = 0;
    list.setAttribute("aria-busy", "true");
    try {
      const { items, next } = await fetchPage(parameters, cursor);
      if (number !== latest) return;
      list.replaceChildren(...items.map((item) => card(item, list)).filter(Boolean));
      showPager(parameters, cursor, next);
      say(status, list.children.length ? "" : none(parameters));
      if (!isNew) scrollTo(0, 0);
    } catch (error) {
      if (number !== latest) return;
      list.replaceChildren();
      say(status, error.message, true);
    } finally {
      list.removeAttribute("aria-busy");
    }
  };
}

const pageQuery = (cursor, more = {}) => {
  const query = new URLSearchParams({ limit: kPage, ...more });
  if (cursor) query.set("cursor", cursor);
  return query;
};

// A card that goes at once, and comes back on undo or when deleting failed.
function deleteButton({ card, path, label, text }) {
  return make("button", {
    type: "button", class: "small", text: "Delete", "aria-label": label,
    onclick: () => {
      const list = card.parentElement;
      const after = card.nextSibling;
      const neighbour = card.nextElementSibling ?? card.previousElementSibling;
      card.remove();
      deleteLater({
        path, text, done: refreshHeader,
        restore(error) {
          list.insertBefore(card, after?.parentElement === list ? after : null);
          if (error) card.append(make("p", { class: "error", text: error.message }));
          card.querySelector("button").focus();
        },
      });
      (neighbour?.querySelector("button") ?? byId("main")).focus();
    },
  });
}

function objectCard({ object, images, image_id: id }) {
  if (isLeaving(api.objectPath(object))) return null;
  const name = object || "Without a name";
  const card = make("li", { class: "card" });
  card.append(
    make("a", { href: link("pictures", { object }) }, thumbnail(id),
         make("span", { class: "name", text: name })),
    make("span", { class: "quiet", text: images ? count(images, "picture") : "pictures that nobody has named" }));
  if (object) {
    card.dataset.object = object;
    card.append(make("div", { class: "row" },
      renameButton({ card, object, onRenamed: showRenamed }),
      deleteButton({
        card, path: api.objectPath(object), label: `Delete ${name} with its pictures`,
        text: `Deleted: ${name}, ${count(images, "picture")}.`,
      })));
  }
  return card;
}

// The list anew, and the focus on what was renamed, if it is on this page.
async function showRenamed(name) {
  await showCurrent();
  const card = [...byId("objects-list").children].find((one) => one.dataset.object === name);
  (card?.querySelector("a") ?? byId("objects-title")).focus();
}

function pictureCard(image) {
  const path = api.imagePath(image.id);
  if (isLeaving(path) || isLeaving(api.objectPath(image.object))) return null;
  const name = objectName(image.object, image.source);
  const file = image.source || image.id.slice(0, 12);
  const card = make("li", { class: "card" });
  card.append(...[
    make("a", { href: link("search", { image: image.id }), title: "Search with this picture" },
         thumbnail(image.id), make("span", { class: "name", text: name }),
         make("span", { class: "hidden-text", text: `, ${file}: search with this picture` })),
    make("span", { class: "quiet", text: shorten(file, 32), title: file }),
    make("span", { class: "quiet", title: `Added ${shortTime(image.added_at)}`,
                   text: `${image.width} × ${image.height}, ${count(image.keypoints, "key point")}` }),
    labelList(image.metadata),
    make("div", { class: "row" },
         editButton({ card, image, onChanged(now) {
           const fresh = pictureCard(now);
           if (!fresh) {  // of an object that is being deleted
             card.remove();
             byId("pictures-title").focus();
             return;
           }
           card.replaceWith(fresh);
           fresh.querySelector("button").focus();
         } }),
         deleteButton({ card, path, label: `Delete the picture ${file} of ${name}`,
                        text: `Deleted: ${file}.` })),
  ].filter(Boolean));
  return card;
}

// Pictures that nobody has named belong to no object, so they are no entry of the server's list: one
// entry for all of them, if there are any.
async function pictureWithoutName() {
  const { images } = await api.ask(api.address("/images?object=&limit=1"));
  return images.map(({ id }) => ({ object: "", image_id: id }));
}

const showObjects = makeList({
  view: "objects",
  async fetchPage(parameters, cursor) {
    const [{ objects, next }, unnamed] = await Promise.all([
      api.ask(api.address(`/objects?${pageQuery(cursor)}`)), cursor ? [] : pictureWithoutName()]);
    return { items: [...unnamed, ...objects], next };
  },
  card: objectCard,
  none: () => "There are no objects yet. Add pictures with the name of what they show.",
});

const showPictures = makeList({
  view: "pictures",
  async fetchPage({ object }, cursor) {
    const query = pageQuery(cursor, object === undefined ? {} : { object });
    const { images, next } = await api.ask(api.address(`/images?${query}`));
    return { items: images, next };
  },
  card: pictureCard,
  none: ({ object }) => (object === undefined ? "There are no pictures yet." :
                                                "No picture of this object is left."),
});

function markTabs(view) {
  for (const tab of document.querySelectorAll(`#view-${view} [data-tab]`)) tab.href = link(tab.dataset.tab);
}

const plain = (parameters, ...names) => Object.fromEntries(
  names.filter((name) => parameters.has(name)).map((name) => [name, parameters.get(name)]));

export const objectsView = {
  title: "Objects",
  show(parameters, isNew) {
    markTabs("objects");
    return showObjects(plain(parameters, "after"), isNew);
  },
};

export const picturesView = {
  title: "Pictures",
  show(parameters, isNew) {
    markTabs("pictures");
    const wanted = plain(parameters, "object", "after");
    byId("pictures-title").textContent =
      wanted.object === undefined ? "Pictures" :
      wanted.object ? `Pictures of ${wanted.object}` : "Pictures without a name";
    return showPictures(wanted, isNew);
  },
};
