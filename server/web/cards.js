// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and images as cards of a list.
import * as api from "./api.js";
import { byId, count, make, makeButton, shortTime, shorten, smallButton } from "./dom.js";
import { editButton, renameButton } from "./edit.js";
import { objectName } from "./names.js";
import { labelList, thumbnail } from "./results.js";
import { go, link, showCurrent } from "./router.js";
import { t } from "./texts.js";
import { deleteLater, isLeaving, notify } from "./undo.js";

export const fileOf = (image) => image.source || image.id.slice(0, 12);

// An image that opens its page. hidden: text for screen readers; lines: elements below it.
export function imageLink(image, hidden, ...lines) {
  return make("li", { class: "card" }, make("a", { href: link("image", { id: image.id }) }, thumbnail(image.id, image.sha256),
    make("span", { class: "name", text: objectName(image.object, image.source) }), make("span", { class: "hidden-text", text: hidden })), ...lines);
}

// Removes the card at once, and brings it back on undo or after a failure.
export const deleteButton = ({ card, path, label, text }) => smallButton(t`Delete`, () => {
  const list = card.parentElement;
  const after = card.nextSibling;
  const neighbour = card.nextElementSibling ?? card.previousElementSibling;
  card.remove();
  deleteLater({
    paths: [path], text,
    restore(error) {
      list.insertBefore(card, after?.parentElement === list ? after : null);
      if (error) card.append(make("p", { class: "error", text: error.message }));
      card.querySelector("button").focus();
    },
  });
  (neighbour?.querySelector("button") ?? byId("main")).focus();
}, { class: "small", "data-needs": "write", "aria-label": label });

// The same on a page of its own: here and next are [view, parameters], for undo and for people who opened the page by its link.
export const deleteHereButton = ({ path, label, text, here, next }) => makeButton(t`Delete`, () => {
  const collection = api.collectionName();
  deleteLater({
    paths: [path], text,
    restore(error) {
      if (collection === api.collectionName()) go(...here);
      if (error) notify(error.message, true);
    },
  });
  if (history.state?.inside) history.back();
  else go(...next);
}, { "data-needs": "write", "aria-label": label });

// Adds a box that shows while several cards are being selected.
function makeSelectable(card, item) {
  card.item = item;
  card.append(make("label", { class: "pick-label" }, make("input", { type: "checkbox", class: "pick" }), make("span", { text: t`Select` }),
                   make("span", { class: "hidden-text", text: ` ${item.label}` })));
}

export function objectCard({ object, images, image_id: id }) {
  const path = api.objectPath(object);
  if (isLeaving(path)) return null;
  const card = make("li", { class: "card" },
    make("a", { href: object ? link("object", { name: object }) : link("images", { object }) }, thumbnail(id),
         make("span", { class: "name", text: object || t`Without a name` })),
    make("span", { class: "quiet", text: images ? count(images, "image") : t`images without an object name` }));
  if (!object) return card;
  makeSelectable(card, { label: object, object, path });
  card.dataset.object = object;
  card.append(make("div", { class: "row" }, renameButton({ card, object, onRenamed: showRenamed }),
    deleteButton({ card, path, label: t`Delete ${object} with its images`, text: t`Deleted: ${object}, ${count(images, "image")}.` })));
  return card;
}

// Shows the list again, and focuses the renamed object if it is on this page.
async function showRenamed(name) {
  await showCurrent();
  const card = [...byId("objects-list").children].find((one) => one.dataset.object === name);
  (card?.querySelector("a") ?? byId("objects-title")).focus();
}

export function imageCard(image) {
  const path = api.imagePath(image.id);
  if (isLeaving(path) || isLeaving(api.objectPath(image.object))) return null;
  const file = fileOf(image);
  const card = imageLink(image, `, ${file}`, make("span", { class: "quiet", text: shorten(file, 32), title: file }),
    make("span", { class: "quiet", title: t`Added ${shortTime(image.added_at)}`,
                   text: `${image.width} × ${image.height}, ${count(image.keypoints, "keypoint")}` }), labelList(image.metadata));
  makeSelectable(card, { label: file, object: image.object, path });
  const onChanged = (now) => {
    const list = card.parentElement;
    const fresh = imageCard(now);
    if (fresh) {
      card.replaceWith(fresh);
      fresh.querySelector("button").focus();
    } else {  // its new object is being deleted
      card.remove();
      list.closest(".view").querySelector("h1").focus();
    }
  };
  card.append(make("div", { class: "row" }, editButton({ card, image, onChanged }), deleteButton({
    card, path, label: t`Delete the image ${file} of ${objectName(image.object, image.source)}`, text: t`Deleted: ${file}.` })));
  return card;
}
