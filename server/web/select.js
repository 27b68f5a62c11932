// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Choosing several cards of a list, and doing the same to all of them: deleting, naming, labelling.
import * as api from "./api.js";
import { byId, count, eachOf, make, say } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { refreshHeader } from "./header.js";
import { parseLabels } from "./labels.js";
import { kLongestName } from "./names.js";
import { deleteLater, notify, settle } from "./undo.js";

const kStart = "Select several";

// list: the element with the cards; each has card.item { label, path, object }. word: "picture" or "object". bar: the element for the
// buttons. refresh(): shows the list anew.
export function makeSelection({ list, bar, word, refresh }) {
  const chosen = new Set();  // cards
  let last = null;           // the card that was clicked last: Shift and a click choose all between
  const status = make("span", { role: "status" });
  const place = make("div", {});
  const start = make("button", { type: "button", text: kStart, "data-needs": "write" });
  const button = (text, onclick, more = {}) => make("button", { type: "button", class: "small", text, onclick, ...more });
  const actions = make("div", { class: "row" }, status,
    button("All shown", () => choose([...list.children])), button("None", () => choose([])), ...(word === "picture" ?
      [button("Name…", () => openForm(nameForm())), button("Label…", () => openForm(labelForm()))] :
      [button("Make one of them…", () => openForm(mergeForm()))]), button("Delete", remove));
  const panel = make("div", { class: "panel selection", role: "group", "aria-label": `Selected ${word}s`, hidden: true }, actions, place);
  bar.append(start);
  bar.after(panel);

  const isOn = () => list.classList.contains("selecting");

  function showState() {
    for (const card of [...chosen]) if (!card.isConnected) chosen.delete(card);
    say(status, `${count(chosen.size, word)} selected`);
    for (const one of actions.querySelectorAll("button")) {
      one.disabled = !chosen.size && !["All shown", "None"].includes(one.textContent);
    }
    for (const card of list.children) {
      const is = chosen.has(card);
      card.classList.toggle("chosen", is);
      const box = card.querySelector(".pick");
      if (box) box.checked = is;
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
    const from = withRange && last?.isConnected ? cards.indexOf(last) : cards.indexOf(card);
    const to = cards.indexOf(card);
    for (const one of cards.slice(Math.min(from, to), Math.max(from, to) + 1)) {
      if (!one.item) continue;
      if (on) chosen.add(one);
      else chosen.delete(one);
    }
    last = card;
    showState();
  }

  // Boxes for what has come since, too: the list has no end.
  function addBoxes() {
    if (!isOn()) return;
    for (const card of list.children) {
      if (!card.item || card.querySelector(".pick")) continue;
      const box = make("input", { type: "checkbox", class: "pick" });
      card.append(make("label", { class: "pick-label" }, box, make("span", { text: "Select" }),
                       make("span", { class: "hidden-text", text: ` ${card.item.label}` })));
    }
    showState();
  }
  new MutationObserver(addBoxes).observe(list, { childList: true });

  function turn(on) {
    list.classList.toggle("selecting", on);
    start.textContent = on ? "Done" : kStart;
    panel.hidden = !on;
    place.replaceChildren();
    chosen.clear();
    if (on) addBoxes();
    else for (const one of list.querySelectorAll(".pick-label")) one.remove();
    showState();
  }
  start.addEventListener("click", () => turn(!isOn()));

  list.addEventListener("click", (event) => {
    const card = event.target.closest(".card");
    if (!isOn() || !card?.item || !event.target.closest("a, .pick")) return;
    if (event.target.closest("a")) event.preventDefault();  // where the picture itself is pressed
    toggle(card, event.shiftKey);
  });

  // --- what is done to them

  function remove() {
    const cards = [...chosen];
    const paths = cards.map((card) => card.item.path);
    for (const card of cards) card.remove();
    deleteLater({
      paths, text: `Deleted: ${count(cards.length, word)}.`,
      done() { refreshHeader(); },
      restore(error, left) {
        if (error) notify(`${count(left.length, word)} could not be deleted. ${error.message}`, true);
        refresh();
      },
    });
    turn(false);
    start.focus();
  }

  // A form below the buttons. save() throws what is wrong, and gives the words for when it is done.
  function openForm({ title, fields, note, save }) {
    const problem = make("p", { role: "status" });
    const submit = make("button", { type: "submit", class: "primary small", text: "Save" });
    const form = make("form", { class: "edit", "aria-label": title }, ...fields, note ? make("p", { class: "quiet", text: note }) : null, problem,
                      make("div", { class: "row" }, submit, button("Cancel", () => place.replaceChildren())));
    form.addEventListener("keydown", (event) => { if (event.key === "Escape") place.replaceChildren(); });
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      submit.disabled = true;
      say(problem, "Saving…");
      try {
        const done = await save((n, of) => say(problem, `${n} of ${of}…`));
        turn(false);
        start.focus();  // before the list comes: what somebody has begun by then keeps the keyboard
        refreshHeader();
        await refresh();
        notify(done);
      } catch (error) {
        say(problem, error.message, true);
        submit.disabled = false;
      }
    });
    place.replaceChildren(form);
    form.querySelector("input").focus();
    offerObjectNames();
  }

  // The same change to every picture that is selected; those that cannot be changed stay selected.
  async function changeAll(changes, progress) {
    const cards = [...chosen];
    let done = 0;
    const failed = await eachOf(cards, async (card) => {
      await api.patch(card.item.path, changes);
      chosen.delete(card);
      progress(++done, cards.length);
    });
    showState();
    if (failed.length) throw new Error(`${count(failed.length, word)} could not be changed. ${failed[0].error.message}`);
    return cards.length;
  }

  const nameField = (label) => {
    const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", list: "object-names" });
    return [make("label", { text: label }, input), input];
  };

  function nameForm() {
    const [field, input] = nameField("They show");
    return { title: "Name the selected pictures", fields: [field], note: "They move to the object of that name.", async save(progress) {
      const object = input.value.trim();
      if (object) await settle(api.objectPath(object));
      const n = await changeAll({ object }, progress);
      return object ? `${count(n, word)} moved to ${object}.` : `${count(n, word)} without a name now.`;
    } };
  }

  function labelForm() {
    const input = make("input", { type: "text", autocomplete: "off", placeholder: "shelf=4, colour=red" });
    return { title: "Label the selected pictures", fields: [make("label", { text: "Labels to add" }, input)], note: "Other labels stay. An empty value (shelf=) takes a label off.", async save(progress) {
      const labels = parseLabels(input.value);
      if (!labels) throw new Error("Write at least one label: name=value.");
      for (const [name, value] of Object.entries(labels)) if (value === "") labels[name] = null;
      return `${count(await changeAll({ metadata: labels }, progress), word)} labelled.`;
    } };
  }

  function mergeForm() {
    const [field, input] = nameField("Name of the one object");
    input.value = [...chosen][0]?.item.object ?? "";
    return { title: "Make one object of the selected ones", fields: [field], note: "There is no undo for this.", async save(progress) {
      const object = input.value.trim();
      if (!object) throw new Error("An object needs a name.");
      await settle(api.objectPath(object));
      const cards = [...chosen].filter((card) => card.item.object !== object);
      let done = 0;
      for (const card of cards) {  // one after the other: they all become the same
        await api.patch(`${card.item.path}?merge=true`, { object });
        chosen.delete(card);
        progress(++done, cards.length);
      }
      return `${count(cards.length, "object")} became ${object}.`;
    } };
  }

  return { end: () => { if (isOn()) turn(false); } };
}
