// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One hit beside the photo: the stored image, the photo un-crumpled onto it, and both blended.
import { imagePath } from "./api.js";
import { byId } from "./dom.js";
import { drawOutline, drawPoints, fitCanvas, pathOf, storedImage } from "./draw.js";
import { t } from "./texts.js";

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
  byId("compare-title").textContent = t`Compare: ${hit.name}`;
  const stored = await storedImage(imagePath(hit.image_id)).catch(() => null);
  if (number !== shown) return;
  const mesh = hit.explain?.mesh ?? null;
  byId("reference-canvas").parentElement.hidden = !stored;
  byId("compare-note").textContent = !stored ? t`The server does not store the original of this image.` :
    !mesh ? t`This object cannot be un-crumpled. ${hit.explain?.failure ?? ""}` : query ? "" : t`Your photo cannot be shown here.`;
  if (stored) drawReference(hit, stored);
  const flat = Boolean(stored && mesh && query);
  byId("flat-figure").hidden = byId("blend-figure").hidden = !flat;
  byId("trio").classList.toggle("blends", flat);
  blended = flat ? { stored, flat: drawFlat(mesh, query, hit.name) } : null;
  drawBlend();
}

function drawReference(hit, stored) {
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
  canvas.setAttribute("aria-label", t`${hit.name}, stored image`);
  byId("reference-note").textContent = hull.length > 2 ? t`The outline shows the recognised part.` : "";
}

function drawFlat(mesh, query, name) {
  const canvas = byId("flat-canvas");
  const scale = fitCanvas(canvas, mesh.reference_width, mesh.reference_height);
  drawFlattened(canvas.getContext("2d"), query.bitmap, query.width, mesh, scale);
  canvas.setAttribute("aria-label", t`Your photo of ${name}, un-crumpled`);
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

// --- un-crumpling: the photo, pulled back through the warp that verification found. The warp is a mesh of `columns` x `rows`
// points, regular in the reference image, each with its place in the photo. Each cell is two triangles, and each triangle
// one affine map.

// The map from the triangle (0, 0), (1, 0), (0, 1) to this one.
const mapTo = ([[x, y], [x1, y1], [x2, y2]]) => new DOMMatrix([x1 - x, y1 - y, x2 - x, y2 - y, x, y]);

// The affine map (a, b, c, d, e, f of a canvas transform) from triangle `from` to `to`; null if `from` has no area.
export function affine(from, to) {
  const { a, b, c, d, e, f } = mapTo(to).multiply(mapTo(from).inverse());
  return Number.isFinite(a) ? [a, b, c, d, e, f] : null;
}

// Moves the sides outwards by `px`: scales the triangle about the centre of its incircle, whose radius grows by that.
function grown([a, b, c], px) {
  const [ofA, ofB, ofC] = [[b, c], [c, a], [a, b]].map(([p, q]) => Math.hypot(p[0] - q[0], p[1] - q[1]));
  const around = ofA + ofB + ofC;
  const [mx, my] = [0, 1].map((i) => (ofA * a[i] + ofB * b[i] + ofC * c[i]) / around);
  const radius = Math.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / around;
  return [a, b, c].map(([x, y]) => [mx + ((x - mx) * (radius + px)) / radius, my + ((y - my) * (radius + px)) / radius]);
}

// The triangles whose corners are all trusted: { reference, query }, three points each, in pixels.
export function triangles({ columns, rows, points, trusted, reference_width: width, reference_height: height }) {
  const corner = (row, column) => {
    const number = row * columns + column;
    return { reference: [((width - 1) * column) / (columns - 1), ((height - 1) * row) / (rows - 1)],
             query: points[number], trusted: trusted?.[number] ?? true };
  };
  const list = [];
  const add = (...corners) => {
    if (!corners.every((one) => one.trusted)) return;
    list.push({ reference: corners.map((one) => one.reference), query: corners.map((one) => one.query) });
  };
  for (let row = 0; row + 1 < rows; ++row) {
    for (let column = 0; column + 1 < columns; ++column) {
      const [a, b, c, d] = [corner(row, column), corner(row, column + 1), corner(row + 1, column), corner(row + 1, column + 1)];
      add(a, b, d);
      add(a, d, c);
    }
  }
  return list;
}

// Draws into `context`, whose canvas shows the reference at `scale` canvas pixels per reference pixel. `bitmap`: the
// photo at any size; queryWidth: its width in the mesh. Pixel centres are at integers in the mesh, at halves on the canvas.
// Clipped edges are translucent. So each triangle grows by half a pixel's diagonal and some: it then covers all of the
// pixels whose centres it holds, and no ground shines through.
export function drawFlattened(context, bitmap, queryWidth, mesh, scale) {
  const shrink = bitmap.width / queryWidth;
  for (const { reference, query } of triangles(mesh)) {
    const to = reference.map(([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale]);
    const from = query.map(([x, y]) => [(x + 0.5) * shrink, (y + 0.5) * shrink]);
    const map = affine(from, to);
    if (!map) continue;
    const clip = grown(to, 0.75);
    const back = new DOMMatrix(map).inverse();
    context.save();
    context.clip(pathOf(clip));
    context.transform(...map);
    drawPart(context, bitmap, clip.map(([x, y]) => back.transformPoint({ x, y })).map(({ x, y }) => [x, y]));
    context.restore();
  }
}

// Draws only the part around the triangle: far faster than the whole photo for each.
function drawPart(context, bitmap, corners) {
  const [xs, ys] = [0, 1].map((i) => corners.map((point) => point[i]));
  const left = Math.max(0, Math.floor(Math.min(...xs)) - 2);
  const top = Math.max(0, Math.floor(Math.min(...ys)) - 2);
  const width = Math.min(bitmap.width, Math.ceil(Math.max(...xs)) + 2) - left;
  const height = Math.min(bitmap.height, Math.ceil(Math.max(...ys)) + 2) - top;
  if (width > 0 && height > 0) context.drawImage(bitmap, left, top, width, height, left, top, width, height);
}

// Corners of the convex hull (monotone chain).
export function convexHull(points) {
  const sorted = [...points].sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  if (sorted.length < 3) return sorted;
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}
