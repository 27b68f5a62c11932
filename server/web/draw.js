// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images and outlines on canvases.
import { blobOf } from "./api.js";

const kLargestSide = 1280;  // of a canvas, in its own pixels
const kMostPoints = 80;
const kKept = 6;

// Decodes upright; null for kinds that the browser cannot show (mostly TIFF).
export const decode = (blob) => createImageBitmap(blob).catch(() => null);

// The last decoded images of the collection: the original if the browser can show it, else the preview.
const kept = new Map();

export function storedImage(path) {
  if (!kept.has(path)) {
    if (kept.size >= kKept) kept.delete(kept.keys().next().value);
    const loading = blobOf(`${path}/content`).then(decode, () => null).then((image) => image ?? blobOf(`${path}/thumbnail`).then(decode));
    kept.set(path, loading);
    loading.catch(() => kept.delete(path));
  }
  return kept.get(path);
}

// Sizes the canvas for an image of width x height; returns canvas pixels per image pixel.
export function fitCanvas(canvas, width, height) {
  const scale = Math.min(1, kLargestSide / Math.max(width, height));
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  return scale;
}

export const kOutline = "#ffd84d";

export function pathOf(points) {
  const path = new Path2D();
  for (const [x, y] of points) path.lineTo(x, y);
  path.closePath();
  return path;
}

// Light on dark, so that it shows on any image. Points are in image pixels with centres at integers.
export function drawOutline(context, polygon, scale, colour = kOutline, weight = 1) {
  const thin = weight * Math.max(1.5, context.canvas.width / 320);
  context.save();
  context.lineJoin = "round";
  const path = pathOf(polygon.map(([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale]));
  for (const [width, stroke] of [[3 * thin, "#00201dcc"], [1.5 * thin, colour]]) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.stroke(path);
  }
  context.restore();
}

// Dots at inliers; of very many only some, so that the image stays visible.
export function drawPoints(context, all, scale, colour = kOutline) {
  const step = Math.max(1, all.length / kMostPoints);
  const radius = Math.max(1.5, context.canvas.width / 260);
  context.save();
  context.fillStyle = colour;
  context.strokeStyle = "#00201d";
  context.lineWidth = Math.max(0.75, radius / 3);
  for (let i = 0; i < Math.min(all.length, kMostPoints); ++i) {
    const [x, y] = all[Math.floor(i * step)];
    context.beginPath();
    context.arc((x + 0.5) * scale, (y + 0.5) * scale, radius, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  context.restore();
}
