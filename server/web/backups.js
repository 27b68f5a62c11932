// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups of the database, for admins: created, downloaded, deleted.
import * as api from "./api.js";
import { askFirst, attempt, byId, fileSize, make, say, shortTime, smallButton } from "./dom.js";

const pathOf = ({ name }, what = "") => `/v1/backups/${encodeURIComponent(name)}${what}`;
const tell = (text) => say(byId("backups-said"), text);

let shown = "";       // what is listed; buttons keep the focus while nothing changes
let awaited = false;  // a backup has started here and is not listed yet

async function remove(backup) {
  await attempt(byId("backups-said"), async () => {
    await api.deletePath(pathOf(backup));
    tell(`Backup ${backup.name} deleted.`);
  });
  shown = "";
  byId("backups").replaceChildren();
  await refreshBackups();
  byId("backups-title").focus();
}

function item(backup) {
  const note = make("span", { class: "quiet", role: "status" });
  const ask = ({ target }) => askFirst(target, {
    label: `Delete ${backup.name}?`, question: "This cannot be undone.", yes: "Delete", act: () => remove(backup) });
  return make("li", {}, make("strong", { text: backup.name }),
    make("span", { class: "quiet", text: `${fileSize(backup.bytes)}, ${shortTime(backup.created_at)}` }),
    api.downloadLink(pathOf(backup, "/content"), backup.name, note, { class: "button small", "aria-label": `Download the backup ${backup.name}` }),
    smallButton("Delete", ask, { class: "small", "aria-label": `Delete the backup ${backup.name}` }), note);
}

export async function refreshBackups() {
  if (!api.isAdmin()) return;
  const { backups } = await api.ask("/v1/backups").catch((error) => {
    if (error.code !== "backups_off") throw error;
    return { backups: null };
  });
  const text = JSON.stringify(backups);
  if (text === shown || byId("backups").querySelector("[role=group]")) return;  // an open question stays
  if (awaited && backups?.length > JSON.parse(shown || "[]").length) {
    awaited = false;
    tell("The backup is complete.");
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
  byId("backups").replaceChildren();
  tell("");
}

// onStart() is called when a backup has started.
export const whenBackupStarts = (onStart) => byId("backup-make").addEventListener("click", async () => {
  await attempt(byId("backups-said"), async () => {
    await api.askJson("/v1/backups", "POST", {});
    awaited = true;
    tell("The backup has started. It is listed here when it is complete.");
  });
  onStart();
});
