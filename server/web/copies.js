// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whether a stored picture is a copy of another one: the same file, or the same photograph at another size
// or compressed anew. The warp between the two pictures tells: a copy's is no warp at all.

const kLeastTrusted = 0.6;   // share of the mesh that has to be believed
const kMostOff = 0.015;      // of the diagonal: how far a corner of the mesh may be from where a copy has it
const kMostOffShare = 0.05;  // of the corners may be further off

// hit: one of a search with `image`, explained.
export function isNearCopy(hit, image) {
  const mesh = hit.explain?.mesh;
  if (!mesh) return false;
  const { columns, rows, points, trusted } = mesh;
  const diagonal = Math.hypot(image.width, image.height);
  let believed = 0, off = 0;
  for (const [i, [x, y]] of points.entries()) {
    if (trusted && !trusted[i]) continue;
    ++believed;
    // Pixel centres are at integers: the whole picture reaches from -0.5 to width - 0.5.
    const across = ((i % columns) / (columns - 1)) * (mesh.reference_width - 1) + 0.5;
    const down = (Math.floor(i / columns) / (rows - 1)) * (mesh.reference_height - 1) + 0.5;
    const u = (across * image.width) / mesh.reference_width - 0.5;
    const v = (down * image.height) / mesh.reference_height - 0.5;
    if (Math.hypot(x - u, y - v) > kMostOff * diagonal) ++off;
  }
  return believed >= kLeastTrusted * points.length && off <= kMostOffShare * believed;
}

// "same", "near" or null. `other`: the hit's record.
export function kindOfCopy(hit, image, other) {
  if (other.sha256 === image.sha256) return "same";
  return isNearCopy(hit, image) ? "near" : null;
}
