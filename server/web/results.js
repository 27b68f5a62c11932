// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The lists of hits: those that count, and the weak ones, folded away.
import { imagePath, showImage } from "./api.js";
import { byId, count, make, makeButton, resultOr, shorten } from "./dom.js";
import { filterParameters } from "./filters.js";
import { link } from "./router.js";
import { t } from "./texts.js";
import { isWeak, scoreWords } from "./words.js";

const strong = byId("results");
const weak = byId("weaker");
const toggle = byId("weaker-toggle");

// A stored image, or an empty frame if it cannot be shown. With the sha256 of its record, the browser caches the preview.
export function thumbnail(id, sha256 = "") {
  const image = make("img", { alt: "", loading: "lazy", width: 320, height: 240 });
  image.addEventListener("error", () => image.replaceWith(make("span", { class: "blank" })), { once: true });
  showImage(image, imagePath(id, sha256 ? `/thumbnail?sha256=${sha256}` : "/thumbnail"));
  return image;
}

// The address of a label url=https://…, which becomes a link; null for all else, such as javascript:.
function webAddress(key, value) {
  const url = key === "url" ? resultOr(null, () => new URL(value)) : null;
  return /^https?:$/.test(url?.protocol) ? url.href : null;
}

export function labelList(metadata) {
  const entries = Object.entries(metadata ?? {});
  if (!entries.length) return null;
  const text = (value) => (typeof value === "object" ? JSON.stringify(value) : String(value));
  return make("span", { class: "labels" }, ...entries.map(([key, value]) => {
    const href = webAddress(key, value);
    return make("span", {}, `${key}: `,
                href ? make("a", { href, target: "_blank", rel: "noopener noreferrer", text: shorten(value, 60) }) : text(value));
  }));
}

function hitCard(hit, colour, onChoose) {
  const { words, grade, share, percent } = scoreWords(hit);
  const facts = [percent, hit.inliers ? count(hit.inliers, "matched keypoint") : ""].filter(Boolean).join(", ");
  const swatch = colour ? make("span", { class: "swatch", "aria-hidden": "true" }) : null;
  if (swatch) swatch.style.background = colour;
  const fill = make("span", { class: `fill ${grade}` });
  fill.style.width = `${Math.round(100 * Math.max(0, Math.min(1, share)))}%`;
  const button = makeButton("", () => onChoose(hit), { class: "hit-choose", "aria-pressed": "false" });
  button.append(thumbnail(hit.image_id), make("span", { class: "hit-text" },
    make("span", { class: "name" }, swatch, `${hit.rank}. ${hit.name}`), make("span", { text: words }),
    make("span", { class: "bar", "aria-hidden": "true" }, fill), make("span", { class: "quiet", text: facts })));
  const page = hit.object ? ["object", { name: hit.object }] : ["image", { id: hit.image_id }];
  const card = make("li", { class: "hit" }, button, labelList(hit.metadata), make("div", { class: "links quiet" },
    make("a", { href: link(...page), text: hit.object ? t`Open object` : t`Open image`,
                "aria-label": hit.object ? t`Open object ${hit.name}` : t`Open image ${hit.name}` }),
    make("a", { href: link("search", { image: hit.image_id, ...filterParameters() }), text: t`Find similar`, "aria-label": t`Find similar to ${hit.name}` })));
  card.dataset.id = hit.image_id;
  return card;
}

const cards = () => [...strong.children, ...weak.children];

export function clearHits() {
  strong.replaceChildren();
  weak.replaceChildren();
  fold(true);
}

// colours: Map of image ids, for hits that are outlined.
export function addHits(hits, colours, onChoose) {
  for (const hit of hits) (isWeak(hit) ? weak : strong).append(hitCard(hit, colours.get(hit.image_id), onChoose));
}

// `left`: hits of the server that the page has not asked for yet.
export function showRest(left) {
  const weaker = weak.children.length ? weak.children.length + left : 0;
  toggle.hidden = !weaker;
  toggle.textContent = count(weaker, "weaker result");
  byId("results-more").hidden = left === 0 || (weaker > 0 && weak.hidden);
  byId("results-empty").hidden = strong.children.length > 0;
}

function fold(on) {
  weak.hidden = on;
  toggle.setAttribute("aria-expanded", String(!on));
}

// onFold() is called after the weak hits were folded or unfolded.
export const whenFolded = (onFold) => toggle.addEventListener("click", () => {
  fold(!weak.hidden);
  onFold();
});

export function markChosen(id, visibly = false) {
  for (const card of cards()) {
    const chosen = card.dataset.id === id;
    card.querySelector(".hit-choose").setAttribute("aria-pressed", String(chosen));
    if (chosen && visibly) card.scrollIntoView({ block: "nearest" });
  }
}

// The hit that was added as number `i`, from 0; if it is folded away, the button that unfolds it.
export function focusHit(i) {
  const card = cards()[i] ?? cards().at(-1);
  (weak.hidden && card?.parentElement === weak ? toggle : card?.querySelector("button"))?.focus();
}
