// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Deleting and renaming with undo, and notices. A deleted item disappears at once; the server is told when the time for "Undo" is
// over, or when the page is left.
import { deletePath, keyHeaders } from "./api.js";
import { byId, eachOf, make, makeButton } from "./dom.js";
import { showCurrent } from "./router.js";
import { t } from "./texts.js";

const kUndoMs = 8000;
const kTickMs = 200;
const kMayMoveMs = 1000;
const kLongestMs = 60_000;  // also while the pointer rests on the notice

const pending = new Map();  // path -> commit()

export const isLeaving = (path) => pending.has(path);

// Before something takes the place of a deleted item: deletes that item now, so that the new one stays.
export const settle = async (path) => { await pending.get(path)?.(); };

// paths: for DELETE. restore(error, some): called on undo with null and all paths, and after a failure with the reason
// and the remaining paths.
export function deleteLater({ paths, text, restore }) {
  const bar = make("progress", { max: kUndoMs, value: kUndoMs, "aria-label": t`Time left to undo` });
  const undo = makeButton(t`Undo`, () => { finish(); restore(null, paths); });
  const notice = make("div", { class: "notice" }, make("p", { text }), make("div", { class: "row" }, undo, bar));
  let left = kUndoMs;
  const born = Date.now();
  const finish = () => {
    clearInterval(timer);
    for (const path of paths) pending.delete(path);
    const hadFocus = notice.contains(document.activeElement);
    notice.remove();
    if (hadFocus) byId("main").focus();
  };
  let going = null;
  const commit = () => (going ??= remove());
  const remove = async () => {
    clearInterval(timer);
    undo.disabled = true;
    const failed = await eachOf(paths, (path) => deletePath(path).catch((error) => {
      if (error.status !== 404) throw error;  // someone else deleted it
    }));
    finish();
    if (failed.length) restore(failed[0].error, failed.map(({ item }) => item));
  };
  const timer = setInterval(() => {
    const held = notice.matches(":hover") || notice.contains(document.activeElement);
    if (!held || Date.now() - born > kLongestMs) left -= kTickMs;
    bar.value = left;
    if (left <= 0) commit();
  }, kTickMs);
  for (const path of paths) pending.set(path, commit);
  byId("notices").append(notice);
}

// A message that closes by itself, unless it is an error. undo(): makes a change as it was; a button calls it.
export function notify(text, isError = false, undo = null) {
  const close = makeButton(t`Close`, () => notice.remove());
  const back = undo && makeButton(t`Undo`, async () => {
    notice.remove();
    byId("main").focus();
    await undo().catch((error) => notify(error.message, true));
    showCurrent();
  });
  const notice = make("div", { class: `notice${isError ? " error" : ""}` }, make("p", { text }), make("div", { class: "row" }, back ?? "", close));
  byId("notices").append(notice);
  if (isError) return;
  setTimeout(() => notice.remove(), kUndoMs);
  // It must not cover the next view; opening a view may be what it reports.
  setTimeout(() => addEventListener("hashchange", () => notice.remove(), { once: true }), kMayMoveMs);
}

// Leaving the page is not undo.
addEventListener("pagehide", () => {
  for (const path of pending.keys()) fetch(path, { method: "DELETE", keepalive: true, headers: keyHeaders() });
  pending.clear();
});
