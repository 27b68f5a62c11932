// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that are chosen, dropped or pasted, images dragged from a page, and addresses that the server fetches.
import { mayFetch } from "./api.js";
import { byId, resultOr } from "./dom.js";
import { inNaturalOrder } from "./names.js";
import { t } from "./texts.js";

const kAddressOnly = t`The browser gave only the address of this image, and this server fetches no images.
  Copy the image itself and paste it here, or save it and drop the file.`;

// An image of this server: { collection, id }, or null.
function storedAt(address) {
  const url = resultOr(null, () => new URL(address));
  if (url?.origin !== location.origin) return null;
  const part = /^\/v1\/collections\/([^/]+)\/images\/([^/]+)(?:\/(?:content|thumbnail))?$/.exec(url.pathname);
  if (part) return { collection: decodeURIComponent(part[1]), id: decodeURIComponent(part[2]) };
  const view = /^#\/(?:image|search)\?(.*)$/.exec(url.hash);
  const query = new URLSearchParams(view?.[1] ?? "");
  const id = query.get("id") ?? query.get("image");
  return id ? { collection: query.get("in") ?? "default", id } : null;
}

// data:image/png;base64,… as a file, or null.
export function fileOfData(address) {
  const part = /^data:(image\/[a-z0-9.+-]+)((?:;[^;,]*)*),(.*)$/is.exec(address);
  return part && resultOr(null, () => {
    const text = part[2].toLowerCase().endsWith(";base64") ? atob(part[3]) : decodeURIComponent(part[3].replace(/%(?![0-9a-f]{2})/gi, "%25"));
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    return new File([bytes], `image.${part[1].split("/")[1].replace(/\+.*/, "")}`, { type: part[1] });
  });
}

// The addresses in a drag or a paste, first the image's own.
function addressesIn(transfer) {
  const page = new DOMParser().parseFromString(transfer.getData("text/html") || "", "text/html");  // an inert document
  const listed = (transfer.getData("text/uri-list") || "").split(/\r?\n/).filter((line) => line && !line.startsWith("#"));
  return [page.querySelector("img")?.getAttribute("src"), ...listed, (transfer.getData("text/plain") || "").trim()].filter(Boolean);
}

// An image elsewhere as if it were a file: an address instead of bytes.
export function fileAt(address) {
  const { pathname, host } = new URL(address);
  const last = pathname.split("/").at(-1) || host;
  return { name: resultOr(last, () => decodeURIComponent(last)), address, size: 0, type: "", lastModified: Date.now() };
}

// `how` ("dropped", "pasted"), and one of: files: [{ file, folder }] and leftOut, the number of files in system folders; stored: { collection, id }; address;
// problem (a sentence).
const received = async (transfer, how) => ({ how, ...await contents(transfer, how) });

async function contents(transfer, how) {
  const addresses = addressesIn(transfer);  // now: nothing can be read later
  const entries = [...(transfer.items ?? [])].map((item) => item.webkitGetAsEntry?.());
  const files = [...transfer.files].map((file) => ({ file, folder: "" }));
  const stored = addresses.map(storedAt).find(Boolean);
  if (stored) return { stored };
  if (entries.some((entry) => entry?.isDirectory)) {
    const found = [];
    for (const entry of entries) if (entry) await walk(entry, [], found);
    return sorted(found);
  }
  if (files.length) return { files };
  const file = addresses.map(fileOfData).find(Boolean);
  if (file) return { files: [{ file, folder: "" }] };
  const address = addresses.find((one) => /^https?:\/\/\S+$/i.test(one) && URL.canParse?.(one) !== false);
  if (address && await mayFetch()) return { address };
  const isAddress = addresses.some((one) => /^(https?|blob|file):/i.test(one));
  return {
    problem: isAddress ? kAddressOnly : how === "dropped" ? t`Found no image in what you dropped.` : t`Found no image in what you pasted.` };
}

// path: the folders around a file, from the given one; files directly in that folder have its name.
const folderOf = ([given = "", ...below]) => below.join("/") || given;

// Folders of systems: trash, thumbnails, snapshots. index/files/image_files.cc has the same list.
const kSystemFolder = /^(@eadir|[#@]recycle|[#~]snapshot|@recently-snapshot|\$recycle\.bin|system volume information|__macosx|lost\+found)$/i;

// found: [{ file, path }]. Leaves out hidden files and folders below the given folder, and counts the files in system folders.
// The others come in natural order.
function sorted(found) {
  const files = [];
  let leftOut = 0;
  for (const { file, path } of found) {
    const odd = path.slice(1).find((name) => name.startsWith(".") || kSystemFolder.test(name));
    if (odd && !odd.startsWith(".")) ++leftOut;
    else if (!odd && !(path.length && file.name.startsWith("."))) files.push({ file, folder: folderOf(path) });
  }
  files.sort((a, b) => inNaturalOrder(a.folder, b.folder) || inNaturalOrder(a.file.name, b.file.name));
  return files.length ? { files, leftOut } : { problem: t`Found no image in this folder.` };
}

async function walk(entry, path, found) {
  if (entry.isFile) {
    found.push({ file: await new Promise((done, fail) => entry.file(done, fail)), path });
    return;
  }
  const reader = entry.createReader();
  for (;;) {  // a reader gives at most 100 at once
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return;
    for (const inner of some) await walk(inner, [...path, entry.name], found);
  }
}

// Calls use() with what is dropped on the view, pasted while it is shown, or chosen by the inputs; text for a field is
// left alone.
export function accept(view, inputs, use) {
  let depth = 0;  // dragenter and dragleave come for every child
  const mark = (change) => {
    depth = Math.max(0, depth + change);
    view.classList.toggle("over", depth > 0);
  };
  view.addEventListener("dragenter", (event) => { event.preventDefault(); mark(1); });
  view.addEventListener("dragleave", () => mark(-1));
  view.addEventListener("drop", async (event) => {
    event.preventDefault();
    mark(-depth);
    use(await received(event.dataTransfer, "dropped"));
  });
  document.addEventListener("paste", async (event) => {
    if (view.hidden || event.target.closest?.("input, textarea, dialog")) return;
    const { clipboardData } = event;
    if (clipboardData.files.length || clipboardData.types.length) use(await received(clipboardData, "pasted"));
  });
  for (const id of inputs) {
    byId(id).addEventListener("change", ({ target }) => {
      const chosen = sorted([...target.files].map((file) => ({ file, path: file.webkitRelativePath.split("/").slice(0, -1) })));
      if (target.files.length) use(chosen);
      target.value = "";  // so that the same file can be chosen again
    });
  }
}

// --- other kinds of files, by their first bytes: said here, before a film is sent.

const kAdvice = [
  [/^....ftyp(?!.{0,56}(avi[fs]|hei[cxms]|hev[cx]|m[is]f1))|^\x1aE\xdf\xa3/s, t`A video is not a photo. Save a frame as JPEG first.`],
  [/^\s*(<\?xml.*)?<svg/is, t`An SVG is a drawing, not a photo. Save it as PNG first.`],
  [/^%PDF/, t`A PDF is a document, not a photo. Save the page as PNG first.`],
];

// What to do with a file of these first bytes, which is no photo; undefined for others.
export function adviceFor(bytes) {
  const head = String.fromCharCode(...bytes.slice(0, 256));
  return kAdvice.find(([start]) => start.test(head))?.[1];
}

// Throws an Error with a sentence.
export async function refuseOther(file) {
  const advice = adviceFor(new Uint8Array(await file.slice(0, 256).arrayBuffer()));
  if (advice) throw new Error(advice);
}
