// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that are chosen, dropped or pasted, images dragged from a page, addresses that the server fetches, and images of
// kinds that only the browser reads.
import { mayFetch } from "./api.js";
import { byId, resultOr } from "./dom.js";

const kAddressOnly = "The browser gave only the address of this image, and this server fetches no images. " +
  "Copy the image itself and paste it here, or save it and drop the file.";

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

// One of: files: [{ file, folder }] and leftOut, the number of files in system folders; stored: { collection, id }; address; problem (a sentence).
async function received(transfer, how) {
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
  return { problem: isAddress ? kAddressOnly : `Found no image in what you ${how}.` };
}

// path: the folders around a file, from the given one; files directly in that folder have its name.
const folderOf = ([given = "", ...below]) => below.join("/") || given;

// Folders of systems: trash, thumbnails, snapshots. index/files/image_files.cc has the same list.
const kSystemFolder = /^(@eadir|[#@]recycle|[#~]snapshot|@recently-snapshot|\$recycle\.bin|system volume information|__macosx|lost\+found)$/i;

// found: [{ file, path }]. Leaves out hidden files and folders below the given folder, and counts the files in system folders.
function sorted(found) {
  const files = [];
  let leftOut = 0;
  for (const { file, path } of found) {
    const odd = path.slice(1).find((name) => name.startsWith(".") || kSystemFolder.test(name));
    if (odd && !odd.startsWith(".")) ++leftOut;
    else if (!odd && !(path.length && file.name.startsWith("."))) files.push({ file, folder: folderOf(path) });
  }
  return files.length ? { files, leftOut } : { problem: "Found no image in this folder." };
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

// --- kinds of files: the first bytes tell the kind, not the name. The browser converts images that the server does not read.

const kQuality = 0.95;
const kLongestSide = 8192;  // of a converted image, in pixels; canvases have an end

const kServerReads = ["JPEG", "PNG", "WebP", "BMP", "TIFF"];
const kAdvice = {
  HEIC: "On an iPhone, choose Settings > Camera > Formats > Most Compatible. On a computer, export the photo as JPEG.",
  SVG: "An SVG is a drawing, not a photo. Save it as PNG first.",
  PDF: "A PDF is a document, not a photo. Save the page as PNG first.",
  video: "A video is not a photo. Save a frame as JPEG first.",
};

// By the first bytes, as Latin-1; the first that fits counts.
const kSignatures = {
  JPEG: /^\xff\xd8\xff/, PNG: /^\x89PNG/, WebP: /^RIFF....WEBP/s, BMP: /^BM/, TIFF: /^(II\*\0|MM\0\*)/, GIF: /^GIF8/, PDF: /^%PDF/,
  ICO: /^\0\0\x01\0/, "JPEG XL": /^(\xff\x0a|....JXL )/s, AVIF: /^....ftyp(avi[fs]|(hei|hev|mif1|msf1).{0,56}avif)/s,
  HEIC: /^....ftyp(hei|hev|mif1|msf1)/s, video: /^(....ftyp|\x1aE\xdf\xa3)/s, SVG: /^\s*(<\?xml.*)?<svg/is,
};

// "JPEG", "HEIC", ...; null if unknown.
export function kindOf(bytes) {
  const head = String.fromCharCode(...bytes.slice(0, 256));
  return Object.keys(kSignatures).find((kind) => kSignatures[kind].test(head)) ?? null;
}

// The same file, or a converted one. Throws an Error with a sentence.
export async function readable(file) {
  const kind = kindOf(new Uint8Array(await file.slice(0, 256).arrayBuffer()));
  if (kind === null || kServerReads.includes(kind)) return file;
  const bitmap = kind === "SVG" ? null : await createImageBitmap(file).catch(() => null);
  if (!bitmap) {
    const advice = kAdvice[kind] ?? "Save it as JPEG or PNG first.";
    throw new Error(["SVG", "PDF", "video"].includes(kind) ? advice : `${kind} images cannot be read here. ${advice}`);
  }
  const scale = Math.min(1, kLongestSide / Math.max(bitmap.width, bitmap.height));
  const canvas = new OffscreenCanvas(Math.round(bitmap.width * scale), Math.round(bitmap.height * scale));
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";  // below transparent pixels
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  bitmap.close();
  const [type, ending] = kind === "GIF" ? ["image/png", "png"] : ["image/jpeg", "jpg"];
  const blob = await canvas.convertToBlob({ type, quality: kQuality });
  return new File([blob], `${file.name.replace(/\.[^.]{1,5}$/, "")}.${ending}`, { type, lastModified: file.lastModified });
}
