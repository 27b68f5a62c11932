// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Labels as people type them: "shelf=4, colour=red" is { shelf: 4, colour: "red" }. Conditions also have "year>=2020":
// { year: { gte: 2020 } }.
import { t } from "./texts.js";

const kTests = [[">=", "gte"], ["<=", "lte"], [">", "gt"], ["<", "lt"], ["=", null]];

function valueOf(text) {
  if (text === "true" || text === "false") return text === "true";
  const number = Number(text);
  return text !== "" && Number.isFinite(number) && String(number) === text ? number : text;
}

// "name SIGN value" as [name, value]; throws an Error with a sentence.
function split(text, sign) {
  const at = sign ? text.indexOf(sign) : -1;
  const name = text.slice(0, Math.max(0, at)).trim();
  if (!name) throw new Error(t`"${text}" is not a label. Write name=value.`);
  return [name, text.slice(at + sign.length).trim()];
}

const parts = (text, separator) => text.split(separator).map((one) => one.trim()).filter(Boolean);

// null if there are none.
export function parseLabels(text, conditions = false) {
  const labels = {};
  for (const part of parts(text, ",")) {
    const [sign, test] = kTests.find(([one]) => part.includes(one) && (conditions || one === "=")) ?? [];
    const [name, value] = split(part, sign);
    labels[name] = test ? { ...labels[name], [test]: valueOf(value) } : valueOf(value);
  }
  return Object.keys(labels).length ? labels : null;
}

// The labels that fit in a line "name=value". Other metadata is for programs.
const plainLabels = (metadata) => new Map(Object.entries(metadata).filter(([name, value]) =>
  !/[=\r\n]/.test(name) && name === name.trim() && name !== "" &&
  (typeof value === "string" ? !/[\r\n]/.test(value) && value === value.trim() : ["number", "boolean"].includes(typeof value)))
  .map(([name, value]) => [name, String(value)]));

// Metadata as lines to edit.
export const labelLines = (metadata) => [...plainLabels(metadata)].map(([name, text]) => `${name}=${text}`).join("\n");

// The JSON merge patch from `metadata` to the lines; null if they are equal. Untouched values keep their types.
// Throws an Error with a sentence for a bad line, and for metadata that the lines do not show.
export function labelsPatch(metadata, lines) {
  const before = plainLabels(metadata);
  const patch = {};
  const left = new Set(before.keys());
  for (const line of parts(lines, "\n")) {
    const [name, text] = split(line, line.includes("=") ? "=" : "");
    if (Object.hasOwn(metadata, name) && !before.has(name)) throw new Error(t`"${name}" cannot be edited here. Use the HTTP API.`);
    left.delete(name);
    if (before.get(name) !== text) patch[name] = valueOf(text);
  }
  for (const name of left) patch[name] = null;
  return Object.keys(patch).length ? patch : null;
}
