// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Deleting with time to think: what is deleted disappears at once, but the server is told only when
// the notice with "Undo" has run out, or when the page is left.
import { deletePath, getKey } from "./api.js";
import { byId, eachOf, make } from "./dom.js";

const kUndoMs = 8000;
const kTickMs = 200;
const kMayMoveMs = 1000;
const kLongestMs = 60_000;  // also while the pointer rests on the notice

const pending = new Map();  // path -> what is to be deleted

// Whether the picture is on its way out, by itself or with its object.
export const isLeaving = (path) => pending.has(path);

// Before something else takes that place: what is on its way out goes now, so that the newcomer does not
// go with it. Where it cannot be deleted, it is back.
export const settle = async (path) => { await pending.get(path)?.commit(); };

// paths: what DELETE is sent to. text: the notice. restore(error, some): called on undo with null and all
// paths, and when deleting failed with the reason and the paths that are still there. done: called when
// all are really gone.
export function deleteLater({ paths, text, restore, done }) {
  const bar = make("progress", { max: kUndoMs, value: kUndoMs, "aria-label": "Time left to undo" });
  const undo = make("button", { type: "button", text: "Undo" });
  const notice = make("div", { class: "notice" },
                      make("p", { text }), make("div", { class: "row" }, undo, bar));
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
    const failed = await eachOf(paths, async (path) => {
      try {
        await deletePath(path);
      } catch (error) {
        if (error.status !== 404) throw error;  // else somebody was faster
      }
    });
    finish();
    if (failed.length) restore(failed[0].error, failed.map(({ item }) => item));
    else done?.();
  };
  const timer = setInterval(() => {
    const held = notice.matches(":hover") || notice.contains(document.activeElement);
    if (!held || Date.now() - born > kLongestMs) left -= kTickMs;
    bar.value = left;
    if (left <= 0) commit();
  }, kTickMs);
  undo.addEventListener("click", () => {
    finish();
    restore(null, paths);
  });
  for (const path of paths) pending.set(path, { commit });
  byId("notices").append(notice);
}

// A message that goes by itself; for people who are not looking at the place where it happened.
export function notify(text, isError = false) {
  const close = make("button", { type: "button", text: "Close" });
  const notice = make("div", { class: `notice${isError ? " error" : ""}` }, make("p", { text }), close);
  close.addEventListener("click", () => notice.remove());
  byId("notices").append(notice);
  if (isError) return;
  setTimeout(() => notice.remove(), kUndoMs);
  // Nor does it lie over what one goes to next; going there may be what it tells of.
  setTimeout(() => addEventListener("hashchange", () => notice.remove(), { once: true }), kMayMoveMs);
}

// Leaving the page is no undo: what was deleted is deleted.
addEventListener("pagehide", () => {
  const headers = getKey() ? { Authorization: `Bearer ${getKey()}` } : {};
  for (const path of pending.keys()) fetch(path, { method: "DELETE", keepalive: true, headers });
  pending.clear();
});
