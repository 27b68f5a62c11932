// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keys, for admins: created, shown once, revoked.
import * as api from "./api.js";
import { askingButton, attempt, byId, copyText, make, makeButton, onSubmit, say, shortTime } from "./dom.js";
import { setKey } from "./header.js";
import { link } from "./router.js";
import { t } from "./texts.js";

const tell = (...what) => say(byId("keys-status"), ...what);
let isFirst = false;  // the server has no keys and answers everyone

function showNew(made) {
  const text = make("input", { type: "text", readonly: true, value: made.key, "aria-label": t`The new key`, spellcheck: "false" });
  const copied = make("span", { role: "status" });
  const copier = (words, what) => makeButton(words, async () => {
    const done = await copyText(what);
    text.value = what;
    if (!done) text.select();
    say(copied, done ? t`Copied.` : t`Press Ctrl+C to copy.`);
  });
  const address = new URL(link("search", { key: made.key }), location.href).href;
  const code = make("img", { class: "key-code", alt: t`QR code of the link with the key`,
                             onerror: ({ error }) => code.replaceWith(make("p", { class: "error", text: error?.message ?? t`The QR code is missing.` })) });
  api.showBlob(code, () => api.qrBlob(address));
  byId("keys-new").replaceChildren(
    make("p", {}, make("strong", { text: t`Key "${made.name}" created.` }), " ", t`Copy this key now. It will not be shown again.`),
    make("div", { class: "row key-row" }, text, copier(t`Copy`, made.key), copier(t`Copy a link with the key`, address), copied),
    make("p", { class: "quiet", text: t`The link opens this page with the key. A phone can scan it. Give it only to the person who needs the key.` }), code,
    ...(isFirst ? [make("p", { text: t`The server now requires a key. This tab uses the new key.` })] : []));
  byId("keys-new").hidden = false;
  text.focus();
  text.select();
}

onSubmit(byId("keys-form"), async () => {
  const name = byId("keys-name").value.trim();
  if (!name) {
    tell(t`Enter a name for the key.`, true);
    byId("keys-name").focus();
    return;
  }
  await attempt(byId("keys-status"), async () => {
    const made = await api.askJson("v1/keys", "POST", { name, scope: byId("keys-scope").value });
    tell("");
    byId("keys-name").value = "";
    if (isFirst) {
      setKey(made.key);
      await api.refreshScope();
    }
    showNew(made);
  });
  refresh();
});

async function revoke(key) {
  const failure = await api.deletePath(`v1/keys/${encodeURIComponent(key.id)}`).then(() => null, (error) => error.message);
  await refresh();  // the list first, then the words
  tell(failure ?? t`Key "${key.name}" revoked.`, Boolean(failure));
  byId("keys-title").focus();
}

function row(key, mine) {
  const state = key.revoked_at ? [t`revoked ${shortTime(key.revoked_at)}`] : [...(key.id === mine ? [t`used by this tab`, " "] : []), askingButton(
    t`Revoke`, t`Revoke the key ${key.name}`, { question: t`The key will stop working at once.`, yes: t`Revoke`, act: () => revoke(key) })];
  return make("tr", { class: key.revoked_at ? "gone" : "" }, make("th", { scope: "row", text: key.name }), make("td", { text: key.scope }),
              make("td", {}, make("code", { text: key.id })), make("td", { text: shortTime(key.created_at) }), make("td", {}, ...state));
}

async function refresh() {
  const done = await attempt(byId("keys-status"), async () => {
    const [{ keys }, me] = await Promise.all([api.ask("v1/keys"), api.ask("v1/me")]);
    isFirst = !me.keys_required;
    if (isFirst) byId("keys-scope").value = "admin";
    for (const option of byId("keys-scope").options) option.disabled = isFirst && option.value !== "admin";
    byId("keys-none").hidden = !isFirst;
    byId("keys-table").hidden = !keys.length;
    byId("keys-list").replaceChildren(...keys.map((key) => row(key, me.key?.id)));
  }, show);
  if (!done) byId("keys-list").replaceChildren();
}

export function show() {
  tell("");
  byId("keys-loopback").hidden = !/^(localhost|127\..*|\[::1\])$/.test(location.hostname);
  return refresh();
}

export function hide() {
  byId("keys-list").replaceChildren();  // on return, nobody must press what is about to be drawn again
  byId("keys-new").replaceChildren();   // it is shown once
  byId("keys-new").hidden = true;
}
