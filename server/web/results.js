// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The list of hits.
import { imagePath, showPicture } from "./api.js";
import { count, make } from "./dom.js";
import { link } from "./router.js";
import { scoreWords } from "./words.js";

export const objectName = (object) => object || "(no name)";

// A picture of the collection, or an empty frame where it cannot be shown.
export function thumbnail(id, alt = "") {
  const image = make("img", { alt, loading: "lazy", width: 320, height: 240 });
  image.addEventListener("error", () => image.replaceWith(make("span", { class: "blank" })),
                         { once: true });
  showPicture(image, imagePath(id, "/thumbnail"));
  return image;
}

function scoreBar(score, grade) {
  const fill = make("span", { class: `fill ${grade}` });
  fill.style.width = `${Math.round(100 * Math.max(0, Math.min(1, score)))}%`;
  return make("span", { class: "bar", "aria-hidden": "true" }, fill);
}

// Never 100 %: objects that share most of their print are told apart by little.
const percent = (probability) => (probability > 0.99 ? "> 99 %" : `${Math.round(100 * probability)} %`);

// onChoose(hit) is called when the hit is picked for comparison.
export function hitCard(hit, onChoose) {
  const { words, grade } = scoreWords(hit);
  const sureness = hit.probability ?? hit.score;
  const facts = [hit.probability === null ? `score ${sureness.toFixed(2)}` : percent(sureness)];
  if (hit.inliers) facts.push(`${count(hit.inliers, "point")} agree${hit.inliers === 1 ? "s" : ""}`);
  const button = make(
    "button", { type: "button", class: "hit-choose", "aria-pressed": "false",
                onclick: () => onChoose(hit) },
    thumbnail(hit.image_id),
    make("span", { class: "hit-text" },
         make("span", { class: "name", text: `${hit.rank}. ${objectName(hit.object)}` }),
         make("span", { class: "grade", text: words }), scoreBar(sureness, grade),
         make("span", { class: "quiet", text: facts.join(", ") }), labelList(hit.metadata)));
  const alike = make("a", { href: link("search", { image: hit.image_id }), class: "quiet",
                            text: "Use this",
                            "aria-label": `Use this picture to search: ${objectName(hit.object)}` });
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

export function markChosen(list, id) {
  for (const card of list.children) {
    card.querySelector(".hit-choose").setAttribute("aria-pressed", String(card.dataset.id === id));
  }
}
