// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One hit beside the query: the picture of the collection, the query un-crumpled onto it, and both
// blended.
import { imagePath } from "./api.js";
import { byId } from "./dom.js";
import { drawOutline, drawPoints, fitCanvas, storedPicture } from "./draw.js";
import { objectName } from "./names.js";
import { convexHull, drawFlattened } from "./warp.js";

let shown = 0;  // an earlier picture that arrives late is dropped
let blended = null;

export function hideComparison() {
  ++shown;
  byId("compare").hidden = true;
}

// query: { picture, width } or null where the browser cannot show it.
export async function showComparison(hit, query) {
  const number = ++shown;
  byId("compare").hidden = false;
  const name = objectName(hit.object, hit.source);
  byId("compare-title").textContent = `Compare: ${name}`;
  const picture = await storedPicture(imagePath(hit.image_id)).catch(() => null);
  if (number !== shown) return;
  const mesh = hit.explain?.mesh ?? null;
  byId("reference-canvas").parentElement.hidden = !picture;
  byId("compare-note").textContent = noteFor(hit, picture, query);
  if (picture) drawReference(hit, picture, name);
  const flat = Boolean(picture && mesh && query);
  byId("flat-figure").hidden = byId("blend-figure").hidden = !flat;
  byId("trio").classList.toggle("blends", flat);
  blended = flat ? drawFlat(picture, mesh, query, name) : null;
  drawBlend();
}

function noteFor(hit, picture, query) {
  if (!picture) return "The original of this picture is not kept, so there is nothing to show.";
  if (!hit.explain?.mesh) {
    return `It cannot be un-crumpled. ${hit.explain?.failure ?? "Nothing tells how it is bent."}`;
  }
  return query ? "" : "The picture you searched with cannot be shown here.";
}

function drawReference(hit, picture, name) {
  const canvas = byId("reference-canvas");
  // Coordinates are pixels of the original; the preview stands in for one that cannot be shown.
  const width = hit.explain?.reference.width || picture.width;
  const height = hit.explain?.reference.height || picture.height;
  const scale = fitCanvas(canvas, width, height);
  const context = canvas.getContext("2d");
  context.drawImage(picture, 0, 0, canvas.width, canvas.height);
  const points = (hit.explain?.pairs ?? []).map(([, , x, y]) => [x, y]);
  const hull = convexHull(points);
  if (hull.length > 2) drawOutline(context, hull, scale);
  drawPoints(context, points, scale);
  canvas.setAttribute("aria-label", `${name}, as it is in the collection`);
  byId("reference-note").textContent =
    hull.length > 2 ? "Outlined: the part that was recognised." : "";
}

function drawFlat(picture, mesh, query, name) {
  const canvas = byId("flat-canvas");
  const scale = fitCanvas(canvas, mesh.reference_width, mesh.reference_height);
  drawFlattened(canvas.getContext("2d"), query.picture, query.width, mesh, scale);
  canvas.setAttribute("aria-label", `Your picture of ${name}, un-crumpled`);
  return { picture, flat: canvas };
}

function drawBlend() {
  if (!blended) return;
  const canvas = byId("blend-canvas");
  const share = Number(byId("blend").value) / 100;
  canvas.width = blended.flat.width;
  canvas.height = blended.flat.height;
  const context = canvas.getContext("2d");
  context.drawImage(blended.picture, 0, 0, canvas.width, canvas.height);
  context.globalAlpha = share;
  context.drawImage(blended.flat, 0, 0);
  byId("blend").setAttribute("aria-valuetext", `${Math.round(100 * share)} % yours`);
}

byId("blend").addEventListener("input", drawBlend);
