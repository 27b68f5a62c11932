// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keys, for those who may do everything: who has one, a new one (shown once), and the end of one.
import * as api from "./api.js";
import { byId, make, say, shortTime } from "./dom.js";
import { showKeyState } from "./header.js";
import { refreshMe } from "./me.js";

const kScopes = { read: "search and look", write: "search, look, add, change and delete", admin: "everything" };

let isFirst = false;  // there is no key yet, and the server answers everybody

function showNew(made) {
  const text = make("input", { type: "text", readonly: true, value: made.key, "aria-label": "The new key", spellcheck: "false" });
  const copied = make("span", { role: "status" });
  const copy = make("button", { type: "button", text: "Copy", onclick: async () => {
    try {
      await navigator.clipboard.writeText(made.key);
      say(copied, "Copied.");
    } catch {  // not allowed without https, for example
      text.select();
      say(copied, "Press Ctrl+C to copy it.");
    }
  } });
  byId("keys-new").replaceChildren(
    make("p", {}, make("strong", { text: `The key "${made.name}". ` }), "It is shown only now: the server keeps no key, only what it takes to know it again."),
    make("div", { class: "row key-row" }, text, copy, copied),
    ...(isFirst ? [make("p", { text: "From now on this server answers nobody without a key. This tab uses the new one." })] : []));
  byId("keys-new").hidden = false;
  text.focus();
  text.select();
}

byId("keys-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const status = byId("keys-status");
  const name = byId("keys-name").value.trim();
  if (!name) {
    say(status, "A key needs a name: what it is for, or whose it is.", true);
    byId("keys-name").focus();
    return;
  }
  try {
    const made = await api.askJson("/v1/keys", "POST", { name, scope: byId("keys-scope").value });
    say(status, "");
    byId("keys-name").value = "";
    if (isFirst) {
      api.setKey(made.key);
      showKeyState();
      await refreshMe();
    }
    showNew(made);
  } catch (error) {
    say(status, error.message, true);
  }
  refresh();
});

// What is revoked works for nobody from then on, so this asks.
function askBeforeRevoking(button, key) {
  const sure = make("button", { type: "button", class: "small danger", text: "Yes, revoke it" });
  const no = make("button", { type: "button", class: "small", text: "Keep it" });
  const question = make("span", { class: "row", role: "group", "aria-label": `Revoke ${key.name}?` },
                        make("span", { text: "Whoever uses it is refused from then on." }), no, sure);
  button.replaceWith(question);
  no.focus();
  no.addEventListener("click", () => { question.replaceWith(button); button.focus(); });
  sure.addEventListener("click", async () => {
    let failure = null;
    try {
      await api.deletePath(`/v1/keys/${encodeURIComponent(key.id)}`);
    } catch (error) {
      failure = error.message;
    }
    await refresh();  // first: what is said is seen in the list
    say(byId("keys-status"), failure ?? `The key "${key.name}" is revoked.`, Boolean(failure));
    byId("keys-title").focus();
  });
}

function row(key, mine) {
  const last = make("td");
  if (key.revoked_at) last.append(`revoked ${shortTime(key.revoked_at)}`);
  else if (key.id === mine) last.append("this tab's");
  if (!key.revoked_at) {
    last.append(" ", make("button", { type: "button", class: "small", text: "Revoke", "aria-label": `Revoke the key ${key.name}`,
                                      onclick: (event) => askBeforeRevoking(event.target, key) }));
  }
  return make("tr", { class: key.revoked_at ? "gone" : "" }, make("th", { scope: "row", text: key.name }), make("td", { text: kScopes[key.scope] ?? key.scope }),
              make("td", {}, make("code", { text: key.id })), make("td", { text: shortTime(key.created_at) }), last);
}

async function refresh() {
  try {
    const [{ keys }, me] = await Promise.all([api.ask("/v1/keys"), api.ask("/v1/me")]);
    isFirst = !me.keys_required;
    byId("keys-scope").value = isFirst ? "admin" : byId("keys-scope").value;
    for (const option of byId("keys-scope").options) option.disabled = isFirst && option.value !== "admin";
    byId("keys-none").hidden = !isFirst;
    byId("keys-table").hidden = !keys.length;
    byId("keys-list").replaceChildren(...keys.map((key) => row(key, me.key?.id)));
  } catch (error) {
    byId("keys-list").replaceChildren();
    say(byId("keys-status"), error.message, true);
  }
}

export const keysView = {
  title: "Keys",
  show() {
    say(byId("keys-status"), "");
    return refresh();
  },
  hide() {
    byId("keys-list").replaceChildren();  // who comes back must not press what is about to be drawn anew
    byId("keys-new").replaceChildren();  // it was shown once
    byId("keys-new").hidden = true;
  },
};
