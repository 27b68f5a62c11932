// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The view for adding images: many at once, each with its object's name.
import * as api from "./api.js";
import { byId, count, eachOf, fileSize, make, onSubmit, say, shorten, smallButton } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { accept, fileAt, refuseOther } from "./incoming.js";
import { parseLabels } from "./labels.js";
import { defaultName, kLongestName } from "./names.js";
import { go, showing } from "./router.js";
import { isLeaving, notify, settle } from "./undo.js";

const kWaiting = "waiting", kSending = "sending", kDone = "done", kFailed = "failed";
const kAtOnce = 2;  // the server describes images one after the other anyway

// --- one image of the list: its preview, its object's name, its progress

// unseen(error) is called if there is no preview.
function thumbnailOf(file, unseen) {
  const image = make("img", { class: "upload-thumb", alt: "", decoding: "async" });
  image.addEventListener("error", ({ error }) => {
    image.replaceWith(make("span", { class: "upload-thumb" }));
    unseen(error);
  }, { once: true });
  api.showBlob(image, () => (file.address ? api.previewBlob(file.address) : file));
  return image;
}

// `name`: the object's default name.
function makeItem(file, name) {
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value: name, placeholder: "no name",
                                list: "object-names", "aria-label": `Object in ${file.name}`, oninput: () => { item.typed = true; } });
  const bar = make("progress", { max: 1, value: 0, "aria-label": `Progress of ${file.name}` });
  const note = make("span", { class: "note", text: file.address ? "from the web" : fileSize(file.size) });
  const remove = smallButton("Remove", () => {
    const neighbour = row.nextElementSibling ?? row.previousElementSibling;
    row.remove();
    (neighbour?.querySelector("button:not([hidden])") ?? byId("add-clear")).focus();
    items = items.filter((one) => one !== item);
    showTotal();
  }, { class: "small", "aria-label": `Remove ${file.name} from the list` });
  const thumbnail = thumbnailOf(file, (error) => {
    if (error && item.state === kWaiting) note.textContent = `from the web; no preview: ${error.message}`;
  });
  const row = make("li", {}, thumbnail, input, make("span", { class: "file-name quiet", text: shorten(file.name), title: file.name }), note, bar, remove);
  const item = { file, input, bar, note, remove, row, state: kWaiting, proposed: name, typed: false };
  row.dataset.state = kWaiting;
  byId("add-list").append(row);
  return item;
}

const nameOf = (item) => item.input.value.trim();

function setState(item, state, text) {
  item.state = item.row.dataset.state = state;
  say(item.note, text, state === kFailed);
  item.input.disabled = state === kSending || state === kDone;
  item.remove.hidden = state === kSending;
  if (state !== kSending) item.bar.value = state === kDone ? 1 : 0;
}

// --- the list

let items = [];
let stopper = null;  // AbortController while uploads run

const inState = (state) => items.filter((item) => item.state === state);

const commonName = () => byId("add-object").value.trim();

// found: [{ file, folder }]; leftOut: the number of files in system folders
function enqueue(found, leftOut = 0) {
  const taken = items.map(nameOf);
  for (const { file, folder } of found) {
    const name = defaultName(file, folder, taken);
    taken.push(name);
    items.push(makeItem(file, name));
  }
  giveCommonName();
  say(byId("add-status"), leftOut ? `${count(leftOut, "file")} of system folders left out.` : "");
  showTotal();
}

// While it is typed; a name that was typed for one image stays.
function giveCommonName() {
  for (const item of items) {
    if (!item.typed && item.state !== kDone && item.state !== kSending) item.input.value = commonName() || item.proposed;
  }
}
byId("add-object").addEventListener("input", giveCommonName);

// "24 images added", "1 of 4 images added, 2 already stored, 1 failed"
function countWords(of = "") {
  const known = items.filter((item) => item.known).length;
  const added = inState(kDone).length - known;
  const failed = inState(kFailed).length;
  return [of ? `${added} of ${of} added` : `${count(added, "image")} added`, known ? `${known} already stored` : "",
          failed ? `${failed} failed` : ""].filter(Boolean).join(", ");
}

function showTotal() {
  const [waiting, done, failed] = [kWaiting, kDone, kFailed].map((state) => inState(state).length);
  const partly = inState(kSending).reduce((sum, { bar }) => sum + Math.max(0, bar.position) / 2, 0);
  const running = Boolean(stopper);
  byId("add-form").hidden = !items.length;
  byId("add-bar").max = items.length || 1;
  byId("add-bar").value = done + failed + partly;
  byId("add-summary").textContent = countWords(count(items.length, "image"));
  byId("add-start").textContent = `Add ${count(waiting, "image")}`;
  byId("add-start").hidden = running || !waiting;
  byId("add-stop").hidden = !running;
  byId("add-retry").hidden = running || !failed;
  byId("add-clear").hidden = running;
  byId("add-collection").disabled = running;
  byId("add-next").hidden = running || !done || waiting > 0;
}

// --- sending

// Whether someone typed the name.
const wasNamed = (item) => item.typed || Boolean(commonName());

// The image is stored under another name than was typed: a button gives it that name.
function offerRename(item, id, metadata, collection) {
  const object = wasNamed(item) ? nameOf(item) : "";
  item.note.append(" ", smallButton(object ? `Rename to ${object}` : "Use these labels", async ({ target }) => {
    target.disabled = true;
    try {
      if (object) await settle(api.objectPath(object, collection));
      await api.patch(api.imagePath(id, "", collection), { ...(object && { object }), ...(metadata && { metadata }) });
      item.known = true;
      setState(item, kDone, object ? `renamed to ${object}` : "labels changed");
      showTotal();
      offerObjectNames();
    } catch (error) {
      setState(item, kFailed, error.message);
    }
  }));
}

// Uploads it. An object or image that is being deleted is deleted first, so that the new image stays.
async function upload(item, given, { collection, ...more }) {
  const { file } = item;
  if (!file.address) await refuseOther(file);
  await settle(api.objectPath(given.object, collection));
  const add = () => api.addImage({ file, collection, ...given }, more);
  const settled = async (id) => {
    const path = id && api.imagePath(id, "", collection);
    if (!path || !isLeaving(path)) return false;
    await settle(path);
    return true;
  };
  try {
    const answer = await add();
    if (answer.created || !await settled(answer.image.id)) return answer;
  } catch (error) {
    if (!await settled(error.imageId)) throw error;
  }
  return add();
}

async function send(item, labels, collection) {
  setState(item, kSending, "sending…");
  try {
    const { created, image } = await upload(item, { object: nameOf(item), metadata: labels }, {
      collection, signal: stopper.signal,
      onProgress: (share) => {
        item.bar.value = Math.min(share, 0.99);
        item.note.textContent = share < 1 ? `sending, ${Math.round(100 * share)} %` : "processing…";
        if (share >= 1) item.bar.removeAttribute("value");  // it moves until the answer comes
        showTotal();
      },
      onWait: (seconds) => { item.note.textContent = `the server is busy; retrying in ${seconds} s`; },
    });
    item.known = !created;
    setState(item, kDone, created ? `added: ${count(image.keypoints, "keypoint")}` : "already stored");
  } catch (error) {
    if (error.name === "AbortError") setState(item, kWaiting, "stopped");
    else if (error.code === "same_bytes" && !wasNamed(item) && !labels) {
      item.known = true;
      setState(item, kDone, "already stored under another name");
    } else {
      setState(item, kFailed, error.message);
      if (error.code === "same_bytes" && error.imageId) offerRename(item, error.imageId, labels, collection);
    }
    if (error.status === 401 || error.status === 403) stopper.abort();  // all others would fail too
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
  const queue = inState(kWaiting);
  stopper = new AbortController();
  const { signal } = stopper;
  const collection = api.collectionName();  // another one may be chosen meanwhile
  showTotal();
  const where = byId("add-collection-label").hidden ? "" : ` to the collection ${byId("add-collection").selectedOptions[0].text}`;
  say(byId("add-status"), `Adding ${count(queue.length, "image")}${where}…`);
  byId("add-stop").focus();
  await eachOf(queue, async (item) => { if (!signal.aborted) await send(item, labels, collection); }, kAtOnce);
  stopper = null;
  showTotal();
  const failed = inState(kFailed).length;
  say(byId("add-status"), `${signal.aborted ? "Stopped" : "Finished"}: ${countWords()}.${failed ? " See each image for the reason." : ""}`, failed > 0);
  if ([byId("add-stop"), document.body].includes(document.activeElement)) {
    byId(failed ? "add-retry" : byId("add-next").hidden ? "add-clear" : "add-next").focus();
  }
  offerObjectNames();
}

onSubmit(byId("add-form"), () => {
  if (!stopper && inState(kWaiting).length) sendAll();
});
byId("add-stop").addEventListener("click", () => stopper?.abort());
byId("add-retry").addEventListener("click", () => {
  for (const item of inState(kFailed)) setState(item, kWaiting, "");
  sendAll();
});
byId("add-clear").addEventListener("click", () => {
  items = [];
  byId("add-list").replaceChildren();
  showTotal();
  byId("add-title").focus();
});

// Lists what accept() gives, and shows the list.
export async function take({ files, leftOut, stored, address, problem }) {
  const isHere = showing() === "add";
  if (stored) {
    if (isHere) notify("This image is already stored.", true);  // elsewhere a card was dragged by accident
  } else if (problem) {
    notify(problem, true);
  } else if (!await api.mayWrite()) {
    notify("Your key can search but not add. Ask for a key with write access.", true);
  } else {
    enqueue(address ? [{ file: fileAt(address), folder: "" }] : files, leftOut);
    if (!isHere) go("add");
  }
}

for (const view of ["add", "objects", "images", "object", "image", "collection"]) {
  accept(byId(`view-${view}`), view === "add" ? ["add-files", "add-folder", "add-camera"] : [], take);
}
addEventListener("beforeunload", (event) => { if (stopper) event.preventDefault(); });

export const addView = {
  title: "Add images",
  show(parameters) {
    if (parameters.has("object")) byId("add-object").value = parameters.get("object");
    offerObjectNames();
  },
};
