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

function valueOf(text) {
  if (text === "true" || text === "false") return text === "true";
  const number = Number(text);
  return text !== "" && Number.isFinite(number) && String(number) === text ? number : text;
}
