// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The view for adding images: many at once, each with its object's name.
import * as api from "./api.js";
import { deleteButton } from "./cards.js";
import { byId, count, eachOf, fileSize, make, onSubmit, say, shorten, smallButton } from "./dom.js";
import { offerObjectNames } from "./filters.js";
import { accept, fileAt, refuseOther } from "./incoming.js";
import { parseLabels } from "./labels.js";
import { defaultName, kLongestName } from "./names.js";
import { go, showing } from "./router.js";
import { t } from "./texts.js";
import { isLeaving, notify, settle } from "./undo.js";

const kWaiting = "waiting", kSending = "sending", kDone = "done", kFailed = "failed";
const kForAll = ["forbidden", "cross_site", "collection_not_found"];  // problems that all other images would have, too
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
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value: name, placeholder: t`no name`,
                                list: "object-names", "aria-label": t`Object in ${file.name}`, oninput: () => { item.typed = true; } });
  const bar = make("progress", { max: 1, value: 0, "aria-label": t`Progress of ${file.name}` });
  const note = make("span", { class: "note", text: file.address ? t`from the web` : fileSize(file.size) });
  const remove = smallButton(t`Remove`, () => {
    const neighbour = row.nextElementSibling ?? row.previousElementSibling;
    row.remove();
    (neighbour?.querySelector("button:not([hidden])") ?? byId("add-clear")).focus();
  }, { class: "small", "aria-label": t`Remove ${file.name} from the list` });
  const thumbnail = thumbnailOf(file, (error) => {
    if (error && item.state === kWaiting) note.textContent = t`from the web; no preview: ${error.message}`;
  });
  const row = make("li", {}, thumbnail, input, make("span", { class: "file-name quiet", text: shorten(file.name), title: file.name }), note, bar, remove);
  const item = { file, input, bar, note, remove, row, state: kWaiting, proposed: name, typed: false };
  row.dataset.state = kWaiting;
  row.item = item;
  byId("add-list").append(row);
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

const items = () => [...byId("add-list").children].map(({ item }) => item);
const inState = (state) => items().filter((item) => item.state === state);
const mayRetry = () => inState(kFailed).filter((item) => item.mayRetry);

let running = null;  // while uploads run: { stopper, words, of, finished, began, pausedAt, problem }

const commonName = () => byId("add-object").value.trim();

// found: [{ file, folder }]; leftOut: the number of files in system folders
function enqueue(found, leftOut = 0) {
  const taken = items().map(nameOf);
  for (const { file, folder } of found) {
    const name = defaultName(file, folder, taken);
    taken.push(name);
    makeItem(file, name);
  }
  giveCommonName();
  say(byId("add-status"), leftOut ? t`${count(leftOut, "file")} of system folders left out.` : "");
}

// While it is typed; a name that was typed for one image stays.
function giveCommonName() {
  for (const item of items()) {
    if (!item.typed && item.state !== kDone && item.state !== kSending) item.input.value = commonName() || item.proposed;
  }
}
byId("add-object").addEventListener("input", giveCommonName);

// "24 images added", "1 of 4 images added, 2 already stored, 1 failed"
function countWords(of = "") {
  const known = items().filter((item) => item.known).length;
  const added = inState(kDone).length - known;
  const failed = inState(kFailed).length;
  return [of ? t`${added} of ${of} added` : t`${count(added, "image")} added`, known ? t`${known} already stored` : "",
          failed ? t`${failed} failed` : ""].filter(Boolean).join(", ");
}

export function timeWords(ms) {
  const minutes = Math.round(ms / 60_000);
  if (minutes < 1) return t`less than a minute left`;
  return t`about ${minutes < 90 ? count(minutes, "minute") : count(Math.round(minutes / 60), "hour")} left`;
}

// An estimate from the images that are finished.
function timeLeft() {
  const { of, finished, began, pausedAt } = running;
  return finished < kAtOnce ? "" : `, ${timeWords(((pausedAt || Date.now()) - began) / finished * (of - finished))}`;
}

function showTotal() {
  const [waiting, done, failed] = [kWaiting, kDone, kFailed].map((state) => inState(state).length);
  const partly = inState(kSending).reduce((sum, { bar }) => sum + Math.max(0, bar.position) / 2, 0);
  const all = items().length;
  byId("add-form").hidden = !all;
  byId("add-bar").max = all || 1;
  byId("add-bar").value = done + failed + partly;
  byId("add-summary").textContent = countWords(count(all, "image")) + (running ? timeLeft() : "");
  byId("add-start").textContent = t`Add ${count(waiting, "image")}`;
  byId("add-start").hidden = Boolean(running) || !waiting;
  byId("add-stop").hidden = !running;
  byId("add-retry").hidden = Boolean(running) || !mayRetry().length;
  byId("add-clear").hidden = byId("add-collection").disabled = Boolean(running);
  byId("add-next").hidden = Boolean(running) || !done || waiting > 0;
}
new MutationObserver(showTotal).observe(byId("add-list"), { childList: true });

// --- sending

// Whether someone typed the name.
const wasNamed = (item) => item.typed || Boolean(commonName());

// The image is stored under another name than was typed: a button gives it that name.
function offerRename(item, id, metadata, collection) {
  const object = wasNamed(item) ? nameOf(item) : "";
  item.note.append(" ", smallButton(object ? t`Rename to ${object}` : t`Use these labels`, async ({ target }) => {
    target.disabled = true;
    try {
      if (object) await settle(api.objectPath(object, collection));
      await api.patch(api.imagePath(id, "", collection), { ...(object && { object }), ...(metadata && { metadata }) });
      item.known = true;
      setState(item, kDone, object ? t`renamed to ${object}` : t`labels changed`);
      offerObjectNames();
    } catch (error) {
      item.mayRetry = true;
      setState(item, kFailed, error.message);
    }
    showTotal();
  }));
}

// The image is in the collection now: its button deletes it there.
function offerDeletion(item, id, collection) {
  const { name } = item.file;
  const button = deleteButton({
    card: item.row, path: api.imagePath(id, "", collection), label: t`Delete ${name} from the collection`, text: t`Deleted: ${name}.` });
  item.remove.replaceWith(button);
  item.remove = button;
}

function pause({ message }) {
  running.pausedAt ||= Date.now();
  say(byId("add-status"), t`${message} Adding continues by itself when the server answers.`, true);
}

function goOn() {
  if (!running.pausedAt) return;
  running.began += Date.now() - running.pausedAt;
  running.pausedAt = 0;
  say(byId("add-status"), running.words);
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
  setState(item, kSending, t`sending…`);
  try {
    const { created, image } = await upload(item, { object: nameOf(item), metadata: labels }, {
      collection, signal: running.stopper.signal,
      onProgress: (share) => {
        goOn();
        item.bar.value = Math.min(share, 0.99);
        item.note.textContent = share < 1 ? t`sending, ${Math.round(100 * share)} %` : t`processing…`;
        if (share >= 1) item.bar.removeAttribute("value");  // it moves until the answer comes
        showTotal();
      },
      onWait: (error) => {
        item.note.textContent = t`waiting for the server`;
        pause(error);
      },
    });
    item.known = !created;
    setState(item, kDone, created ? t`added: ${count(image.keypoints, "keypoint")}` : t`already stored`);
    if (created) offerDeletion(item, image.id, collection);
  } catch (error) {
    if (error.name === "AbortError") {
      setState(item, kWaiting, t`stopped`);
    } else if (error.status === 401 || kForAll.includes(error.code)) {
      setState(item, kWaiting, error.message);
      running.problem = error.message;
      running.stopper.abort();
    } else if (error.code === "same_bytes" && !wasNamed(item) && !labels) {
      item.known = true;
      setState(item, kDone, t`already stored under another name`);
    } else {
      item.mayRetry = [0, 408, 429].includes(error.status) || error.status >= 500;
      setState(item, kFailed, error.message);
      if (error.code === "same_bytes" && error.imageId) offerRename(item, error.imageId, labels, collection);
    }
  }
  ++running.finished;
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
  const collection = api.collectionName();  // another one may be chosen meanwhile
  const images = count(queue.length, "image");
  const words = byId("add-collection-label").hidden ? t`Adding ${images}…` :
    t`Adding ${images} to the collection ${byId("add-collection").selectedOptions[0].text}…`;
  const stopper = new AbortController();
  const mine = running = { stopper, words, of: queue.length, finished: 0, began: Date.now() };
  showTotal();
  say(byId("add-status"), mine.words);
  byId("add-stop").focus();
  await eachOf(queue, async (item) => { if (!stopper.signal.aborted && item.row.isConnected) await send(item, labels, collection); }, kAtOnce);
  running = null;
  showTotal();
  const failed = inState(kFailed).length;
  const reason = mine.problem || (failed ? t`See each image for the reason.` : "");
  const result = stopper.signal.aborted ? t`Stopped: ${countWords()}.` : t`Finished: ${countWords()}.`;
  say(byId("add-status"), [result, reason].filter(Boolean).join(" "), Boolean(reason));
  if ([byId("add-stop"), document.body].includes(document.activeElement)) {
    ["add-retry", "add-next", "add-clear"].map(byId).find((one) => !one.hidden).focus();
  }
  offerObjectNames();
}

onSubmit(byId("add-form"), () => {
  if (!running && inState(kWaiting).length) sendAll();
});
byId("add-stop").addEventListener("click", () => running?.stopper.abort());
byId("add-retry").addEventListener("click", () => {
  for (const item of mayRetry()) setState(item, kWaiting, "");
  sendAll();
});
byId("add-clear").addEventListener("click", () => {
  byId("add-list").replaceChildren();
  byId("add-title").focus();
});

// Lists what accept() gives, and shows the list.
export async function take({ files, leftOut, stored, address, problem }) {
  const isHere = showing() === "add";
  if (stored) {
    if (isHere) notify(t`This image is already stored.`, true);  // elsewhere a card was dragged by accident
  } else if (problem) {
    notify(problem, true);
  } else if (!await api.mayWrite()) {
    notify(t`Your key can search but not add. Ask for a key with write access.`, true);
  } else {
    enqueue(address ? [{ file: fileAt(address), folder: "" }] : files, leftOut);
    if (!isHere) go("add");
  }
}

for (const view of ["add", "objects", "images", "object", "image", "collection"]) {
  accept(byId(`view-${view}`), view === "add" ? ["add-files", "add-folder", "add-camera"] : [], take);
}
addEventListener("beforeunload", (event) => { if (running) event.preventDefault(); });

export const addView = {
  title: t`Add images`,
  show(parameters) {
    if (parameters.has("object")) byId("add-object").value = parameters.get("object");
    offerObjectNames();
  },
};
