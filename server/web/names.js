// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What things are called when nobody has said it: the file's name, or that of its folder.

export const kLongestName = 200;  // characters

// Names that cameras, telephones and clipboards give to every picture.
const kSaysNothing = /^(image|img|photo|picture|pasted|blob|capture|untitled|unnamed|\d+)?$/i;

const kMostBytes = 512;  // in UTF-8, on the server

// What the server takes no names with: control characters, and such that are invisible or turn the
// direction of writing; half characters, which some systems have in names of files, are no UTF-8.
const kInvisible = /[\u0000-\u001f\u007f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\u{e0000}-\u{10ffff}\p{Cs}]/u;
const kJoiner = /[\u200c\u200d]/;
const kJoinedFrom = 0x600;  // joiners are part of some scripts and of emoji

const bytesOf = (point) => (point < 0x80 ? 1 : point < 0x800 ? 2 : point < 0x10000 ? 3 : 4);

// The name without what the server refuses, and no longer than it takes.
export function acceptable(name) {
  let text = "", before = 0, bytes = 0;
  for (const letter of name.trim()) {
    const point = letter.codePointAt(0);
    const joiner = kJoiner.test(letter);
    if (kInvisible.test(letter) && !(joiner && before >= kJoinedFrom)) continue;
    if (!text && !letter.trim()) continue;
    bytes += bytesOf(point);
    if (bytes > kMostBytes || text.length + letter.length > kLongestName) break;
    text += letter;
    before = joiner ? 0 : point;
  }
  return text.replace(/[\s\u200c\u200d]+$/, "");
}

export const stem = (fileName) => fileName.replace(/(?!^)\.[^.]{1,5}$/, "").trim();

function pointInTime(ms) {
  const two = (n) => String(n).padStart(2, "0");
  const t = new Date(ms);
  return `Photo ${t.getFullYear()}-${two(t.getMonth() + 1)}-${two(t.getDate())} ` +
         `${two(t.getHours())}.${two(t.getMinutes())}.${two(t.getSeconds())}`;
}

// The name to begin with: the folder's, else the file's without extension. `taken`: names that are
// in the list already; a name made up from the time is not given twice.
export function defaultName(file, folder = "", taken = []) {
  const given = acceptable((folder || stem(file.name)).normalize("NFC"));
  if (!kSaysNothing.test(given)) return given;
  const made = pointInTime(file.lastModified);
  let name = made;
  for (let i = 2; taken.includes(name); ++i) name = `${made} (${i})`;
  return name;
}

// What was fetched is called by the end of its address.
function fileNameOf(source) {
  if (!/^https?:\/\//.test(source)) return source;
  const last = source.split("/").at(-1);
  try {
    return decodeURIComponent(last) || source;
  } catch {
    return last;
  }
}

// Of a stored picture or a hit: its object's name, else its file's.
export const objectName = (object, source = "") => object || acceptable(stem(fileNameOf(source ?? ""))) || "(no name)";

// What people call a collection.
export const shownName = ({ name, display_name: shown }) => shown || name;

const kPlainName = /^[A-Za-z0-9._-]{1,64}$/;

// The name in addresses of a collection that is called so: the same where that will do. `taken`:
// names that mean another one.
export function collectionNameFor(shown, taken = []) {
  if (kPlainName.test(shown) && !/^\.+$/.test(shown)) return shown;
  const plain = shown.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase()
    .replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 50) || "collection";
  let name = plain;
  for (let i = 2; taken.includes(name); ++i) name = `${plain}-${i}`;
  return name;
}
