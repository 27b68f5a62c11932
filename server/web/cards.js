// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects and pictures as cards of a list.
import * as api from "./api.js";
import { byId, count, make, shortTime, shorten } from "./dom.js";
import { editButton, renameButton } from "./edit.js";
import { refreshHeader } from "./header.js";
import { objectName } from "./names.js";
import { labelList, thumbnail } from "./results.js";
import { link, showCurrent } from "./router.js";
import { deleteLater, isLeaving } from "./undo.js";

export const fileOf = (image) => image.source || image.id.slice(0, 12);

// A card that goes at once, and comes back on undo or when deleting failed.
export function deleteButton({ card, path, label, text }) {
  return make("button", {
    type: "button", class: "small", text: "Delete", "data-needs": "write", "aria-label": label,
    onclick: () => {
      const list = card.parentElement;
      const after = card.nextSibling;
      const neighbour = card.nextElementSibling ?? card.previousElementSibling;
      card.remove();
      deleteLater({
        paths: [path], text, done: refreshHeader,
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

export function objectCard({ object, images, image_id: id }) {
  if (isLeaving(api.objectPath(object))) return null;
  const name = object || "Without a name";
  const card = make("li", { class: "card" });
  card.append(
    make("a", { href: object ? link("object", { name: object }) : link("pictures", { object }) }, thumbnail(id),
         make("span", { class: "name", text: name })),
    make("span", { class: "quiet", text: images ? count(images, "picture") : "pictures that nobody has named" }));
  if (object) {
    card.item = { label: name, object, path: api.objectPath(object) };
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

export function pictureCard(image) {
  const path = api.imagePath(image.id);
  if (isLeaving(path) || isLeaving(api.objectPath(image.object))) return null;
  const name = objectName(image.object, image.source);
  const file = fileOf(image);
  const card = make("li", { class: "card" });
  card.item = { label: file, object: image.object, path };
  card.append(...[
    make("a", { href: link("picture", { id: image.id }) },
         thumbnail(image.id, image.sha256), make("span", { class: "name", text: name }),
         make("span", { class: "hidden-text", text: `, ${file}` })),
    make("span", { class: "quiet", text: shorten(file, 32), title: file }),
    make("span", { class: "quiet", title: `Added ${shortTime(image.added_at)}`,
                   text: `${image.width} × ${image.height}, ${count(image.keypoints, "key point")}` }),
    labelList(image.metadata),
    make("div", { class: "row" },
         editButton({ card, image, onChanged(now) {
           const list = card.parentElement;
           const fresh = pictureCard(now);
           if (!fresh) {  // of an object that is being deleted
             card.remove();
             list.closest(".view").querySelector("h1").focus();
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
