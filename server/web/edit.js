// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changing what is stored, in place: the name of an object, the name and the labels of a picture.
import * as api from "./api.js";
import { make, say } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { refreshHeader } from "./header.js";
import { labelLines, labelsPatch } from "./labels.js";
import { kLongestName, objectName } from "./names.js";
import { notify, settle } from "./undo.js";

let forms = 0;

// A form at the end of the card, in place of its buttons. fields: elements; save(say): throws what is
// wrong. Escape and "Cancel" close it. A card has at most one.
function openForm(card, opener, title, fields, save) {
  if (card.classList.contains("editing")) return;
  const status = make("p", { role: "status" });
  const offer = make("div", { class: "row" });
  const submit = make("button", { type: "submit", class: "primary small", text: "Save" });
  const cancel = make("button", { type: "button", class: "small", text: "Cancel" });
  const form = make("form", { class: "edit", "aria-label": title }, ...fields, status, offer,
                    make("div", { class: "row" }, submit, cancel));
  const close = () => {
    form.remove();
    card.classList.remove("editing");
    opener.focus();
  };
  const run = async (action) => {
    submit.disabled = true;
    offer.replaceChildren();
    say(status, "Saving…");
    try {
      await action();
    } catch (error) {
      say(status, error.message, true);
      for (const [text, then] of error.offers ?? []) {
        offer.append(make("button", { type: "button", class: "small", text, onclick: () => run(then) }));
      }
      submit.disabled = false;
      (offer.firstElementChild ?? form.querySelector("input")).focus();
    }
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    run(() => save(close));
  });
  form.addEventListener("input", () => offer.replaceChildren());  // it was for what stood there before
  form.addEventListener("keydown", (event) => { if (event.key === "Escape") close(); });
  cancel.addEventListener("click", close);
  card.classList.add("editing");
  card.append(form);
  form.querySelector("input").select();
  offerObjectNames();
}

const nameField = (label, value) => {
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value,
                                list: "object-names" });
  return [make("label", { text: label }, input), input];
};

// `large`: on a page of its own, in place of a card.
function button(label, large, open) {
  const opener = make("button", { type: "button", class: large ? "" : "small", text: "Edit", "data-needs": "write",
                                 "aria-label": label });
  opener.addEventListener("click", () => open(opener));
  return opener;
}

// onRenamed(name) is called when the object has another name.
export function renameButton({ card, object, large = false, onRenamed }) {
  return button(`Rename ${object}`, large, (opener) => {
    const [field, input] = nameField("Name", object);
    const rename = async (merge, name = input.value.trim()) => {
      if (!name) throw new Error("An object needs a name.");
      await settle(api.objectPath(name));
      try {
        await api.patch(`${api.objectPath(object)}${merge ? "?merge=true" : ""}`, { object: name });
      } catch (error) {
        if (error.code === "object_exists") {
          error.message = `There is an object called ${name} already.`;
          error.offers = [[`Make one object of both`, () => rename(true, name)]];
        }
        throw error;
      }
      notify(merge ? `${object} and ${name} are one object now.` : `${object} is called ${name} now.`);
      refreshHeader();
      onRenamed(name);
    };
    openForm(card, opener, `Rename ${object}`, [field], (close) =>
      (input.value.trim() === object ? close() : rename(false)));
  });
}

// onChanged(record) gets the record as it is then. What somebody else has changed since the form was
// opened is not overwritten.
export function editButton({ card, image, large = false, onChanged }) {
  const name = objectName(image.object, image.source);
  return button(`Edit the picture ${image.source || image.id} of ${name}`, large, async (opener) => {
    if (card.classList.contains("editing")) return;
    let before = null;
    try {
      before = await api.record(api.imagePath(image.id));
    } catch (error) {
      notify(error.message, true);
      return;
    }
    const { value, etag } = before;
    const [field, input] = nameField("Shows", value.object);
    const id = `edit-labels-${++forms}`;
    const labels = make("textarea", { id, rows: 3, autocomplete: "off", placeholder: "shelf=4" });
    labels.value = labelLines(value.metadata);
    openForm(card, opener, `Edit ${name}`,
             [field, make("label", { for: id, text: "Labels, one a line" }), labels],
             async () => {
      const patch = {};
      if (input.value.trim() !== value.object) patch.object = input.value.trim();
      const changed = labelsPatch(value.metadata, labels.value);
      if (changed) patch.metadata = changed;
      if (patch.object) await settle(api.objectPath(patch.object));
      const now = await api.patch(api.imagePath(image.id), patch, etag);
      refreshHeader();
      onChanged(now);
    });
  });
}

// A picture that is there already in the collection, by another name: a button to call it what was typed.
export function renameOffer({ id, collection, object, metadata, done, failed }) {
  return make("button", {
    type: "button", class: "small", text: object ? `Call it ${object}` : "Take these labels",
    onclick: async (event) => {
      event.target.disabled = true;
      try {
        if (object) await settle(api.objectPath(object, collection));
        await api.patch(api.imagePath(id, "", collection), { ...(object && { object }), ...(metadata && { metadata }) });
        done();
      } catch (error) {
        event.target.disabled = false;
        failed(error);
      }
    },
  });
}
