// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One picture in the list of those to add: what it looks like, what it will be called, how far it is.
import { previewBlob } from "./api.js";
import { byId, fileSize, make, say, shorten } from "./dom.js";
import { kLongestName } from "./names.js";

export const kWaiting = "waiting", kSending = "sending", kDone = "done", kFailed = "failed";

const kThumbPx = 128;

// One after the other, and only what can be seen: photographs of twelve megapixels take their time.
// Those from the web, for which the server waits, do not keep the others.
const painting = { here: Promise.resolve(), elsewhere: Promise.resolve() };
const watcher = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (!isIntersecting) continue;
    watcher.unobserve(target);
    const { place } = target;
    painting[place] = painting[place].then(() => target.isConnected && target.paint()).catch((error) => {
      target.classList.add("blank");
      target.unseen(error);
    });
  }
});

// unseen(error) is called for what cannot be shown: it stays empty.
function thumbnailOf(file, unseen) {
  const canvas = make("canvas", { class: "upload-thumb", width: 1, height: 1, role: "img",
                                  "aria-label": `Preview of ${file.name}` });
  canvas.place = file.address ? "elsewhere" : "here";
  canvas.unseen = unseen;
  canvas.paint = async () => {
    const bytes = file.address ? await previewBlob(file.address) : file;
    const picture = await createImageBitmap(bytes, { resizeHeight: kThumbPx, resizeQuality: "medium" });
    canvas.width = picture.width;
    canvas.height = picture.height;
    canvas.getContext("2d").drawImage(picture, 0, 0);
    picture.close();
  };
  watcher.observe(canvas);
  return canvas;
}

// `name` is what it will be called unless somebody types another. onRemove(item) is called when it is
// taken off the list.
export function makeItem(file, name, onRemove) {
  const input = make("input", { type: "text", maxlength: kLongestName, autocomplete: "off", value: name,
                                placeholder: "no name", list: "object-names",
                                "aria-label": `Object that ${file.name} shows` });
  const bar = make("progress", { max: 1, value: 0, "aria-label": `Progress of ${file.name}` });
  const note = make("span", { class: "note", text: file.address ? "from the web" : fileSize(file.size) });
  const remove = make("button", { type: "button", class: "small", text: "Remove",
                                  "aria-label": `Remove ${file.name} from the list` });
  const unseen = ({ message }) => {  // that of a file says nothing to people
    if (file.address && item.state === kWaiting) note.textContent = `from the web; no preview: ${message}`;
  };
  const row = make("li", {}, thumbnailOf(file, unseen), input,
                   make("span", { class: "file-name quiet", text: shorten(file.name), title: file.name }),
                   note, bar, remove);
  const item = { file, input, bar, note, remove, row, state: kWaiting, proposed: name, typed: false };
  row.dataset.state = kWaiting;
  input.addEventListener("input", () => { item.typed = true; });
  remove.addEventListener("click", () => {
    const neighbour = row.nextElementSibling ?? row.previousElementSibling;
    row.remove();
    (neighbour?.querySelector("button:not([hidden])") ?? byId("add-clear")).focus();
    onRemove(item);
  });
  byId("add-list").append(row);
  return item;
}

export const nameOf = (item) => item.input.value.trim();

export function setState(item, state, text) {
  item.state = state;
  item.row.dataset.state = state;
  say(item.note, text, state === kFailed);
  item.input.disabled = state === kSending || state === kDone;
  item.remove.hidden = state === kSending;
  if (state === kDone) item.bar.value = 1;
  if (state === kFailed || state === kWaiting) item.bar.value = 0;
}
