// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A picture's page: large, with what is known of it, its copies, and what can be done with it.
import * as api from "./api.js";
import { deleteButton, fileOf } from "./cards.js";
import { kindOfCopy } from "./copies.js";
import { byId, count, fileSize, make, say, shortTime } from "./dom.js";
import { editButton } from "./edit.js";
import { refreshHeader } from "./header.js";
import { objectName } from "./names.js";
import { labelList, thumbnail } from "./results.js";
import { go, link, makeBackLink, setTitle, showing } from "./router.js";
import { deleteLater, notify } from "./undo.js";

const kCandidates = 24;  // pictures that are looked at as copies
const kCopyWords = {
  same: "The same picture, stored twice",
  near: "Almost the same picture: at another size, or saved anew",
};

let latest = 0;
makeBackLink(byId("picture-back"));

// --- what it looks like

// The original where the browser can show it, else the preview, else words.
function showLarge(image) {
  const frame = byId("picture-frame");
  const large = make("img", { alt: `${objectName(image.object, image.source)}: ${fileOf(image)}`,
                              width: image.width, height: image.height });
  const preview = () => {
    const small = make("img", { alt: large.alt, class: "preview" });
    small.addEventListener("error", () => frame.replaceChildren(
      make("p", { text: "This picture cannot be shown: its original is not kept." })), { once: true });
    frame.replaceChildren(small);
    byId("picture-full").hidden = true;
    api.showPicture(small, api.imagePath(image.id, "/thumbnail"));
  };
  large.addEventListener("error", preview, { once: true });
  byId("picture-full").hidden = false;
  setFull(false);
  frame.replaceChildren(large);
  api.showPicture(large, api.imagePath(image.id, `/content?sha256=${image.sha256}`));
}

function setFull(on) {
  byId("picture-frame").classList.toggle("full", on);
  byId("picture-full").setAttribute("aria-pressed", String(on));
}
byId("picture-full").addEventListener("click", () => setFull(!byId("picture-frame").classList.contains("full")));

// --- what is known

const kEndings = { "image/jpeg": "jpg", "image/png": "png", "image/webp": "webp", "image/bmp": "bmp", "image/tiff": "tiff" };
const fact = (name, ...value) => make("div", {}, make("dt", { text: name }), make("dd", {}, ...value));

function showFacts(image) {
  byId("picture-facts").replaceChildren(...[
    fact("Shows", image.object ? make("a", { href: link("object", { name: image.object }), text: image.object }) : "no name"),
    image.source ? fact("File", image.source) : null,
    fact("Size", `${image.width} × ${image.height}, ${fileSize(image.bytes)}`),
    fact("Details", count(image.keypoints, "key point")),
    fact("Added", shortTime(image.added_at)),
    fact("Id", make("code", { text: image.id })),
  ].filter(Boolean));
  byId("picture-labels").replaceChildren(labelList(image.metadata) ?? "");
}

// --- what can be done

// A link to the file itself; with a key it has to be fetched: a link sends none.
function downloadLink(image) {
  const path = api.imagePath(image.id, "/content");
  const ending = kEndings[image.media_type];
  const name = image.source || (ending ? `${image.id}.${ending}` : image.id);
  const anchor = make("a", { class: "button", href: path, download: name, text: "Download" });
  anchor.addEventListener("click", async (event) => {
    if (!api.getKey()) return;
    event.preventDefault();
    try {
      const url = URL.createObjectURL(await api.pictureBlob(path));
      make("a", { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60_000);
    } catch (error) {
      say(byId("picture-status"), error.message, true);
    }
  });
  return anchor;
}

function remove(image) {
  const collection = api.collectionName();
  deleteLater({
    paths: [api.imagePath(image.id)], text: `Deleted: ${fileOf(image)}.`, done: refreshHeader,
    restore(error) {
      if (collection === api.collectionName()) go("picture", { id: image.id });
      if (error) notify(error.message, true);
    },
  });
  if (history.state?.inside) history.back();
  else if (image.object) go("object", { name: image.object });
  else go("pictures");
}

function showActions(image) {
  const name = objectName(image.object, image.source);
  byId("picture-actions").replaceChildren(
    make("a", { class: "button primary", href: link("search", { image: image.id }), text: "Find similar" }),
    downloadLink(image),
    editButton({ card: byId("picture-edit"), image, large: true, onChanged: (now) => showRecord(now) }),
    make("button", { type: "button", text: "Delete", "data-needs": "write", "aria-label": `Delete the picture ${fileOf(image)} of ${name}`,
                     onclick: () => remove(image) }));
}

function showRecord(image) {
  const name = objectName(image.object, image.source);
  byId("picture-title").textContent = name;
  setTitle(name);
  byId("picture-back").href = image.object ? link("object", { name: image.object }) : link("pictures");
  byId("picture-edit").replaceChildren();
  byId("picture-edit").classList.remove("editing");
  showFacts(image);
  showActions(image);
}

// --- copies

function copyCard(other, kind) {
  const name = objectName(other.object, other.source);
  const card = make("li", { class: "card" });
  card.append(
    make("a", { href: link("picture", { id: other.id }) }, thumbnail(other.id, other.sha256),
         make("span", { class: "name", text: name })),
    make("span", { text: kCopyWords[kind], class: "quiet" }),
    make("span", { class: "quiet", text: `${fileOf(other)}, ${other.width} × ${other.height}, ${fileSize(other.bytes)}` }),
    make("div", { class: "row" }, deleteButton({
      card, path: api.imagePath(other.id), label: `Delete the copy ${fileOf(other)} of ${name}`,
      text: `Deleted: ${fileOf(other)}.` })));
  return card;
}

async function findCopies(image, number) {
  const { hits } = await api.search({ id: image.id }, { group_by: "image", limit: kCandidates, explain: true });
  const others = hits.filter((hit) => (hit.inliers > 0 || hit.score > 0.9));
  const found = await Promise.all(others.map(async (hit) => {
    const record = await api.ask(api.imagePath(hit.image_id));
    const kind = kindOfCopy(hit, image, record);
    return kind && copyCard(record, kind);
  }));
  if (number !== latest) return;
  const cards = found.filter(Boolean);
  byId("copies-list").replaceChildren(...cards);
  say(byId("copies-status"), cards.length ? `${count(cards.length, "copy", "copies")} found.` :
                                            "No copy of this picture is in the collection.");
}

let shownImage = null;
byId("copies-find").addEventListener("click", async () => {
  const number = latest;
  byId("copies-find").disabled = true;
  say(byId("copies-status"), "Looking…");
  try {
    await findCopies(shownImage, number);
  } catch (error) {
    if (number === latest) say(byId("copies-status"), error.message, true);
  } finally {
    byId("copies-find").disabled = false;
  }
});

export const pictureView = {
  title: "Picture",
  async show(parameters) {
    const number = ++latest;
    const id = parameters.get("id") ?? "";
    byId("picture-body").hidden = true;
    byId("picture-title").textContent = "Picture";
    byId("picture-back").href = link("pictures");
    byId("copies-list").replaceChildren();
    say(byId("copies-status"), "");
    say(byId("picture-status"), "");
    try {
      const image = await api.ask(api.imagePath(id));
      if (number !== latest || showing() !== "picture") return;
      shownImage = image;
      byId("picture-body").hidden = false;
      showRecord(image);
      showLarge(image);
    } catch (error) {
      if (number !== latest) return;
      say(byId("picture-status"), error.status === 404 ? "This picture is no longer there." : error.message, true);
    }
  },
};
