// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Prometheus' text format, as /metrics has it.

const kUnescaped = { n: "\n", "\\": "\\", '"': '"' };

// [{ name, labels, value }]; comments and lines that are none are left out.
export function parseMetrics(text) {
  const samples = [];
  for (const line of text.split("\n")) {
    const part = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})?\s+(\S+)/.exec(line);
    if (!part) continue;
    const labels = {};
    for (const [, name, value] of (part[2] ?? "").matchAll(/([a-zA-Z_]\w*)="((?:[^"\\]|\\.)*)"/g)) {
      labels[name] = value.replace(/\\(.)/g, (_, letter) => kUnescaped[letter] ?? letter);
    }
    samples.push({ name: part[1], labels, value: part[3] === "+Inf" ? Infinity : Number(part[3]) });
  }
  return samples;
}

const matches = (labels, wanted) => Object.entries(wanted).every(([name, value]) =>
  (value instanceof RegExp ? value.test(labels[name] ?? "") : labels[name] === value));

// The sum of all series with these labels; null where there are none.
export function total(samples, name, labels = {}) {
  const found = samples.filter((one) => one.name === name && matches(one.labels, labels));
  return found.length ? found.reduce((sum, { value }) => sum + value, 0) : null;
}

// A quantile (0 to 1) of a histogram, interpolated inside its bucket; null where nothing was counted.
export function quantile(samples, name, labels, share) {
  const counts = new Map();
  for (const one of samples) {
    if (one.name !== `${name}_bucket` || !matches(one.labels, labels)) continue;
    const end = one.labels.le === "+Inf" ? Infinity : Number(one.labels.le);
    counts.set(end, (counts.get(end) ?? 0) + one.value);
  }
  const buckets = [...counts].sort(([a], [b]) => a - b);
  const all = buckets.at(-1)?.[1] ?? 0;
  if (!all) return null;
  let from = 0, before = 0;
  for (const [end, upTo] of buckets) {
    if (upTo >= share * all) {
      if (end === Infinity) return from;  // beyond the last bucket's end
      return from + ((end - from) * (share * all - before)) / Math.max(1, upTo - before);
    }
    [from, before] = [end, upTo];
  }
  return from;
}
