// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An object's page: all its pictures, its name, and what can be done with it.
import * as api from "./api.js";
import { picturesPage } from "./browse.js";
import { pictureCard } from "./cards.js";
import { byId, count, make, say } from "./dom.js";
import { renameButton } from "./edit.js";
import { refreshHeader } from "./header.js";
import { makeList } from "./list.js";
import { go, link, makeBackLink, setTitle, showCurrent, showing } from "./router.js";
import { makeSelection } from "./select.js";
import { deleteLater, isLeaving, notify } from "./undo.js";

const pictures = makeList({
  place: "object",
  fetchPage: (wanted, cursor, limit) => picturesPage(wanted, cursor, limit),
  card: pictureCard,
  none: () => "No picture of it is left.",
});
const selection = makeSelection({
  list: pictures.list, bar: byId("object-bar"), word: "picture", refresh: showCurrent });
makeBackLink(byId("object-back"));

let latest = 0;

function remove({ object, images }) {
  const collection = api.collectionName();
  deleteLater({
    paths: [api.objectPath(object)], text: `Deleted: ${object}, ${count(images, "picture")}.`, done: refreshHeader,
    restore(error) {
      if (collection === api.collectionName()) go("object", { name: object });
      if (error) notify(error.message, true);
    },
  });
  if (history.state?.inside) history.back();
  else go("objects");
}

function showActions(record) {
  const { object, image_id: cover } = record;
  const actions = byId("object-actions");
  actions.replaceChildren(
    make("a", { class: "button primary", href: link("search", { image: cover }), text: "Find similar" }),
    make("a", { class: "button", href: link("add", { object }), text: "Add pictures of it", "data-needs": "write" }),
    renameButton({ card: byId("object-edit"), object, large: true, onRenamed: (name) => {
      byId("object-edit").replaceChildren();
      location.replace(link("object", { name }));
    } }),
    make("button", { type: "button", text: "Delete", "data-needs": "write", "aria-label": `Delete ${object} with its pictures`,
                     onclick: () => remove(record) }));
}

export const objectView = {
  title: "Object",
  async show(parameters, how) {
    const number = ++latest;
    const name = parameters.get("name") ?? "";
    byId("object-back").href = link("objects");
    byId("object-title").textContent = name;
    byId("object-edit").replaceChildren();
    byId("object-edit").classList.remove("editing");
    byId("object-actions").replaceChildren();  // those of another object
    byId("object-count").textContent = "";
    byId("object-bar").hidden = false;
    setTitle(name);
    const listed = pictures.show({ object: name, in: api.collectionName() }, how);
    try {
      const record = await api.ask(api.objectPath(name));
      if (number !== latest || showing() !== "object") return;
      byId("object-count").textContent = isLeaving(api.objectPath(name)) ? "It is being deleted." :
                                                                            count(record.images, "picture");
      showActions(record);
    } catch (error) {
      if (number !== latest) return;
      await listed;
      byId("object-bar").hidden = error.status === 404;
      say(byId("object-status"), error.status === 404 ? `There is no object called ${name}.` : error.message, true);
    }
    await listed;
  },
  hide: selection.end,
};
