// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The top of the page: the collection, and the key if the server needs one.
import * as api from "./api.js";
import { byId, make, onSubmit, say } from "./dom.js";
import { forgetQueries } from "./kept.js";
import { shownName } from "./names.js";
import { go, showCurrent } from "./router.js";
import { kWrongKey } from "./words.js";

const kChoices = { "collection-choice": "search", "add-collection": "add" };  // the view that each leads to
const dialog = byId("key-dialog");
let wanted = false;  // the server has asked for a key

// Called after everything that changes collections.
export async function refreshHeader() {
  const { collections } = await api.collections().catch(() => ({}));  // the view says what is wrong
  if (!collections) return;
  const here = api.collectionName();
  if (!collections.some(({ name }) => name === here)) collections.push({ name: here });  // an alias, or deleted
  for (const id of Object.keys(kChoices)) {
    byId(id).replaceChildren(...collections.map((one) => make("option", { value: one.name, text: shownName(one) })));
    byId(id).value = here;
    byId(id).closest("label").hidden = collections.length < 2;
  }
}

for (const [id, view] of Object.entries(kChoices)) byId(id).addEventListener("change", ({ target }) => go(view, { in: target.value }));

const showKeyState = () => { byId("key-button").hidden = !api.getKey() && !wanted; };

export function setKey(key, remember = api.isRemembered()) {
  const before = api.getKey();
  api.setKey(key, remember);
  if (!key || (before && before !== key)) forgetQueries().catch(() => {});
  showKeyState();
}

function openKeyDialog() {
  if (dialog.open) return;
  byId("key-input").value = api.getKey();
  byId("key-remember").checked = api.isRemembered();
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
  setKey("");
  dialog.close();
});
onSubmit(byId("key-form"), async () => {
  setKey(byId("key-input").value.trim(), byId("key-remember").checked);
  try {
    await api.refreshScope();
  } catch (error) {  // the dialog stays
    say(byId("key-problem"), error.message, true);
    byId("key-input").select();
    return;
  }
  dialog.close();
  refreshHeader();
  showCurrent();
});

// A link for a colleague has the key behind the #, which no server sees. The key leaves the address at once.
function takeKeyOfAddress() {
  const [path, query] = location.hash.split("?");
  const { key, ...rest } = Object.fromEntries(new URLSearchParams(query));
  if (!key) return false;
  history.replaceState(history.state, "", [path, String(new URLSearchParams(rest))].filter(Boolean).join("?"));
  setKey(key, false);
  return true;
}
addEventListener("hashchange", () => { if (takeKeyOfAddress()) location.reload(); });
takeKeyOfAddress();
showKeyState();
