// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several cards of a list at once: deleting, naming, labelling, merging.
import * as api from "./api.js";
import { count, eachOf, make, makeButton, say, smallButton } from "./dom.js";
import { nameField, noName, openForm } from "./edit.js";
import { parseLabels } from "./labels.js";
import { shownName } from "./names.js";
import { t } from "./texts.js";
import { deleteLater, notify, settle } from "./undo.js";

const kStart = t`Select several`;
const kWords = {
  image: { selected: t`Selected images`, move: t`Move the selected images` },
  object: { selected: t`Selected objects`, move: t`Move the selected objects` },
};

// list: the element with the cards of cards.js. word: "image" or "object". bar: the element for the buttons. refresh():
// shows the list again.
export function makeSelection({ list, bar, word, refresh }) {
  let last = null;  // the last card that was clicked: Shift and a click choose all between
  const status = make("span", { role: "status" });
  const place = make("div", {});
  const start = makeButton(kStart, () => turn(!isOn()), { "data-needs": "write" });
  const forms = [...word === "image" ? [[t`Name…`, nameForm], [t`Label…`, labelForm]] : [[t`Merge…`, mergeForm]], [t`Move…`, moveForm]];
  const changes = [...forms.map(([text, form]) => smallButton(text, async ({ target }) => open(target, await form()))), smallButton(t`Delete`, remove)];
  const panel = make("div", { class: "panel selection", role: "group", "aria-label": kWords[word].selected, hidden: true },
    make("div", { class: "row" }, status, smallButton(t`All shown`, () => choose(selectable(), true)),
      smallButton(t`None`, () => choose(selectable(), false)), ...changes),
    place);
  bar.append(start);
  bar.after(panel);

  const isOn = () => list.classList.contains("selecting");

  const boxOf = (card) => card.querySelector(".pick");
  const selectable = () => [...list.children].filter(boxOf);
  const chosen = () => selectable().filter((card) => boxOf(card).checked);

  function showState() {
    say(status, t`${count(chosen().length, word)} selected`);
    for (const one of changes) one.disabled = !chosen().length;
  }

  function choose(cards, on) {
    for (const card of cards) boxOf(card).checked = on;
    showState();
  }

  new MutationObserver(() => { if (isOn()) showState(); }).observe(list, { childList: true });

  function clearForm() {
    place.replaceChildren();
    place.classList.remove("editing");
  }

  function turn(on) {
    list.classList.toggle("selecting", on);
    start.textContent = on ? t`Done` : kStart;
    panel.hidden = !on;
    clearForm();
    choose(selectable(), false);
  }

  list.addEventListener("click", (event) => {
    const card = event.target.closest(".card");
    if (!isOn() || !card?.item || !event.target.closest("a, .pick")) return;
    const onImage = Boolean(event.target.closest("a"));  // and not on its box, which has changed already
    if (onImage) event.preventDefault();
    const cards = selectable();
    const to = cards.indexOf(card);
    const from = event.shiftKey && last?.isConnected ? cards.indexOf(last) : to;
    last = card;
    choose(cards.slice(Math.min(from, to), Math.max(from, to) + 1), boxOf(card).checked !== onImage);
  });

  // --- changes

  function remove() {
    const cards = chosen();
    for (const card of cards) card.remove();
    deleteLater({
      paths: cards.map((card) => card.item.path), text: t`Deleted: ${count(cards.length, word)}.`,
      restore(error, left) {
        if (error) notify(t`${count(left.length, word)} could not be deleted. ${error.message}`, true);
        refresh();
      },
    });
    turn(false);
    start.focus();
  }

  // form.save(progress) throws what is wrong, and returns the notice for success: [text, undo()], or a text.
  function open(opener, form) {
    if (!form) return;
    clearForm();
    openForm({ card: place, opener, ...form, async save(close, progress) {
      const done = await form.save(progress);
      turn(false);
      start.focus();  // before the list comes: people may already use it then
      await refresh();
      const [text, undo] = [done].flat();
      notify(text, false, undo);
    } });
  }

  // The same change to every selected image; those that fail stay selected.
  async function changeAll(changed, progress, query = "") {
    const cards = chosen();
    let done = 0;
    const failed = await eachOf(cards, async (card) => {
      await api.patch(card.item.path + query, changed);
      boxOf(card).checked = false;
      progress(++done, cards.length);
    });
    showState();
    if (failed.length) throw new Error(t`${count(failed.length, word)} could not be changed. ${failed[0].error.message}`);
    return count(cards.length, word);
  }

  function nameForm() {
    const [field, input] = nameField(t`Object`);
    return { title: t`Name the selected images`, fields: [field], note: t`The images move to the object with this name.`, async save(progress) {
      const object = input.value.trim();
      if (object) await settle(api.objectPath(object));
      const before = chosen().map(({ item }) => item);
      const n = await changeAll({ object }, progress);
      return [object ? t`${n} moved to ${object}.` : t`Name removed from ${n}.`, async () => {
        const [failed] = await eachOf(before, (item) => api.patch(item.path, { object: item.object }));
        if (failed) throw failed.error;
      }];
    } };
  }

  async function moveForm() {
    const others = (await api.collections().catch(() => ({ collections: [] }))).collections.filter(({ name }) => name !== api.collectionName());
    if (!others.length) return notify(t`There is no other collection. Create one under Collection.`, true);
    const input = make("select", {}, ...others.map((one) => make("option", { value: one.name, text: shownName(one) })));
    const fields = [make("label", { text: t`To the collection` }, input)];
    return { title: kWords[word].move, fields, note: t`An object of the same name there gets the images.`, async save(progress) {
      const n = await changeAll({ collection: input.value }, progress, word === "object" ? "?merge=true" : "");
      return t`${n} moved to ${input.selectedOptions[0].text}.`;
    } };
  }

  function labelForm() {
    const input = make("input", { type: "text", autocomplete: "off", placeholder: t`shelf=4, colour=red` });
    const fields = [make("label", { text: t`Labels to add` }, input)];
    return { title: t`Label the selected images`, fields, note: t`Other labels stay. An empty value (shelf=) removes a label.`, async save(progress) {
      const labels = parseLabels(input.value);
      if (!labels) throw new Error(t`Enter at least one label: name=value.`);
      for (const [name, value] of Object.entries(labels)) if (value === "") labels[name] = null;
      return t`${await changeAll({ metadata: labels }, progress)} labelled.`;
    } };
  }

  function mergeForm() {
    const [field, input] = nameField(t`Name of the merged object`, chosen()[0]?.item.object);
    return { title: t`Merge the selected objects`, fields: [field], note: t`A merge cannot be undone.`, async save(progress) {
      const object = input.value.trim();
      if (!object) throw noName();
      await settle(api.objectPath(object));
      const cards = chosen().filter((card) => card.item.object !== object);
      for (const [i, card] of cards.entries()) {  // one after the other: they all become the same
        await api.patch(`${card.item.path}?merge=true`, { object });
        boxOf(card).checked = false;
        progress(i + 1, cards.length);
      }
      return t`${count(cards.length, "object")} merged into ${object}.`;
    } };
  }

  return { end: () => { if (isOn()) turn(false); } };
}
