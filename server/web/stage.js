// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The photo with everything found in it: each object outlined in its own colour, with its name, which selects it.
import { byId, makeButton } from "./dom.js";
import { drawOutline, drawPoints, fitCanvas, kOutline, pathOf } from "./draw.js";
import { t } from "./texts.js";
import { isWeak } from "./words.js";

// They show on any image (outlines have dark edges), also to people who see fewer colours.
export const kColours = [kOutline, "#4dd2ff", "#ff8ad8", "#8dff7a", "#ff9d4d", "#c0a8ff"];
const kSlipPx = 6;  // a pointer that moved further has drawn, not tapped

const [canvas, tags, stage] = ["stage-canvas", "stage-tags", "stage"].map(byId);

let shown = [];  // [{ hit, polygon }] that can be tapped
let photoWidth = 1;
let pick = () => {};

export const whenHitIsPicked = (call) => { pick = call; };

// An object may be in the photo more than once.
const outlinesOf = (hit) => [hit.polygon, ...(hit.instances ?? []).slice(1).map((one) => one.polygon)].filter(Boolean);

// Map from image ids to colours, of the hits that are outlined without being chosen.
export function coloursOf(hits) {
  const outlined = hits.filter((hit) => !isWeak(hit) && outlinesOf(hit).length);
  return new Map(outlined.map((hit, i) => [hit.image_id, kColours[i % kColours.length]]));
}

// query: { bitmap, width, height }. Draws all hits with a colour, and the chosen one with its inliers.
export function drawStage(query, hits, chosen) {
  const note = byId("stage-note");
  const focused = shown[[...tags.children].indexOf(document.activeElement)]?.polygon;
  tags.replaceChildren();
  shown = [];
  if (!query?.bitmap) {
    note.textContent = query?.url ? t`The server is fetching this image.` : t`This browser cannot show this file, but the search works.`;
    return;
  }
  photoWidth = query.width;
  const scale = fitCanvas(canvas, query.width, query.height);
  const context = canvas.getContext("2d");
  context.drawImage(query.bitmap, 0, 0, canvas.width, canvas.height);
  const colours = coloursOf(hits);
  if (chosen && !colours.has(chosen.image_id)) colours.set(chosen.image_id, kColours[0]);
  const said = [];
  for (const hit of [...hits].sort((a, b) => (a === chosen) - (b === chosen))) {  // the chosen one on top
    const colour = colours.get(hit.image_id);
    const outlines = colour ? outlinesOf(hit) : [];
    for (const polygon of outlines) {
      drawOutline(context, polygon, scale, colour, hit === chosen ? 1.5 : 1);
      shown.push({ hit, polygon });
      tags.append(tag(hit, polygon, colour, query, hit === chosen));
    }
    if (outlines.length) said.push(hit.name + (outlines.length > 1 ? t`, ${outlines.length} times` : ""));
  }
  if (chosen?.explain) drawPoints(context, chosen.explain.pairs.map(([x, y]) => [x, y]), scale, colours.get(chosen.image_id));
  if (focused) tags.children[shown.findIndex(({ polygon }) => polygon === focused)]?.focus({ preventScroll: true });
  separate();
  note.textContent = said.length ? t`Outlined: ${said.join("; ")}` : "";
  canvas.setAttribute("aria-label", [t`Your photo`, note.textContent].filter(Boolean).join(". "));
}

// The name, at the top of the outline, inside the photo.
function tag(hit, polygon, colour, query, isChosen) {
  const [x, y] = polygon.reduce((best, point) => (point[1] < best[1] ? point : best));
  const button = makeButton(hit.name, () => pick(hit), { class: "tag", title: hit.name, "aria-pressed": String(isChosen) });
  const within = (share, least) => Math.min(1 - least, Math.max(least, share));
  button.middle = [within(x / query.width, 0.12), within(y / query.height, 0.06)];
  button.style.borderColor = colour;
  return button;
}

// Names must not overlap: a later one moves down or up to the next free place.
function separate() {
  const { clientWidth: width, clientHeight: height } = stage;
  const placed = [];
  for (const tag of tags.children) {
    const [w, h] = [tag.offsetWidth + 4, tag.offsetHeight + 4];
    const x = Math.min(width - w / 2, Math.max(w / 2, tag.middle[0] * width));
    const first = tag.middle[1] * height;
    const isFree = (y) => placed.every((one) => Math.abs(one.x - x) >= (one.w + w) / 2 || Math.abs(one.y - y) >= (one.h + h) / 2);
    const tries = [first];
    for (let step = h / 2; step < height; step += h / 2) tries.push(first + step, first - step);
    const y = tries.find((one) => one >= h / 2 && one <= height - h / 2 && isFree(one)) ?? first;
    placed.push({ x, y, w, h });
    tag.style.left = width ? `${(100 * x) / width}%` : `${100 * tag.middle[0]}%`;
    tag.style.top = height ? `${(100 * y) / height}%` : `${100 * tag.middle[1]}%`;
  }
}
new ResizeObserver(separate).observe(stage);

const areaOf = (polygon) => Math.abs(polygon.reduce((sum, [x, y], i) => {
  const [u, v] = polygon[(i + 1) % polygon.length];
  return sum + x * v - u * y;
}, 0)) / 2;

export const isInside = ([x, y], polygon) => canvas.getContext("2d").isPointInPath(pathOf(polygon), x, y, "evenodd");

let pressedAt = [0, 0];
stage.addEventListener("pointerdown", ({ clientX, clientY }) => { pressedAt = [clientX, clientY]; });
stage.addEventListener("click", (event) => {
  const slipped = Math.hypot(event.clientX - pressedAt[0], event.clientY - pressedAt[1]) > kSlipPx;
  if (event.target.closest(".tag") || slipped || !shown.length || !byId("region").hidden) return;
  const frame = canvas.getBoundingClientRect();
  const scale = photoWidth / frame.width;
  const at = [(event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale];
  const under = shown.filter(({ polygon }) => isInside(at, polygon)).sort((a, b) => areaOf(a.polygon) - areaOf(b.polygon));
  if (under.length) pick(under[0].hit);
});
