// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The lists of hits: those that count, and the weak ones, folded away.
import { imagePath, showPicture } from "./api.js";
import { byId, count, make } from "./dom.js";
import { filterParameters } from "./filters.js";
import { objectName } from "./names.js";
import { link } from "./router.js";
import { isWeak, scoreWords } from "./words.js";

const strong = byId("results");
const weak = byId("weaker");
const toggle = byId("weaker-toggle");

// A picture of the collection, or an empty frame where it cannot be shown.
// sha256: of the picture, where its record is known; the browser then keeps the preview.
export function thumbnail(id, sha256 = "") {
  const image = make("img", { alt: "", loading: "lazy", width: 320, height: 240 });
  image.addEventListener("error", () => image.replaceWith(make("span", { class: "blank" })),
                         { once: true });
  showPicture(image, imagePath(id, sha256 ? `/thumbnail?sha256=${sha256}` : "/thumbnail"));
  return image;
}

function scoreBar(share, grade) {
  const fill = make("span", { class: `fill ${grade}` });
  fill.style.width = `${Math.round(100 * Math.max(0, Math.min(1, share)))}%`;
  return make("span", { class: "bar", "aria-hidden": "true" }, fill);
}

// The colour that the object is outlined with.
function swatch(colour) {
  if (!colour) return null;
  const mark = make("span", { class: "swatch", "aria-hidden": "true" });
  mark.style.background = colour;
  return mark;
}

function hitCard(hit, colour, onChoose) {
  const { words, grade, share, percent } = scoreWords(hit);
  const name = objectName(hit.object, hit.source);
  const facts = [percent, hit.inliers ? `${count(hit.inliers, "point")} agree${hit.inliers === 1 ? "s" : ""}` : ""];
  const button = make(
    "button", { type: "button", class: "hit-choose", "aria-pressed": "false",
                onclick: () => onChoose(hit) },
    thumbnail(hit.image_id),
    make("span", { class: "hit-text" },
         make("span", { class: "name" }, swatch(colour), `${hit.rank}. ${name}`),
         make("span", { class: "grade", text: words }), scoreBar(share, grade),
         make("span", { class: "quiet", text: facts.filter(Boolean).join(", ") }), labelList(hit.metadata)));
  const alike = make("a", { href: link("search", { image: hit.image_id, ...filterParameters() }), class: "quiet",
                            text: "Use this", "aria-label": `Use this picture to search: ${name}` });
  const card = make("li", { class: "hit" }, button, alike);
  card.dataset.id = hit.image_id;
  return card;
}

export function labelList(metadata) {
  const entries = Object.entries(metadata ?? {});
  if (!entries.length) return null;
  const text = (value) => (typeof value === "object" ? JSON.stringify(value) : String(value));
  return make("span", { class: "labels" },
              ...entries.map(([key, value]) => make("span", { text: `${key}: ${text(value)}` })));
}

const cards = () => [...strong.children, ...weak.children];

export function clearHits() {
  strong.replaceChildren();
  weak.replaceChildren();
  fold(true);
}

// Adds hits to the lists. colours: Map of image ids, for hits that are outlined.
export function addHits(hits, colours, onChoose) {
  for (const hit of hits) {
    (isWeak(hit) ? weak : strong).append(hitCard(hit, colours.get(hit.image_id), onChoose));
  }
}

// `left`: hits of the server that have not been asked for yet.
export function showRest(left) {
  const weaker = weak.children.length ? weak.children.length + left : 0;
  toggle.hidden = !weaker;
  toggle.textContent = `${weaker.toLocaleString("en")} weaker result${weaker === 1 ? "" : "s"}`;
  const folded = weaker > 0 && weak.hidden;
  byId("results-more").hidden = left === 0 || folded;
  byId("results-empty").hidden = strong.children.length > 0;
  byId("results-empty").textContent =
    weaker ? "Nothing is alike enough to be it." : "Nothing alike is in the collection, or the filters leave nothing over.";
}

function fold(on) {
  weak.hidden = on;
  toggle.setAttribute("aria-expanded", String(!on));
}

// onFold() is called after the weak hits were folded or unfolded.
export function whenFolded(onFold) {
  toggle.addEventListener("click", () => {
    fold(!weak.hidden);
    onFold();
  });
}

export function markChosen(id, visibly = false) {
  for (const card of cards()) {
    const chosen = card.dataset.id === id;
    card.querySelector(".hit-choose").setAttribute("aria-pressed", String(chosen));
    if (chosen && visibly) card.scrollIntoView({ block: "nearest" });
  }
}

// The hit that was added as number `i`, 0 being the first: hits come with the sure ones first. Where it is
// folded away, what unfolds it.
export function focusHit(i) {
  const card = cards()[i] ?? cards().at(-1);
  const place = weak.hidden && card?.parentElement === weak ? toggle : card?.querySelector("button");
  place?.focus();
}
