// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The top of the page: which collection, and the key where the server wants one.
import * as api from "./api.js";
import { byId, count, make, say } from "./dom.js";
import { forgetQueries } from "./kept.js";
import { refreshMe } from "./me.js";
import { shownName } from "./names.js";
import { go, showCurrent } from "./router.js";
import { kWrongKey } from "./words.js";

const choice = byId("collection-choice");
const dialog = byId("key-dialog");

// Names and counts; called whenever something was added, deleted or made.
export async function refreshHeader() {
  let labels = [];
  try {
    ({ labels } = await api.collections());
  } catch {
    return;  // the view says what is wrong
  }
  const here = api.collectionName();
  if (!labels.some(({ name }) => name === here)) labels.push({ name: here });  // an alias, or gone
  choice.replaceChildren(...labels.map((label) => make("option", { value: label.name, text: shownName(label) })));
  choice.value = here;
  byId("collection-label").hidden = labels.length < 2;
}

choice.addEventListener("change", () => {
  api.setCollection(choice.value);
  go("search");
});

let wanted = false;  // the server has asked for a key

export function showKeyState() {
  byId("key-button").hidden = !api.getKey() && !wanted;
}

function openKeyDialog() {
  if (dialog.open) return;
  byId("key-input").value = api.getKey();
  say(byId("key-problem"), "");
  dialog.showModal();
}

document.addEventListener("pliant-key-wanted", () => {
  wanted = true;
  showKeyState();
  openKeyDialog();
  if (api.getKey()) say(byId("key-problem"), kWrongKey, true);
});
byId("key-button").addEventListener("click", openKeyDialog);
byId("key-cancel").addEventListener("click", () => dialog.close());
byId("key-forget").addEventListener("click", () => {
  api.setKey("");
  forgetQueries().catch(() => {});
  showKeyState();
  dialog.close();
});
byId("key-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const before = api.getKey();
  api.setKey(byId("key-input").value.trim());
  if (before && before !== api.getKey()) forgetQueries().catch(() => {});
  showKeyState();
  try {
    await refreshMe();
  } catch (error) {  // the dialog stays
    say(byId("key-problem"), error.message, true);
    byId("key-input").select();
    return;
  }
  dialog.close();
  refreshHeader();
  showCurrent();
});
showKeyState();

// "12 pictures of 8 objects"
export const collectionWords = ({ images, objects }) =>
  `${count(images, "picture")} of ${count(objects, "object")}`;
