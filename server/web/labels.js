// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Labels as people type them: "shelf=4, colour=red" is { shelf: 4, colour: "red" }.

// Where conditions are allowed, also "year>=2020" and the like: { year: { gte: 2020 } }.

const kTests = [[">=", "gte"], ["<=", "lte"], [">", "gt"], ["<", "lt"], ["=", null]];

// Throws an Error in words for what cannot be read; null when there are none.
export function parseLabels(text, conditions = false) {
  const labels = {};
  for (const part of text.split(",").map((one) => one.trim()).filter(Boolean)) {
    const [sign, test] = kTests.find(([one]) => part.includes(one) && (conditions || one === "=")) ?? [];
    const at = sign ? part.indexOf(sign) : -1;
    const name = part.slice(0, at).trim();
    if (at < 1 || !name) throw new Error(`"${part}" is no label: write name=value.`);
    const value = valueOf(part.slice(at + sign.length).trim());
    labels[name] = test ? { ...labels[name], [test]: value } : value;
  }
  return Object.keys(labels).length ? labels : null;
}

// What can be written as "name=value" in a line of its own; the rest of the metadata is not people's.
const isPlain = ([name, value]) =>
  !/[=\r\n]/.test(name) && name === name.trim() && name !== "" &&
  (typeof value === "string" ? !/[\r\n]/.test(value) && value === value.trim() : ["number", "boolean"].includes(typeof value));

const plainLabels = (metadata) => new Map(Object.entries(metadata).filter(isPlain)
  .map(([name, value]) => [name, String(value)]));

// Metadata as lines to edit.
export const labelLines = (metadata) =>
  [...plainLabels(metadata)].map(([name, text]) => `${name}=${text}`).join("\n");

// The JSON merge patch from `metadata` to what the lines say; null where they say the same. Values that
// were not touched keep their types. Throws an Error in words for a line that cannot be read, or
// that would take the place of metadata which the lines do not show.
export function labelsPatch(metadata, lines) {
  const before = plainLabels(metadata);
  const patch = {};
  const left = new Set(before.keys());
  for (const line of lines.split("\n").map((one) => one.trim()).filter(Boolean)) {
    const at = line.indexOf("=");
    const name = line.slice(0, at).trim();
    if (at < 1 || !name) throw new Error(`"${line}" is no label: write name=value.`);
    if (Object.hasOwn(metadata, name) && !before.has(name)) {
      throw new Error(`"${name}" holds something that cannot be edited here.`);
    }
    const text = line.slice(at + 1).trim();
    left.delete(name);
    if (before.get(name) !== text) patch[name] = valueOf(text);
  }
  for (const name of left) patch[name] = null;
  return Object.keys(patch).length ? patch : null;
}

function valueOf(text) {
  if (text === "true" || text === "false") return text === "true";
  const number = Number(text);
  return text !== "" && Number.isFinite(number) && String(number) === text ? number : text;
}
