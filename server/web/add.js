// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The view where pictures are added: many at once, each with its object's name.
import * as api from "./api.js";
import { acceptDrops, byId, count, fileSize, make, say, shorten } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { refreshHeader } from "./header.js";
import { parseLabels } from "./labels.js";

const kAtOnce = 2;  // the server describes them one after the other anyway

const kWaiting = "waiting", kSending = "sending", kDone = "done", kFailed = "failed";

let items = [];
let stopper = null;  // AbortController while uploads run

// --- the list

function folderOf(file) {
  const parts = (file.webkitRelativePath || "").split("/");
  return parts.length > 2 ? parts[parts.length - 2] : parts.length === 2 ? parts[0] : "";
}

// found: [{ file, folder }]
function enqueue(found) {
  const pictures = found.filter(({ file }) => !file.name.startsWith("."));
  if (!pictures.length) return;
  for (const { file, folder } of pictures) items.push(makeItem(file, folder || folderOf(file)));
  byId("add-form").hidden = false;
  say(byId("add-status"), "");
  showTotal();
}

function makeItem(file, folder) {
  const name = make("input", { type: "text", maxlength: 200, autocomplete: "off", value: folder,
                               placeholder: "as above", list: "object-names",
                               "aria-label": `Object that ${file.name} shows` });
  const bar = make("progress", { max: 1, value: 0, "aria-label": `Progress of ${file.name}` });
  const note = make("span", { class: "note", text: fileSize(file.size) });
  const remove = make("button", { type: "button", class: "small", text: "Remove",
                                  "aria-label": `Remove ${file.name} from the list` });
  const row = make("li", {}, make("span", { class: "file-name", text: shorten(file.name), title: file.name }),
                   name, bar, note, remove);
  const item = { file, name, bar, note, remove, row, state: kWaiting };
  remove.addEventListener("click", () => {
    const neighbour = row.nextElementSibling ?? row.previousElementSibling;
    items = items.filter((other) => other !== item);
    row.remove();
    (neighbour?.querySelector("button:not([hidden])") ?? byId("add-clear")).focus();
    showTotal();
  });
  byId("add-list").append(row);
  return item;
}

function setState(item, state, text) {
  item.state = state;
  item.row.dataset.state = state;
  say(item.note, text, state === kFailed);
  item.name.disabled = state === kSending || state === kDone;
  item.remove.hidden = state === kSending;
  if (state === kDone) item.bar.value = 1;
  if (state === kFailed || state === kWaiting) item.bar.value = 0;
}

function showTotal() {
  const of = (state) => items.filter((item) => item.state === state).length;
  const over = of(kDone) + of(kFailed);
  const partly = items.filter((item) => item.state === kSending)
    .reduce((sum, item) => sum + (item.bar.position > 0 ? item.bar.position / 2 : 0), 0);
  byId("add-bar").max = items.length || 1;
  byId("add-bar").value = over + partly;
  const failed = of(kFailed) ? `, ${of(kFailed)} failed` : "";
  byId("add-summary").textContent =
    `${of(kDone)} of ${count(items.length, "picture")} added${failed}`;
  byId("add-start").hidden = Boolean(stopper) || of(kWaiting) === 0;
  byId("add-start").textContent = `Add ${count(of(kWaiting), "picture")}`;
  byId("add-stop").hidden = !stopper;
  byId("add-retry").hidden = Boolean(stopper) || of(kFailed) === 0;
  byId("add-clear").hidden = Boolean(stopper);
  if (!items.length) byId("add-form").hidden = true;
}

// --- sending

async function send(item, common) {
  const object = item.name.value.trim() || common.object;
  item.name.value = object;
  setState(item, kSending, "sending…");
  try {
    const { created, image } = await api.addPicture(
      { file: item.file, object, metadata: common.labels }, {
        signal: stopper.signal,
        onProgress: (share) => {
          item.bar.value = Math.min(share, 0.99);
          item.note.textContent = share < 1 ? `sending, ${Math.round(100 * share)} %` : "looking at it…";
          if (share >= 1) item.bar.removeAttribute("value");  // it moves until the answer comes
          showTotal();
        },
        onWait: (seconds) => { item.note.textContent = `the server is busy; again in ${seconds} s`; },
      });
    setState(item, kDone, created ? `added: ${count(image.keypoints, "key point")}` : "was there already");
  } catch (error) {
    if (error.name === "AbortError") setState(item, kWaiting, "stopped");
    else setState(item, kFailed, error.message);
    if (error.status === 401 || error.status === 403) stopper.abort();  // all would fail alike
  }
  showTotal();
}

async function sendAll() {
  let labels = null;
  try {
    labels = parseLabels(byId("add-labels").value);
  } catch (error) {
    say(byId("add-status"), error.message, true);
    byId("add-labels").focus();
    return;
  }
  const common = { object: byId("add-object").value.trim(), labels };
  const queue = items.filter((item) => item.state === kWaiting);
  stopper = new AbortController();
  const { signal } = stopper;
  showTotal();
  say(byId("add-status"), `Adding ${count(queue.length, "picture")}…`);
  byId("add-stop").focus();
  const worker = async () => {
    for (let item; !signal.aborted && (item = queue.shift());) await send(item, common);
  };
  await Promise.all(Array.from({ length: kAtOnce }, worker));
  const stopped = signal.aborted;
  stopper = null;
  showTotal();
  const failed = items.filter((item) => item.state === kFailed);
  const done = items.filter((item) => item.state === kDone).length;
  say(byId("add-status"), `${stopped ? "Stopped" : "Finished"}: ${count(done, "picture")} added` +
    (failed.length ? `, ${failed.length} failed. The reasons stand beside them.` : "."), failed.length > 0);
  (byId("add-stop").contains(document.activeElement) || document.activeElement === document.body) &&
    byId(failed.length ? "add-retry" : "add-clear").focus();
  refreshHeader();
  offerObjectNames();
}

byId("add-form").addEventListener("submit", (event) => {
  event.preventDefault();
  if (!stopper && items.some((item) => item.state === kWaiting)) sendAll();
});
byId("add-stop").addEventListener("click", () => stopper?.abort());
byId("add-retry").addEventListener("click", () => {
  for (const item of items) if (item.state === kFailed) setState(item, kWaiting, "");
  sendAll();
});
byId("add-clear").addEventListener("click", () => {
  items = [];
  byId("add-list").replaceChildren();
  showTotal();
  byId("add-title").focus();
});

// --- ways in

for (const id of ["add-files", "add-folder", "add-camera"]) {
  byId(id).addEventListener("change", (event) => {
    enqueue([...event.target.files].map((file) => ({ file, folder: "" })));
    event.target.value = "";
  });
}
acceptDrops(byId("view-add"), enqueue);
document.addEventListener("paste", (event) => {
  if (byId("view-add").hidden) return;
  enqueue([...event.clipboardData.files].map((file) => ({ file, folder: "" })));
});
addEventListener("beforeunload", (event) => { if (stopper) event.preventDefault(); });

export const addView = { title: "Add pictures", show() { offerObjectNames(); } };
