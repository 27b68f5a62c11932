// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The view where pictures are added: many at once, each with its object's name.
import * as api from "./api.js";
import { readable } from "./convert.js";
import { byId, count, say } from "./dom.js";
import { renameOffer } from "./edit.js";
import { offerObjectNames } from "./filters.js";
import { refreshHeader } from "./header.js";
import { acceptDrops, acceptPastes, fileAt } from "./incoming.js";
import { parseLabels } from "./labels.js";
import { defaultName } from "./names.js";
import { isLeaving, notify, settle } from "./undo.js";
import { kDone, kFailed, kSending, kWaiting, makeItem, nameOf, setState } from "./upload_row.js";

const kAtOnce = 2;  // the server describes them one after the other anyway

let items = [];
let stopper = null;  // AbortController while uploads run

// --- the list

// The way to its folder from the one that was chosen; what lies directly in that one has its name.
function folderOf(file) {
  const [chosen, ...below] = (file.webkitRelativePath || "").split("/").slice(0, -1);
  return below.join("/") || chosen || "";
}

const commonName = () => byId("add-object").value.trim();

// found: [{ file, folder }]
function enqueue(found) {
  const pictures = found.filter(({ file }) => !file.name.startsWith("."));
  if (!pictures.length) return;
  const taken = items.map(nameOf);
  for (const { file, folder } of pictures) {
    const name = defaultName(file, folder || folderOf(file), taken);
    taken.push(name);
    items.push(makeItem(file, name, (gone) => {
      items = items.filter((item) => item !== gone);
      showTotal();
    }));
  }
  giveCommonName();
  byId("add-form").hidden = false;
  say(byId("add-status"), "");
  showTotal();
}

// One name for all, as it is typed; what was typed for one picture stays.
function giveCommonName() {
  for (const item of items) {
    if (!item.typed && item.state !== kDone && item.state !== kSending) {
      item.input.value = commonName() || item.proposed;
    }
  }
}
byId("add-object").addEventListener("input", giveCommonName);

// "24 pictures added", "1 of 4 pictures added, 2 were there already, 1 failed"
function countWords(beginning = () => "") {
  const of = (state) => items.filter((item) => item.state === state).length;
  const known = items.filter((item) => item.known).length;
  const added = beginning(of(kDone) - known) || `${count(of(kDone) - known, "picture")} added`;
  return [added, known ? `${known} ${known === 1 ? "was" : "were"} there already` : "",
          of(kFailed) ? `${of(kFailed)} failed` : ""].filter(Boolean).join(", ");
}

function showTotal() {
  const of = (state) => items.filter((item) => item.state === state).length;
  const over = of(kDone) + of(kFailed);
  const partly = items.filter((item) => item.state === kSending)
    .reduce((sum, item) => sum + (item.bar.position > 0 ? item.bar.position / 2 : 0), 0);
  byId("add-bar").max = items.length || 1;
  byId("add-bar").value = over + partly;
  byId("add-summary").textContent = countWords((added) => `${added} of ${count(items.length, "picture")} added`);
  byId("add-start").hidden = Boolean(stopper) || of(kWaiting) === 0;
  byId("add-start").textContent = `Add ${count(of(kWaiting), "picture")}`;
  byId("add-stop").hidden = !stopper;
  byId("add-retry").hidden = Boolean(stopper) || of(kFailed) === 0;
  byId("add-clear").hidden = Boolean(stopper);
  byId("add-next").hidden = Boolean(stopper) || of(kDone) === 0 || of(kWaiting) > 0;
  if (!items.length) byId("add-form").hidden = true;
}

// --- sending

// The picture is stored by another name than was typed.
function offerRename(item, id, labels, collection) {
  const object = wasNamed(item) ? nameOf(item) : "";
  const offer = renameOffer({
    id, collection, object, metadata: labels,
    done() {
      item.known = true;
      setState(item, kDone, object ? `is called ${object} now` : "has these labels now");
      showTotal();
      offerObjectNames();
    },
    failed(error) { setState(item, kFailed, error.message); },
  });
  item.note.append(" ", offer);
}

// Whether somebody has said what it is, rather than its file's name.
const wasNamed = (item) => item.typed || Boolean(commonName());

// Uploads it. What was deleted a moment ago, the object or the very picture, does not take it along.
async function upload(item, given, { collection, ...more }) {
  const file = item.file.address ? item.file : await readable(item.file);
  await settle(api.objectPath(given.object, collection));
  const add = () => api.addPicture({ file, collection, ...given }, more);
  const leaving = (id) => id && isLeaving(api.imagePath(id, "", collection));
  try {
    const answer = await add();
    if (answer.created || !leaving(answer.image.id)) return answer;
    await settle(api.imagePath(answer.image.id, "", collection));
  } catch (error) {
    if (!leaving(error.imageId)) throw error;
    await settle(api.imagePath(error.imageId, "", collection));
  }
  return add();
}

async function send(item, labels, collection) {
  const object = nameOf(item);
  setState(item, kSending, "sending…");
  try {
    const { created, image } = await upload(
      item, { object, metadata: labels }, {
        collection,
        signal: stopper.signal,
        onProgress: (share) => {
          item.bar.value = Math.min(share, 0.99);
          item.note.textContent = share < 1 ? `sending, ${Math.round(100 * share)} %` : "looking at it…";
          if (share >= 1) item.bar.removeAttribute("value");  // it moves until the answer comes
          showTotal();
        },
        onWait: (seconds) => { item.note.textContent = `the server is busy; again in ${seconds} s`; },
      });
    item.known = !created;
    setState(item, kDone, created ? `added: ${count(image.keypoints, "key point")}` : "was there already");
  } catch (error) {
    if (error.name === "AbortError") setState(item, kWaiting, "stopped");
    else if (error.code === "same_bytes" && !wasNamed(item) && !labels) {
      item.known = true;
      setState(item, kDone, "was there already, by another name");
    } else {
      setState(item, kFailed, error.message);
      if (error.code === "same_bytes" && error.imageId) offerRename(item, error.imageId, labels, collection);
    }
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
  const queue = items.filter((item) => item.state === kWaiting);
  stopper = new AbortController();
  const { signal } = stopper;
  const collection = api.collectionName();  // the choice above may change meanwhile
  showTotal();
  say(byId("add-status"), `Adding ${count(queue.length, "picture")}…`);
  byId("add-stop").focus();
  const worker = async () => {
    for (let item; !signal.aborted && (item = queue.shift());) await send(item, labels, collection);
  };
  await Promise.all(Array.from({ length: kAtOnce }, worker));
  const stopped = signal.aborted;
  stopper = null;
  showTotal();
  const failed = items.filter((item) => item.state === kFailed);
  say(byId("add-status"), `${stopped ? "Stopped" : "Finished"}: ${countWords()}.` +
    (failed.length ? " The reasons stand beside them." : ""), failed.length > 0);
  (byId("add-stop").contains(document.activeElement) || document.activeElement === document.body) &&
    byId(failed.length ? "add-retry" : byId("add-next").hidden ? "add-clear" : "add-next").focus();
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
function enqueueReceived({ files, stored, address, problem }) {
  if (stored) notify("This picture is in a collection already.", true);
  else if (problem) notify(problem, true);
  else enqueue(address ? [{ file: fileAt(address), folder: "" }] : files);
}
acceptDrops(byId("view-add"), enqueueReceived);
acceptPastes(byId("view-add"), enqueueReceived);
addEventListener("beforeunload", (event) => { if (stopper) event.preventDefault(); });

export const addView = {
  title: "Add pictures",
  show(parameters) {
    if (parameters.has("object")) byId("add-object").value = parameters.get("object");
    offerObjectNames();
  },
};
