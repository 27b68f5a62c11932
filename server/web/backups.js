// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Copies of the database, for those who may do everything: made, downloaded, deleted.
import * as api from "./api.js";
import { byId, fileSize, make, say, shortTime } from "./dom.js";
import { isAdmin } from "./me.js";

const kMostInBrowser = 2e9;  // bytes: what is asked for with a key passes through the browser's store

const contentPath = ({ name }) => `/v1/backups/${encodeURIComponent(name)}/content`;

let shown = "";       // what is listed, so that a button keeps the focus while nothing changes
let awaited = false;  // a backup has begun here, and is not listed yet
let loading = null;   // AbortController of the download on its way

// --- downloads

function save(blob, name) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

// A link cannot show a key, so the page asks for the file and gives it to the browser.
async function download(backup, note, button) {
  if (backup.bytes > kMostInBrowser) {
    say(note, `It is too large for a browser. By hand: curl -H "Authorization: Bearer $KEY" -O ${location.origin}${contentPath(backup)}`);
    return;
  }
  if (loading) {
    loading.abort();
    return;
  }
  loading = new AbortController();
  button.textContent = "Stop";
  try {
    const parts = await api.pieces(contentPath(backup), loading.signal, (bytes) => {
      say(note, `${Math.floor((100 * bytes) / backup.bytes)} % of ${fileSize(backup.bytes)}`);
    });
    save(new Blob(parts, { type: "application/octet-stream" }), backup.name);
    say(note, "It is with your downloads.");
  } catch (error) {
    say(note, error.name === "AbortError" ? "Stopped." : error.message, error.name !== "AbortError");
  } finally {
    loading = null;
    button.textContent = "Download";
  }
}

function downloadOf(backup, note) {
  const label = `Download the backup ${backup.name}`;
  if (!api.getKey()) {
    return make("a", { class: "button small", href: contentPath(backup), download: backup.name, text: "Download", "aria-label": label });
  }
  const button = make("button", { type: "button", class: "small", text: "Download", "aria-label": label });
  button.addEventListener("click", () => download(backup, note, button));
  return button;
}

// --- the list

// It is gone for good, so this asks.
function askBeforeDeleting(button, backup) {
  const sure = make("button", { type: "button", class: "small danger", text: "Yes, delete it" });
  const no = make("button", { type: "button", class: "small", text: "Keep it" });
  const question = make("span", { class: "row", role: "group", "aria-label": `Delete ${backup.name}?` },
                        make("span", { text: "For good?" }), no, sure);
  button.replaceWith(question);
  no.focus();
  no.addEventListener("click", () => { question.replaceWith(button); button.focus(); });
  sure.addEventListener("click", async () => {
    try {
      await api.deletePath(`/v1/backups/${encodeURIComponent(backup.name)}`);
      say(byId("backups-said"), `The backup ${backup.name} is deleted.`);
    } catch (error) {
      say(byId("backups-said"), error.message, true);
    }
    question.replaceWith(button);
    shown = "";
    await refreshBackups();
    byId("backups-title").focus();
  });
}

function item(backup) {
  const note = make("span", { class: "quiet", role: "status" });
  const remove = make("button", { type: "button", class: "small", text: "Delete", "aria-label": `Delete the backup ${backup.name}`,
                                  onclick: (event) => askBeforeDeleting(event.target, backup) });
  return make("li", {}, make("strong", { text: backup.name }),
              make("span", { class: "quiet", text: `${fileSize(backup.bytes)}, ${shortTime(backup.created_at)}` }),
              downloadOf(backup, note), remove, note);
}

// What is there now. Those who may not see them have no such list.
export async function refreshBackups() {
  if (!isAdmin()) return;
  let backups = [];
  try {
    ({ backups } = await api.ask("/v1/backups"));
  } catch (error) {
    if (error.code !== "backups_off") throw error;
    backups = null;
  }
  const text = JSON.stringify([backups, Boolean(api.getKey())]);
  if (text === shown || loading) return;
  if (byId("backups").querySelector("[role=group]")) return;  // somebody is being asked
  if (awaited && backups?.length > JSON.parse(shown || "[[]]")[0]?.length) {
    awaited = false;
    say(byId("backups-said"), "The backup is complete.");
  }
  shown = text;
  byId("backups-off").hidden = Boolean(backups);
  byId("backups-on").hidden = !backups;
  byId("backups").replaceChildren(...(backups ?? []).map(item));
  if (backups && !backups.length) byId("backups").append(make("li", { class: "quiet", text: "None yet." }));
}

export function forgetBackups() {
  shown = "";
  awaited = false;
  loading?.abort();
  byId("backups").replaceChildren();
  say(byId("backups-said"), "");
}

// onStart() is called when a backup has begun.
export function whenBackupStarts(onStart) {
  byId("backup-make").addEventListener("click", async () => {
    try {
      await api.askJson("/v1/backups", "POST", {});
      awaited = true;
      say(byId("backups-said"), "The backup has begun. It is listed here when it is complete.");
    } catch (error) {
      say(byId("backups-said"), error.message, true);
    }
    onStart();
  });
}
