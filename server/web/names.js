// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What things are called when nobody has said it: the file's name, or that of its folder.

export const kLongestName = 200;  // characters

// Names that cameras, telephones and clipboards give to every picture.
const kSaysNothing = /^(image|img|photo|picture|pasted|blob|capture|untitled|unnamed|\d+)?$/i;

// What the server takes no names with: control characters, and such that are invisible or turn the
// direction of writing.
const kInvisible = /[\u0000-\u001f\u007f\u00ad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]/g;

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
  const given = (folder || stem(file.name)).normalize("NFC").replace(kInvisible, "").trim();
  if (!kSaysNothing.test(given)) return given.slice(0, kLongestName);
  const made = pointInTime(file.lastModified);
  let name = made;
  for (let i = 2; taken.includes(name); ++i) name = `${made} (${i})`;
  return name;
}

// Of a stored picture or a hit: its object's name, else its file's.
export const objectName = (object, source = "") => object || stem(source ?? "") || "(no name)";
