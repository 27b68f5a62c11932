// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several cards of a list at once: deleting, naming, labelling, merging.
import * as api from "./api.js";
import { count, eachOf, make, makeButton, say, smallButton } from "./dom.js";
import { nameField, noName, openForm } from "./edit.js";
import { refreshHeader } from "./header.js";
import { parseLabels } from "./labels.js";
import { deleteLater, notify, settle } from "./undo.js";

const kStart = "Select several";

// list: the element with the cards, each with card.item { label, path, object }. word: "image" or "object". bar: the
// element for the buttons. refresh(): shows the list again.
export function makeSelection({ list, bar, word, refresh }) {
  const chosen = new Set();  // cards
  let last = null;           // the last card that was clicked: Shift and a click choose all between
  const status = make("span", { role: "status" });
  const place = make("div", {});
  const start = makeButton(kStart, () => turn(!isOn()), { "data-needs": "write" });
  const forms = word === "image" ? [["Name…", nameForm], ["Label…", labelForm]] : [["Merge…", mergeForm]];
  const changes = [...forms.map(([text, form]) => smallButton(text, ({ target }) => open(target, form()))), smallButton("Delete", remove)];
  const panel = make("div", { class: "panel selection", role: "group", "aria-label": `Selected ${word}s`, hidden: true },
    make("div", { class: "row" }, status, smallButton("All shown", () => choose([...list.children])), smallButton("None", () => choose([])), ...changes),
    place);
  bar.append(start);
  bar.after(panel);

  const isOn = () => list.classList.contains("selecting");

  function showState() {
    for (const card of [...chosen]) if (!card.isConnected) chosen.delete(card);
    say(status, `${count(chosen.size, word)} selected`);
    for (const one of changes) one.disabled = !chosen.size;
    for (const card of list.children) {
      card.classList.toggle("chosen", chosen.has(card));
      const box = card.querySelector(".pick");
      if (box) box.checked = chosen.has(card);
    }
  }

  function choose(cards) {
    chosen.clear();
    for (const card of cards) if (card.item) chosen.add(card);
    showState();
  }

  function toggle(card, withRange) {
    const cards = [...list.children];
    const on = !chosen.has(card);
    const to = cards.indexOf(card);
    const from = withRange && last?.isConnected ? cards.indexOf(last) : to;
    for (const one of cards.slice(Math.min(from, to), Math.max(from, to) + 1).filter(({ item }) => item)) {
      if (on) chosen.add(one);
      else chosen.delete(one);
    }
    last = card;
    showState();
  }

  // Also on cards that come later: the list has no end.
  function addBoxes() {
    if (!isOn()) return;
    for (const card of list.children) {
      if (!card.item || card.querySelector(".pick")) continue;
      card.append(make("label", { class: "pick-label" }, make("input", { type: "checkbox", class: "pick" }), make("span", { text: "Select" }),
                       make("span", { class: "hidden-text", text: ` ${card.item.label}` })));
    }
    showState();
  }
  new MutationObserver(addBoxes).observe(list, { childList: true });

  function clearForm() {
    place.replaceChildren();
    place.classList.remove("editing");
  }

  function turn(on) {
    list.classList.toggle("selecting", on);
    start.textContent = on ? "Done" : kStart;
    panel.hidden = !on;
    clearForm();
    chosen.clear();
    if (on) addBoxes();
    else for (const one of list.querySelectorAll(".pick-label")) one.remove();
    showState();
  }

  list.addEventListener("click", (event) => {
    const card = event.target.closest(".card");
    if (!isOn() || !card?.item || !event.target.closest("a, .pick")) return;
    if (event.target.closest("a")) event.preventDefault();  // a click on the image itself
    toggle(card, event.shiftKey);
  });

  // --- changes

  function remove() {
    const cards = [...chosen];
    for (const card of cards) card.remove();
    deleteLater({
      paths: cards.map((card) => card.item.path), text: `Deleted: ${count(cards.length, word)}.`, done: refreshHeader,
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
      refreshHeader();
      await refresh();
      notify(done);
    } });
  }

  // The same change to every selected image; those that fail stay selected.
  async function changeAll(changed, progress) {
    const cards = [...chosen];
    let done = 0;
    const failed = await eachOf(cards, async (card) => {
      await api.patch(card.item.path, changed);
      chosen.delete(card);
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
      return object ? `${n} moved to ${object}.` : `${n} now without a name.`;
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
    const [field, input] = nameField("Name of the merged object", [...chosen][0]?.item.object);
    return { title: "Merge the selected objects", fields: [field], note: "A merge cannot be undone.", async save(progress) {
      const object = input.value.trim();
      if (!object) throw noName();
      await settle(api.objectPath(object));
      const cards = [...chosen].filter((card) => card.item.object !== object);
      for (const [i, card] of cards.entries()) {  // one after the other: they all become the same
        await api.patch(`${card.item.path}?merge=true`, { object });
        chosen.delete(card);
        progress(i + 1, cards.length);
      }
      return `${count(cards.length, "object")} merged into ${object}.`;
    } };
  }

  return { end: () => { if (isOn()) turn(false); } };
}
