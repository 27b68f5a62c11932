// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures and outlines on canvases.
import { pictureBlob } from "./api.js";

const kLargestSide = 1280;  // of a canvas, in its own pixels
const kMostPoints = 80;

// Decodes upright; null where the browser cannot show this kind of picture (TIFF, mostly).
export async function decode(blob) {
  try {
    return await createImageBitmap(blob);
  } catch {
    return null;
  }
}

// Decoded pictures of the collection, the last few: original where the browser can show it, else the
// preview.
const kept = new Map();
const kKept = 6;

export async function storedPicture(path) {
  if (!kept.has(path)) {
    if (kept.size >= kKept) kept.delete(kept.keys().next().value);
    const loading = pictureBlob(`${path}/content`).then(decode, () => null)
      .then((picture) => picture ?? pictureBlob(`${path}/thumbnail`).then(decode));
    kept.set(path, loading);
    loading.catch(() => kept.delete(path));
  }
  return kept.get(path);
}

// Sizes the canvas for a width x height picture; canvas pixels a picture pixel.
export function fitCanvas(canvas, width, height) {
  const scale = Math.min(1, kLargestSide / Math.max(width, height));
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  return scale;
}

export const kOutline = "#ffd84d";

// An outline that shows on any picture: light on dark. Points in picture pixels, centres at
// integers.
export function drawOutline(context, polygon, scale, colour = kOutline, weight = 1) {
  const thin = weight * Math.max(1.5, context.canvas.width / 320);
  context.save();
  context.lineJoin = "round";
  context.beginPath();
  for (const [x, y] of polygon) context.lineTo((x + 0.5) * scale, (y + 0.5) * scale);
  context.closePath();
  for (const [width, stroke] of [[3 * thin, "#00201dcc"], [1.5 * thin, colour]]) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.stroke();
  }
  context.restore();
}

// Small dots where points agree; of very many only some, so that the picture stays visible.
export function drawPoints(context, all, scale, colour = kOutline) {
  const step = Math.max(1, all.length / kMostPoints);
  const points = Array.from({ length: Math.min(all.length, kMostPoints) },
                            (_, i) => all[Math.floor(i * step)]);
  const radius = Math.max(1.5, context.canvas.width / 260);
  context.save();
  context.fillStyle = colour;
  context.strokeStyle = "#00201d";
  context.lineWidth = Math.max(0.75, radius / 3);
  for (const [x, y] of points) {
    context.beginPath();
    context.arc((x + 0.5) * scale, (y + 0.5) * scale, radius, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  context.restore();
}
