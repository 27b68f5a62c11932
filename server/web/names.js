// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Default names of objects: the folder's or the file's.
import { resultOr } from "./dom.js";
import { t } from "./texts.js";

export const kLongestName = 200;  // characters
const kMostBytes = 512;           // in UTF-8, on the server
const kUtf8 = new TextEncoder();

// Names that cameras, phones and clipboards give: a word for all images, or a camera's letters and counter, or a date and a time; then only counters,
// dates and times: IMG_1234, DSC00123, IMG-20231128-WA0001, 20231128_101112. Other numbers are names: of articles, books, lots.
const kGiven = String.raw`image|img|photo|picture|pasted|blob|capture|screenshot|untitled|unnamed`;
const kCamera = String.raw`(?:cimg|dji|dsc[fin]?|gopr|imgp|mvimg|pict|pxl|sam|signal|whatsapp image)[ _-]?(?=\d{4})`;
const kMoment = String.raw`(?=(?:19|20)\d\d-?\d\d-?\d\d[ _-]\d\d[.-]?\d\d[.-]?\d\d)`;
const kSaysNothing = new RegExp(String.raw`^(?:_?(?:${kGiven}|${kCamera}|${kMoment})(?:[\s\d_.()~-]|at|e(?=\d)|hdr|mp|wa)*)?$`, "i");

// The server refuses names with control characters, invisible or direction-changing ones, and halves of characters.
const kInvisible = /[\u0000-\u001f\u007f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\u{e0000}-\u{10ffff}\p{Cs}]/u;
const kJoiner = /[\u200c\u200d]/;
const kJoinedFrom = 0x600;  // joiners are part of some scripts and of emoji

// The name as the server accepts it.
function acceptable(name) {
  let text = "", before = 0;
  for (const letter of name) {
    const joiner = kJoiner.test(letter);
    if (kInvisible.test(letter) && !(joiner && before >= kJoinedFrom)) continue;
    const longer = (text + letter).trimStart();
    if (longer.length > kLongestName || kUtf8.encode(longer).length > kMostBytes) break;
    text = longer;
    before = joiner || !text ? 0 : letter.codePointAt(0);
  }
  return text.replace(/[\s\u200c\u200d]+$/, "");
}

const stem = (fileName) => fileName.replace(/(?!^)\.[^.]{1,5}$/, "").trim();

// `name` with the first number that makes it new.
function numbered(name, taken, form) {
  let made = name;
  for (let i = 2; taken.includes(made); ++i) made = form(i);
  return made;
}

// The folder's name, else the file's without extension, else the time. `taken`: names of the list; a time is not given twice.
export function defaultName(file, folder = "", taken = []) {
  const given = acceptable((folder || stem(file.name)).normalize("NFC"));
  if (!kSaysNothing.test(given)) return given;
  const at = new Date(file.lastModified);
  const [month, day, ...time] = [at.getMonth() + 1, at.getDate(), at.getHours(), at.getMinutes(), at.getSeconds()].map((n) => String(n).padStart(2, "0"));
  const name = `Photo ${at.getFullYear()}-${month}-${day} ${time.join(".")}`;
  return numbered(name, taken, (i) => `${name} (${i})`);
}

// The last part of an address; a file's name stays.
function fileNameOf(source) {
  if (!/^https?:\/\//.test(source)) return source;
  const last = source.split("/").at(-1);
  return resultOr(last, () => decodeURIComponent(last)) || source;
}

// For a stored image or a hit: its object's name, else its file's.
export const objectName = (object, source = "") => object || acceptable(stem(fileNameOf(source ?? ""))) || t`(no name)`;

// "(2)" before "(10)".
export const inNaturalOrder = new Intl.Collator(undefined, { numeric: true }).compare;

export const shownName = ({ name, display_name: shown }) => shown || name;

// The name in addresses of a collection. `taken`: names of other collections.
export function collectionNameFor(shown, taken = []) {
  if (/^[A-Za-z0-9._-]{1,64}$/.test(shown) && !/^\.+$/.test(shown)) return shown;
  const plain = shown.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase()
    .replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 50) || "collection";
  return numbered(plain, taken, (i) => `${plain}-${i}`);
}
