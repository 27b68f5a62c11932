// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Drawing: cards, and the query picture with the outline of what was found in it.
import { thumbnail } from "./api.js";

// <tag class>text</tag>; text never becomes markup.
export function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

export function pictureCard(id, name) {
  const card = element("li", "card");
  const image = element("img");
  image.src = thumbnail(id);
  image.alt = name;
  image.loading = "lazy";
  image.addEventListener("error", () => image.replaceWith(element("div", "blank")), { once: true });
  const text = element("div", "text");
  text.append(element("p", "name", name));
  card.append(image, text);
  return { card, text };
}

// What a score is worth depends on the vocabulary, so it is set beside the best one.
export function hitCard(hit, best) {
  const name = hit.object || "(no name)";
  const { card, text } = pictureCard(hit.image_id, name);
  const meter = element("meter");
  meter.min = 0;
  meter.max = 1;
  meter.value = hit.score;
  meter.setAttribute("aria-label", `Score of ${name}`);
  const share = Math.round((100 * hit.score) / best);
  const beside = hit.score < best ? `, ${share} % of the best` : "";
  text.append(element("p", "soft", `${hit.rank}. score ${hit.score.toFixed(2)}${beside}`), meter);
  if (hit.inliers) text.append(element("p", "soft", `${hit.inliers} matching points`));
  return card;
}

function outline(context, polygon, scale) {
  context.beginPath();
  for (const [x, y] of polygon) context.lineTo((x + 0.5) * scale, (y + 0.5) * scale);
  context.closePath();
  for (const [width, colour] of [[6, "#000"], [3, "#ffd23f"]]) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.stroke();
  }
}

// Shows the query and the outline of the best hit that has one. A picture that the browser cannot
// show (TIFF, for example) is left out.
export async function drawQuery(canvas, file, hits) {
  let picture;
  try {
    picture = await createImageBitmap(file, { imageOrientation: "from-image" });
  } catch {
    return false;
  }
  const scale = Math.min(1, 960 / Math.max(picture.width, picture.height));
  canvas.width = Math.max(1, Math.round(picture.width * scale));
  canvas.height = Math.max(1, Math.round(picture.height * scale));
  const context = canvas.getContext("2d");
  context.drawImage(picture, 0, 0, canvas.width, canvas.height);
  picture.close();
  const outlined = hits.find((hit) => hit.polygon);
  if (outlined) outline(context, outlined.polygon, scale);
  return outlined ?? true;
}
