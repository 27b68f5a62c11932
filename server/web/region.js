// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The rectangle to search inside: drawn with a mouse, a pen or a finger, moved and sized by keyboard, or typed.
import { byId } from "./dom.js";
import { t } from "./texts.js";

const kLeastShare = 0.04;  // of each side: a smaller rectangle is a slip of the hand
const kStep = 0.02;        // of a side, per key press

const [stage, box, startButton] = ["stage", "region", "region-start"].map(byId);
const numbers = ["x", "y", "width", "height"].map((name) => byId(`region-${name}`));

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

let size = null;   // of the photo, in pixels
let part = null;   // { x, y, width, height } as shares of the photo; null = all of it
let search = () => {};

export const whenRegionIsWanted = (call) => { search = call; };

// For a new photo: no rectangle, or the `wanted` one, in the form of regionParameter(). Width 0: nothing to draw on.
export function resetRegion(width, height, wanted = "") {
  size = width ? { width, height } : null;
  startButton.hidden = !size;
  setPart(size && wanted ? partOf(wanted.split(",").map(Number)) : null);
}

// Inside the photo; null for what is not a number.
function partOf([x, y, width, height]) {
  if (![x, y, width, height].every(Number.isFinite)) return null;
  const left = clamp(x / size.width, 0, 1 - kLeastShare);
  const top = clamp(y / size.height, 0, 1 - kLeastShare);
  return { x: left, y: top, width: clamp(width / size.width, kLeastShare, 1 - left), height: clamp(height / size.height, kLeastShare, 1 - top) };
}

// "x,y,width,height" in pixels; undefined = the whole photo.
export const regionParameter = () => (part ? pixels().join() : undefined);

function pixels() {
  const x = Math.round(part.x * size.width);
  const y = Math.round(part.y * size.height);
  return [x, y, Math.max(1, Math.round((part.x + part.width) * size.width) - x), Math.max(1, Math.round((part.y + part.height) * size.height) - y)];
}

function setPart(next) {
  part = next;
  for (const id of ["region", "region-search", "region-clear", "region-numbers", "region-help"]) byId(id).hidden = !part;
  startButton.hidden = !size || Boolean(part);
  setDrawing(false);
  if (!part) return;
  for (const [side, share] of [["left", part.x], ["top", part.y], ["width", part.width], ["height", part.height]]) box.style[side] = `${100 * share}%`;
  const [x, y, width, height] = pixels();
  box.setAttribute("aria-label", t`Part to search: left ${x}, top ${y}, width ${width}, height ${height}`);
  for (const [i, value] of [x, y, width, height].entries()) numbers[i].value = value;
}

// While drawing is on, a finger draws and does not scroll the page.
function setDrawing(on) {
  stage.classList.toggle("drawing", on);
  startButton.setAttribute("aria-pressed", String(on));
}

const moved = (dx, dy) => ({ ...part, x: clamp(part.x + dx, 0, 1 - part.width), y: clamp(part.y + dy, 0, 1 - part.height) });
const resized = (dx, dy) => ({ ...part, width: clamp(part.width + dx, kLeastShare, 1 - part.x), height: clamp(part.height + dy, kLeastShare, 1 - part.y) });

// --- by keyboard

startButton.addEventListener("click", (event) => {
  // A click by mouse or finger waits for a drag; a click by keyboard has no pointer position.
  if (event.detail > 0) {
    setDrawing(!stage.classList.contains("drawing"));
    byId("region-help").hidden = !stage.classList.contains("drawing");
    return;
  }
  setPart({ x: 0.25, y: 0.25, width: 0.5, height: 0.5 });
  box.focus();
});

box.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-kStep, 0], ArrowRight: [kStep, 0], ArrowUp: [0, -kStep], ArrowDown: [0, kStep] }[event.key];
  if (step) setPart(event.shiftKey ? resized(...step) : moved(...step));
  else if (event.key === "Enter") search();
  else if (event.key === "Escape") clear();
  else return;
  event.preventDefault();
});

for (const input of numbers) input.addEventListener("change", () => setPart(partOf(numbers.map((one) => Number(one.value) || 0))));

function clear() {
  setPart(null);
  startButton.focus();
  search();
}
byId("region-clear").addEventListener("click", clear);
byId("region-search").addEventListener("click", () => search());

// --- with a pointer

const place = (event) => {
  const frame = stage.getBoundingClientRect();
  return [clamp((event.clientX - frame.left) / frame.width, 0, 1), clamp((event.clientY - frame.top) / frame.height, 0, 1)];
};

stage.addEventListener("pointerdown", (event) => {
  const sizing = event.target.id === "region-grip";
  const onBox = event.target === box || sizing;
  if (!size || event.button !== 0 || event.target.closest(".tag")) return;
  if (event.pointerType === "touch" && !onBox && !stage.classList.contains("drawing")) return;  // it scrolls
  event.preventDefault();
  const [x0, y0] = place(event);
  const before = part;
  stage.setPointerCapture(event.pointerId);
  const follow = (motion) => {
    const [x, y] = place(motion);
    const [dx, dy] = [x - x0, y - y0];
    if (onBox && before) {
      part = before;
      setPart(sizing ? resized(dx, dy) : moved(dx, dy));
    } else if (Math.hypot(dx, dy) > kLeastShare / 2) {
      setPart({ x: Math.min(x0, x), y: Math.min(y0, y), width: Math.abs(dx), height: Math.abs(dy) });
    }
  };
  const end = (up) => {
    stage.removeEventListener("pointermove", follow);
    const changed = part && JSON.stringify(part) !== JSON.stringify(before);
    const isSlip = part && (part.width < kLeastShare || part.height < kLeastShare);
    if (up.type === "pointercancel" || isSlip) setPart(before);
    else if (changed) search();
  };
  stage.addEventListener("pointermove", follow);
  for (const type of ["pointerup", "pointercancel"]) stage.addEventListener(type, end, { once: true });
});
