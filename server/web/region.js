// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The rectangle to search inside: drawn with a mouse, a pen or a finger, moved and sized by keyboard,
// or typed.
import { byId } from "./dom.js";

const kLeastShare = 0.04;  // of each side: a smaller rectangle is a slip of the hand
const kStep = 0.02;        // of a side, a key press

const stage = byId("stage");
const box = byId("region");
const startButton = byId("region-start");
const numbers = ["x", "y", "width", "height"].map((name) => byId(`region-${name}`));

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

let size = null;   // of the picture, in pixels
let part = null;   // { x, y, width, height } as shares of the picture; null = all of it
let search = () => {};

export const whenRegionIsWanted = (call) => { search = call; };

// For a new picture: no rectangle, or the one of `wanted`, as regionParameter() gave it. null where there is none to
// draw on.
export function resetRegion(width, height, wanted = "") {
  size = width ? { width, height } : null;
  startButton.hidden = !size;
  setPart(size && wanted ? partOf(wanted.split(",").map(Number)) : null);
}

// Inside the picture; null for numbers that are none.
function partOf([x, y, width, height]) {
  if (![x, y, width, height].every(Number.isFinite)) return null;
  const left = clamp(x / size.width, 0, 1 - kLeastShare);
  const top = clamp(y / size.height, 0, 1 - kLeastShare);
  return { x: left, y: top, width: clamp(width / size.width, kLeastShare, 1 - left),
           height: clamp(height / size.height, kLeastShare, 1 - top) };
}

// In pixels of the picture, as the server wants it; undefined = the whole picture.
export function regionParameter() {
  return part ? pixels().join(",") : undefined;
}

function pixels() {
  const x = Math.round(part.x * size.width);
  const y = Math.round(part.y * size.height);
  return [x, y, Math.max(1, Math.round((part.x + part.width) * size.width) - x),
          Math.max(1, Math.round((part.y + part.height) * size.height) - y)];
}

function setPart(next) {
  part = next;
  box.hidden = !part;
  for (const id of ["region-search", "region-clear", "region-numbers", "region-help"]) {
    byId(id).hidden = !part;
  }
  startButton.hidden = !size || Boolean(part);
  setDrawing(false);
  if (!part) return;
  box.style.left = `${100 * part.x}%`;
  box.style.top = `${100 * part.y}%`;
  box.style.width = `${100 * part.width}%`;
  box.style.height = `${100 * part.height}%`;
  const [x, y, width, height] = pixels();
  box.setAttribute("aria-label",
                   `Part to search in: left ${x}, top ${y}, width ${width}, height ${height}`);
  for (const [i, value] of [x, y, width, height].entries()) numbers[i].value = value;
}

// While drawing is on, a finger draws instead of scrolling the page.
function setDrawing(on) {
  stage.classList.toggle("drawing", on);
  startButton.setAttribute("aria-pressed", String(on));
}

function moved(dx, dy) {
  return { ...part, x: clamp(part.x + dx, 0, 1 - part.width), y: clamp(part.y + dy, 0, 1 - part.height) };
}

function resized(dx, dy) {
  return { ...part, width: clamp(part.width + dx, kLeastShare, 1 - part.x),
           height: clamp(part.height + dy, kLeastShare, 1 - part.y) };
}

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
  const step = { ArrowLeft: [-kStep, 0], ArrowRight: [kStep, 0], ArrowUp: [0, -kStep],
                 ArrowDown: [0, kStep] }[event.key];
  if (step) setPart(event.shiftKey ? resized(...step) : moved(...step));
  else if (event.key === "Enter") search();
  else if (event.key === "Escape") clear();
  else return;
  event.preventDefault();
});

for (const input of numbers) {
  input.addEventListener("change", () => {
    setPart(partOf(numbers.map((one) => Number(one.value) || 0)));
  });
}

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
  return [clamp((event.clientX - frame.left) / frame.width, 0, 1),
          clamp((event.clientY - frame.top) / frame.height, 0, 1)];
};

const between = ([x0, y0], [x1, y1]) => ({
  x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0),
});

stage.addEventListener("pointerdown", (event) => {
  const finger = event.pointerType === "touch";
  const onBox = event.target === box || event.target.id === "region-grip";
  if (!size || event.button !== 0 || event.target.closest(".tag")) return;
  if (finger && !onBox && !stage.classList.contains("drawing")) return;  // it scrolls
  event.preventDefault();
  const from = place(event);
  const before = part;
  const sizing = event.target.id === "region-grip";
  stage.setPointerCapture(event.pointerId);
  const follow = (motion) => {
    const to = place(motion);
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    if (onBox && before) {
      part = before;
      setPart(sizing ? resized(dx, dy) : moved(dx, dy));
    } else if (Math.hypot(dx, dy) > kLeastShare / 2) {
      setPart(between(from, to));
    }
  };
  const end = (up) => {
    stage.removeEventListener("pointermove", follow);
    const changed = part && JSON.stringify(part) !== JSON.stringify(before);
    if (up.type === "pointercancel") setPart(before);
    else if (part && (part.width < kLeastShare || part.height < kLeastShare)) setPart(before);
    else if (changed) search();
  };
  stage.addEventListener("pointermove", follow);
  for (const type of ["pointerup", "pointercancel"]) {
    stage.addEventListener(type, end, { once: true });
  }
});
