// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes in place: the name of an object, the name and the labels of an image.
import * as api from "./api.js";
import { make, makeButton, onSubmit, say, smallButton } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { labelLines, labelsPatch } from "./labels.js";
import { kLongestName, objectName } from "./names.js";
import { link, noteAddress } from "./router.js";
import { t } from "./texts.js";
import { notify, settle } from "./undo.js";

let forms = 0;

// A form at the end of `card`, which has at most one. fields: elements; save(close, progress): throws what is wrong, and
// its error may have `offers`: [[text, action]]. Escape and "Cancel" close the form.
export function openForm({ card, opener, title, fields, note = "", save }) {
  if (card.classList.contains("editing")) return;
  const status = make("p", { role: "status" });
  const offer = make("div", { class: "row" });
  const submit = make("button", { type: "submit", class: "primary small", text: t`Save` });
  const close = () => {
    form.remove();
    card.classList.remove("editing");
    opener.focus();
  };
  const form = make("form", { class: "edit", "aria-label": title }, ...fields, make("p", { class: "quiet", text: note }), status, offer,
                    make("div", { class: "row" }, submit, smallButton(t`Cancel`, close)));
  const field = form.querySelector("input, select, textarea");
  const run = async (action) => {
    submit.disabled = true;
    offer.replaceChildren();
    say(status, t`Saving…`);
    try {
      await action();
    } catch (error) {
      say(status, error.message, true);
      offer.append(...(error.offers ?? []).map(([text, then]) => smallButton(text, () => run(then))));
      submit.disabled = false;
      (offer.firstElementChild ?? field).focus();
    }
  };
  onSubmit(form, () => run(() => save(close, (n, of) => say(status, t`${n} of ${of}…`))));
  form.addEventListener("input", () => offer.replaceChildren());  // it was for the text before
  form.addEventListener("keydown", (event) => { if (event.key === "Escape") close(); });
  card.classList.add("editing");
  card.append(form);
  field.focus();
  field.select?.();
  offerObjectNames();
}

// [elements, input]
export function nameField(label, value = "") {
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value, list: "object-names" });
  return [make("label", { text: label }, input), input];
}

export const noName = () => new Error(t`Enter a name for the object.`);

// `large`: on a page of its own, not on a card.
const editOpener = (label, large, open) => makeButton(t`Edit`, ({ currentTarget }) => open(currentTarget), {
  class: large ? "" : "small", "data-needs": "write", "aria-label": label });

// Undoes a rename. A page of the object gets its old address.
function makeRenameBack(name, object) {
  const [before, now] = [object, name].map((one) => ({ path: api.objectPath(one), hash: link("object", { name: one }) }));
  return async () => {
    await settle(before.path);
    await api.patch(now.path, { object });
    if (location.hash === now.hash) noteAddress(before.hash);
  };
}

// onRenamed(name) is called when the object has another name.
export const renameButton = ({ card, object, large = false, onRenamed }) => editOpener(t`Edit ${object}`, large, (opener) => {
  const [field, input] = nameField(t`Name`, object);
  const rename = async (merge, name = input.value.trim()) => {
    if (!name) throw noName();
    await settle(api.objectPath(name));
    try {
      await api.patch(`${api.objectPath(object)}${merge ? "?merge=true" : ""}`, { object: name });
    } catch (error) {
      if (error.code === "object_exists") {
        error.message = t`An object named ${name} already exists.`;
        error.offers = [[t`Merge`, () => rename(true, name)]];
      }
      throw error;
    }
    if (merge) notify(t`Merged ${object} into ${name}.`);
    else notify(t`Renamed to ${name}.`, false, makeRenameBack(name, object));
    onRenamed(name);
  };
  openForm({ card, opener, title: t`Rename ${object}`, fields: [field], save: (close) => (input.value.trim() === object ? close() : rename(false)) });
});

// onChanged(record) gets the new record. A change that someone else made since the form opened is not overwritten.
export const editButton = ({ card, image, large = false, onChanged }) => {
  const name = objectName(image.object, image.source);
  return editOpener(t`Edit the image ${image.source || image.id} of ${name}`, large, async (opener) => {
    if (card.classList.contains("editing")) return;
    let before = null;
    try {
      before = await api.record(api.imagePath(image.id));
    } catch (error) {
      notify(error.message, true);
      return;
    }
    const { value, etag } = before;
    const [field, input] = nameField(t`Object`, value.object);
    const id = `edit-labels-${++forms}`;
    const labels = make("textarea", { id, rows: 3, autocomplete: "off", placeholder: t`shelf=4`, text: labelLines(value.metadata) });
    const fields = [field, make("label", { for: id, text: t`Labels, one per line` }), labels];
    openForm({ card, opener, title: t`Edit ${name}`, fields, async save() {
      const object = input.value.trim();
      const metadata = labelsPatch(value.metadata, labels.value);
      if (object && object !== value.object) await settle(api.objectPath(object));
      const path = api.imagePath(image.id);
      const now = await api.patch(path, { ...(object !== value.object && { object }), ...(metadata && { metadata }) }, etag);
      if (object !== value.object) notify(t`Renamed to ${objectName(object, value.source)}.`, false, () => api.patch(path, { object: value.object }));
      onChanged(now);
    } });
  });
};
