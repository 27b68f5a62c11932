// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page of an image: large, with its record, its copies, and what can be done with it.
import * as api from "./api.js";
import { deleteButton, deleteHereButton, fileOf, imageLink } from "./cards.js";
import { attempt, byId, count, fact, fileSize, make, say, shortTime } from "./dom.js";
import { editButton } from "./edit.js";
import { objectName } from "./names.js";
import { labelList } from "./results.js";
import { link, makeBackLink, setTitle, showing } from "./router.js";
import { language, t } from "./texts.js";

const kCandidates = 24;  // hits that are checked as copies

let latest = 0;
let shownImage = null;
makeBackLink(byId("image-back"));

// Shows the original if the browser can, else the preview, else words.
function showLarge(image) {
  const frame = byId("image-frame");
  const large = make("img", { alt: `${objectName(image.object, image.source)}: ${fileOf(image)}`, width: image.width, height: image.height });
  large.addEventListener("error", () => {
    const small = make("img", { alt: large.alt, class: "preview" });
    small.addEventListener("error", () => frame.replaceChildren(
      make("p", { text: t`This image cannot be shown. The server does not store its original.` })), { once: true });
    frame.replaceChildren(small);
    byId("image-full").hidden = true;
    api.showImage(small, api.imagePath(image.id, "/thumbnail"));
  }, { once: true });
  byId("image-full").hidden = false;
  setFull(false);
  frame.replaceChildren(large);
  api.showImage(large, api.imagePath(image.id, `/content?sha256=${image.sha256}`));
}

function setFull(on) {
  byId("image-frame").classList.toggle("full", on);
  byId("image-full").setAttribute("aria-pressed", String(on));
}
byId("image-full").addEventListener("click", () => setFull(!byId("image-frame").classList.contains("full")));

function downloadLink(image) {
  const [kind, type] = image.media_type.split("/");
  const name = image.source || (kind === "image" ? `${image.id}.${type.replace("jpeg", "jpg")}` : image.id);
  return api.downloadLink(api.imagePath(image.id, "/content"), name, byId("image-status"), { class: "button" });
}

function showRecord(image) {
  const name = objectName(image.object, image.source);
  const objectLink = link("object", { name: image.object });
  byId("image-title").textContent = name;
  setTitle(name);
  byId("image-back").href = image.object ? objectLink : link("images");
  byId("image-edit").replaceChildren();
  byId("image-edit").classList.remove("editing");
  byId("image-facts").replaceChildren(
    fact(t`Object`, image.object ? make("a", { href: objectLink, text: image.object }) : t`no name`),
    ...(image.source ? [fact(t`File`, image.source)] : []),
    fact(t`Size`, `${image.width} × ${image.height}, ${fileSize(image.bytes)}`),
    fact(t`Keypoints`, image.keypoints.toLocaleString(language)),
    fact(t`Added`, shortTime(image.added_at)),
    fact(t`Id`, make("code", { text: image.id })));
  byId("image-labels").replaceChildren(labelList(image.metadata) ?? "");
  byId("image-actions").replaceChildren(
    make("a", { class: "button primary", href: link("search", { image: image.id }), text: t`Find similar` }),
    downloadLink(image), editButton({ card: byId("image-edit"), image, large: true, onChanged: showRecord }),
    deleteHereButton({ path: api.imagePath(image.id), label: t`Delete the image ${fileOf(image)} of ${name}`, text: t`Deleted: ${fileOf(image)}.`,
                       here: ["image", { id: image.id }], next: image.object ? ["object", { name: image.object }] : ["images"] }));
}

// --- copies: the same file, or the same photo resized or compressed again. The warp to a copy is no warp at all.

const kLeastTrusted = 0.6;   // share of the mesh that has to be trusted
const kMostOff = 0.015;      // of the diagonal: distance of a corner of the mesh from its place in a copy
const kMostOffShare = 0.05;  // of the corners may be further off

// hit: of a search with `image`, explained.
export function isNearCopy(hit, image) {
  const mesh = hit.explain?.mesh;
  if (!mesh) return false;
  const { columns, rows, points, trusted } = mesh;
  const diagonal = Math.hypot(image.width, image.height);
  let believed = 0, off = 0;
  for (const [i, [x, y]] of points.entries()) {
    if (trusted && !trusted[i]) continue;
    ++believed;
    // Pixel centres are at integers: the image reaches from -0.5 to width - 0.5.
    const across = ((i % columns) / (columns - 1)) * (mesh.reference_width - 1) + 0.5;
    const down = (Math.floor(i / columns) / (rows - 1)) * (mesh.reference_height - 1) + 0.5;
    const u = (across * image.width) / mesh.reference_width - 0.5;
    const v = (down * image.height) / mesh.reference_height - 0.5;
    if (Math.hypot(x - u, y - v) > kMostOff * diagonal) ++off;
  }
  return believed >= kLeastTrusted * points.length && off <= kMostOffShare * believed;
}

async function copyCard(hit, image) {
  const other = await api.ask(api.imagePath(hit.image_id));
  const words = other.sha256 === image.sha256 ? t`The same file, stored again` :
    isNearCopy(hit, image) ? t`Almost the same image: resized or compressed again` : null;
  if (!words) return null;
  const file = fileOf(other);
  const card = imageLink(other, "", make("span", { text: words, class: "quiet" }),
    make("span", { class: "quiet", text: `${file}, ${other.width} × ${other.height}, ${fileSize(other.bytes)}` }));
  card.append(make("div", { class: "row" }, deleteButton({ card, path: api.imagePath(other.id),
    label: t`Delete the copy ${file} of ${objectName(other.object, other.source)}`, text: t`Deleted: ${file}.` })));
  return card;
}

byId("copies-find").addEventListener("click", async () => {
  const [number, image] = [latest, shownImage];
  byId("copies-find").disabled = true;
  say(byId("copies-status"), t`Searching…`);
  await attempt(byId("copies-status"), async () => {
    const { hits } = await api.search({ id: image.id }, { group_by: "image", limit: kCandidates, explain: true })
      .catch((error) => { if (number === latest) throw error; return { hits: [] }; });
    const others = hits.filter((hit) => hit.inliers > 0 || hit.score > 0.9);
    const cards = (await Promise.all(others.map((hit) => copyCard(hit, image)))).filter(Boolean);
    if (number !== latest) return;
    byId("copies-list").replaceChildren(...cards);
    say(byId("copies-status"), cards.length ? t`${count(cards.length, "copy", "copies")} found.` : t`No copies found.`);
  });
  byId("copies-find").disabled = false;
});

export async function show(parameters) {
  const number = ++latest;
  byId("image-body").hidden = true;
  byId("image-title").textContent = t`Image`;
  byId("image-back").href = link("images");
  byId("copies-list").replaceChildren();
  say(byId("copies-status"), "");
  say(byId("image-status"), "");
  await attempt(byId("image-status"), async () => {
    const image = await api.ask(api.imagePath(parameters.get("id") ?? "")).catch((error) => { if (number === latest) throw error; });
    if (number !== latest || showing() !== "image") return;
    shownImage = image;
    byId("image-body").hidden = false;
    showRecord(image);
    showLarge(image);
  }, () => show(parameters));
}
