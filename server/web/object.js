// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page of an object: all its images, and what can be done with the object.
import * as api from "./api.js";
import { imagesPage } from "./browse.js";
import { deleteHereButton, imageCard } from "./cards.js";
import { byId, count, make, say } from "./dom.js";
import { renameButton } from "./edit.js";
import { makeList } from "./list.js";
import { link, makeBackLink, setTitle, showCurrent, showing } from "./router.js";
import { makeSelection } from "./select.js";
import { isLeaving } from "./undo.js";

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
