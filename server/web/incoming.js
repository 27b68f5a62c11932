// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is dropped or pasted: files, folders, pictures dragged from another page, or only their addresses, which
// the server fetches where its operator lets it.
import { mayFetch } from "./me.js";

const kAddressOnly = "The browser handed over the picture's address only, and this page fetches nothing from elsewhere. " +
  "Copy the picture itself and paste it here, or save it and drop the file.";
const kNoPicture = "There is no picture in what was dropped.";
const kNothingPasted = "There is no picture in what was pasted.";

// A picture of this server's that is dragged from the page: { collection, id }, or null.
function storedAt(address) {
  let url = null;
  try {
    url = new URL(address);
  } catch {
    return null;
  }
  if (url.origin !== location.origin) return null;
  const part = /^\/v1\/collections\/([^/]+)\/images\/([^/]+)(?:\/(?:content|thumbnail))?$/.exec(url.pathname);
  if (part) return { collection: decodeURIComponent(part[1]), id: decodeURIComponent(part[2]) };
  const view = /^#\/(?:picture|search)\?(.*)$/.exec(url.hash);
  const query = new URLSearchParams(view?.[1] ?? "");
  const id = query.get("id") ?? query.get("image");
  return id ? { collection: query.get("in") ?? "default", id } : null;
}

// data:image/png;base64,… as a file; null for what is none.
export function fileOfData(address) {
  const part = /^data:(image\/[a-z0-9.+-]+)((?:;[^;,]*)*),(.*)$/is.exec(address);
  if (!part) return null;
  try {
    const text = part[2].toLowerCase().endsWith(";base64") ? atob(part[3]) :
      decodeURIComponent(part[3].replace(/%(?![0-9a-f]{2})/gi, "%25"));
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    return new File([bytes], `image.${part[1].split("/")[1].replace(/\+.*/, "")}`, { type: part[1] });
  } catch {
    return null;
  }
}

// The addresses that a drag or a paste brings along, the picture's own first.
function addressesIn(transfer) {
  const page = new DOMParser().parseFromString(transfer.getData("text/html") || "", "text/html");  // an inert document
  const listed = (transfer.getData("text/uri-list") || "").split(/\r?\n/).filter((line) => line && !line.startsWith("#"));
  const text = (transfer.getData("text/plain") || "").trim();
  return [page.querySelector("img")?.getAttribute("src"), ...listed, text].filter(Boolean);
}

// A picture elsewhere as if it were a file, with its address in place of its bytes.
export function fileAt(address) {
  const { pathname, host } = new URL(address);
  let name = pathname.split("/").at(-1) || host;
  try {
    name = decodeURIComponent(name);
  } catch {  // it stays as it is
  }
  return { name, address, size: 0, type: "", lastModified: Date.now() };
}

// { files: [{ file, folder }], stored: { collection, id } or null, address of a picture elsewhere or "",
//   problem: words or "" }
export async function received(transfer, isPaste = false) {
  const addresses = addressesIn(transfer);  // now: nothing can be read later
  const entries = [...(transfer.items ?? [])].map((item) => item.webkitGetAsEntry?.());
  const plain = [...transfer.files].map((file) => ({ file, folder: "" }));
  const stored = addresses.map(storedAt).find(Boolean) ?? null;
  const nothing = { files: [], stored: null, address: "", problem: "" };
  if (stored) return { ...nothing, stored };
  let files = plain;
  if (entries.some((entry) => entry?.isDirectory)) {
    files = [];
    for (const entry of entries) if (entry) await walk(entry, [], files);
  }
  if (files.length) return { ...nothing, files };
  const data = addresses.map(fileOfData).find(Boolean);
  if (data) return { ...nothing, files: [{ file: data, folder: "" }] };
  const elsewhere = addresses.find((one) => /^https?:\/\/\S+$/i.test(one) && URL.canParse?.(one) !== false);
  if (elsewhere && await mayFetch()) return { ...nothing, address: elsewhere };
  const isAddress = addresses.some((one) => /^(https?|blob|file):/i.test(one));
  return { ...nothing, problem: isAddress ? kAddressOnly : isPaste ? kNothingPasted : kNoPicture };
}

// way: the folders that the entry lies in, from the one that was dropped.
async function walk(entry, way, found) {
  if (entry.isFile) {
    const file = await new Promise((done, fail) => entry.file(done, fail));
    if (!file.name.startsWith(".")) found.push({ file, folder: way.slice(1).join("/") || way[0] || "" });
    return;
  }
  const reader = entry.createReader();
  for (;;) {  // a reader gives at most 100 at once
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return;
    for (const inner of some) await walk(inner, [...way, entry.name], found);
  }
}

// Lets files be dropped on `place`; use({ files, stored, address, problem }).
export function acceptDrops(place, use) {
  let depth = 0;  // dragenter and dragleave come for every child
  const mark = (change) => {
    depth = Math.max(0, depth + change);
    place.classList.toggle("over", depth > 0);
  };
  place.addEventListener("dragenter", (event) => { event.preventDefault(); mark(1); });
  place.addEventListener("dragover", (event) => event.preventDefault());
  place.addEventListener("dragleave", () => mark(-1));
  place.addEventListener("drop", async (event) => {
    event.preventDefault();
    mark(-depth);
    use(await received(event.dataTransfer));
  });
}

// Calls use() with what is pasted while `view` is shown; text for a field is left alone.
export function acceptPastes(view, use) {
  document.addEventListener("paste", async (event) => {
    if (view.hidden || event.target.closest?.("input, textarea, dialog")) return;
    const { clipboardData } = event;
    if (!clipboardData.files.length && !clipboardData.types.length) return;
    use(await received(clipboardData, true));
  });
}
