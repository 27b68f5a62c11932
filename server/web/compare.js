// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One hit beside the photo: the stored image, the photo un-crumpled onto it, and both blended.
import { imagePath } from "./api.js";
import { byId } from "./dom.js";
import { drawOutline, drawPoints, fitCanvas, storedImage } from "./draw.js";
import { objectName } from "./names.js";
import { convexHull, drawFlattened } from "./warp.js";

let shown = 0;  // drops an earlier image that arrives late
let blended = null;

export function hideComparison() {
  ++shown;
  byId("compare").hidden = true;
}

// query: { bitmap, width }, or null if the browser cannot show it.
export async function showComparison(hit, query) {
  const number = ++shown;
  byId("compare").hidden = false;
  const name = objectName(hit.object, hit.source);
  byId("compare-title").textContent = `Compare: ${name}`;
  const stored = await storedImage(imagePath(hit.image_id)).catch(() => null);
  if (number !== shown) return;
  const mesh = hit.explain?.mesh ?? null;
  byId("reference-canvas").parentElement.hidden = !stored;
  byId("compare-note").textContent = !stored ? "The server does not store the original of this image." :
    !mesh ? `This object cannot be un-crumpled. ${hit.explain?.failure ?? ""}` : query ? "" : "Your photo cannot be shown here.";
  if (stored) drawReference(hit, stored, name);
  const flat = Boolean(stored && mesh && query);
  byId("flat-figure").hidden = byId("blend-figure").hidden = !flat;
  byId("trio").classList.toggle("blends", flat);
  blended = flat ? { stored, flat: drawFlat(mesh, query, name) } : null;
  drawBlend();
}

function drawReference(hit, stored, name) {
  const canvas = byId("reference-canvas");
  // Coordinates are pixels of the original, also if only the preview can be shown.
  const { width, height } = hit.explain?.reference.width ? hit.explain.reference : stored;
  const scale = fitCanvas(canvas, width, height);
  const context = canvas.getContext("2d");
  context.drawImage(stored, 0, 0, canvas.width, canvas.height);
  const points = (hit.explain?.pairs ?? []).map(([, , x, y]) => [x, y]);
  const hull = convexHull(points);
  if (hull.length > 2) drawOutline(context, hull, scale);
  drawPoints(context, points, scale);
  canvas.setAttribute("aria-label", `${name}, stored image`);
  byId("reference-note").textContent = hull.length > 2 ? "The outline shows the recognised part." : "";
}

function drawFlat(mesh, query, name) {
  const canvas = byId("flat-canvas");
  const scale = fitCanvas(canvas, mesh.reference_width, mesh.reference_height);
  drawFlattened(canvas.getContext("2d"), query.bitmap, query.width, mesh, scale);
  canvas.setAttribute("aria-label", `Your photo of ${name}, un-crumpled`);
  return canvas;
}

function drawBlend() {
  if (!blended) return;
  const { stored, flat } = blended;
  const canvas = byId("blend-canvas");
  const share = Number(byId("blend").value) / 100;
  canvas.width = flat.width;
  canvas.height = flat.height;
  const context = canvas.getContext("2d");
  context.drawImage(stored, 0, 0, canvas.width, canvas.height);
  context.globalAlpha = share;
  context.drawImage(flat, 0, 0);
  byId("blend").setAttribute("aria-valuetext", `${Math.round(100 * share)} % your photo`);
}
byId("blend").addEventListener("input", drawBlend);
