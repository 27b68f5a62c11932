// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several cards of a list at once: deleting, naming, labelling, merging.
import * as api from "./api.js";
import { count, eachOf, make, makeButton, say, smallButton } from "./dom.js";
import { nameField, noName, openForm } from "./edit.js";
import { parseLabels } from "./labels.js";
import { deleteLater, notify, settle } from "./undo.js";

const kStart = "Select several";

// list: the element with the cards of cards.js. word: "image" or "object". bar: the element for the buttons. refresh():
// shows the list again.
export function makeSelection({ list, bar, word, refresh }) {
  let last = null;  // the last card that was clicked: Shift and a click choose all between
  const status = make("span", { role: "status" });
  const place = make("div", {});
  const start = makeButton(kStart, () => turn(!isOn()), { "data-needs": "write" });
  const forms = word === "image" ? [["Name…", nameForm], ["Label…", labelForm]] : [["Merge…", mergeForm]];
  const changes = [...forms.map(([text, form]) => smallButton(text, ({ target }) => open(target, form()))), smallButton("Delete", remove)];
  const panel = make("div", { class: "panel selection", role: "group", "aria-label": `Selected ${word}s`, hidden: true },
    make("div", { class: "row" }, status, smallButton("All shown", () => choose(selectable(), true)),
      smallButton("None", () => choose(selectable(), false)), ...changes),
    place);
  bar.append(start);
  bar.after(panel);

  const isOn = () => list.classList.contains("selecting");

  const boxOf = (card) => card.querySelector(".pick");
  const selectable = () => [...list.children].filter(boxOf);
  const chosen = () => selectable().filter((card) => boxOf(card).checked);

  function showState() {
    say(status, `${count(chosen().length, word)} selected`);
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
    start.textContent = on ? "Done" : kStart;
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
      paths: cards.map((card) => card.item.path), text: `Deleted: ${count(cards.length, word)}.`,
      restore(error, left) {
        if (error) notify(`${count(left.length, word)} could not be deleted. ${error.message}`, true);
        refresh();
      },
    });
    turn(false);
    start.focus();
  }

  // form.save(progress) throws what is wrong, and returns the notice for success.
  function open(opener, form) {
    clearForm();
    openForm({ card: place, opener, ...form, async save(close, progress) {
      const done = await form.save(progress);
      turn(false);
      start.focus();  // before the list comes: people may already use it then
      await refresh();
      notify(done);
    } });
  }

  // The same change to every selected image; those that fail stay selected.
  async function changeAll(changed, progress) {
    const cards = chosen();
    let done = 0;
    const failed = await eachOf(cards, async (card) => {
      await api.patch(card.item.path, changed);
      boxOf(card).checked = false;
      progress(++done, cards.length);
    });
    showState();
    if (failed.length) throw new Error(`${count(failed.length, word)} could not be changed. ${failed[0].error.message}`);
    return count(cards.length, word);
  }

  function nameForm() {
    const [field, input] = nameField("Object");
    return { title: "Name the selected images", fields: [field], note: "The images move to the object with this name.", async save(progress) {
      const object = input.value.trim();
      if (object) await settle(api.objectPath(object));
      const n = await changeAll({ object }, progress);
      return object ? `${n} moved to ${object}.` : `Name removed from ${n}.`;
    } };
  }

  function labelForm() {
    const input = make("input", { type: "text", autocomplete: "off", placeholder: "shelf=4, colour=red" });
    const fields = [make("label", { text: "Labels to add" }, input)];
    return { title: "Label the selected images", fields, note: "Other labels stay. An empty value (shelf=) removes a label.", async save(progress) {
      const labels = parseLabels(input.value);
      if (!labels) throw new Error("Enter at least one label: name=value.");
      for (const [name, value] of Object.entries(labels)) if (value === "") labels[name] = null;
      return `${await changeAll({ metadata: labels }, progress)} labelled.`;
    } };
  }

  function mergeForm() {
    const [field, input] = nameField("Name of the merged object", chosen()[0]?.item.object);
    return { title: "Merge the selected objects", fields: [field], note: "A merge cannot be undone.", async save(progress) {
      const object = input.value.trim();
      if (!object) throw noName();
      await settle(api.objectPath(object));
      const cards = chosen().filter((card) => card.item.object !== object);
      for (const [i, card] of cards.entries()) {  // one after the other: they all become the same
        await api.patch(`${card.item.path}?merge=true`, { object });
        boxOf(card).checked = false;
        progress(i + 1, cards.length);
      }
      return `${count(cards.length, "object")} merged into ${object}.`;
    } };
  }

  return { end: () => { if (isOn()) turn(false); } };
}
