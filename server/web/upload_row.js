// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One image in the list of images to add: its preview, its object's name, its progress.
import { previewBlob } from "./api.js";
import { byId, fileSize, make, say, shorten, smallButton } from "./dom.js";
import { kLongestName } from "./names.js";

export const kWaiting = "waiting", kSending = "sending", kDone = "done", kFailed = "failed";

const kThumbPx = 128;

// One after the other, and only those in view: images of 12 megapixels take time. Slow previews from the web do not hold
// up the others.
const painting = { here: Promise.resolve(), elsewhere: Promise.resolve() };
const watcher = new IntersectionObserver((entries) => {
  for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
    watcher.unobserve(target);
    const { place } = target;
    painting[place] = painting[place].then(() => target.isConnected && target.paint()).catch((error) => {
      target.classList.add("blank");
      target.unseen(error);
    });
  }
});

// unseen(error) is called if there is no preview.
function thumbnailOf(file, unseen) {
  const canvas = make("canvas", { class: "upload-thumb", width: 1, height: 1, role: "img", "aria-label": `Preview of ${file.name}` });
  return Object.assign(canvas, { place: file.address ? "elsewhere" : "here", unseen, async paint() {
    const bytes = file.address ? await previewBlob(file.address) : file;
    const bitmap = await createImageBitmap(bytes, { resizeHeight: kThumbPx, resizeQuality: "medium" });
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
  } });
}

// `name`: the object's default name. onRemove(item) is called when the item leaves the list.
export function makeItem(file, name, onRemove) {
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value: name, placeholder: "no name",
                                list: "object-names", "aria-label": `Object in ${file.name}`, oninput: () => { item.typed = true; } });
  const bar = make("progress", { max: 1, value: 0, "aria-label": `Progress of ${file.name}` });
  const note = make("span", { class: "note", text: file.address ? "from the web" : fileSize(file.size) });
  const remove = smallButton("Remove", () => {
    const neighbour = row.nextElementSibling ?? row.previousElementSibling;
    row.remove();
    (neighbour?.querySelector("button:not([hidden])") ?? byId("add-clear")).focus();
    onRemove(item);
  }, { class: "small", "aria-label": `Remove ${file.name} from the list` });
  const thumbnail = thumbnailOf(file, ({ message }) => {  // the browser's message on a file helps nobody
    if (file.address && item.state === kWaiting) note.textContent = `from the web; no preview: ${message}`;
  });
  const row = make("li", {}, thumbnail, input, make("span", { class: "file-name quiet", text: shorten(file.name), title: file.name }), note, bar, remove);
  const item = { file, input, bar, note, remove, row, state: kWaiting, proposed: name, typed: false };
  row.dataset.state = kWaiting;
  byId("add-list").append(row);
  watcher.observe(thumbnail);
  return item;
}

export const nameOf = (item) => item.input.value.trim();

export function setState(item, state, text) {
  item.state = item.row.dataset.state = state;
  say(item.note, text, state === kFailed);
  item.input.disabled = state === kSending || state === kDone;
  item.remove.hidden = state === kSending;
  if (state !== kSending) item.bar.value = state === kDone ? 1 : 0;
}
