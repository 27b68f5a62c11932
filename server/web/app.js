// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page: search, add, browse.
import * as api from "./api.js";
import { drawQuery, element, hitCard, pictureCard } from "./results.js";

const byId = (id) => document.getElementById(id);
const count = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

function say(place, text, isError = false) {
  place.textContent = text;
  place.classList.toggle("error", isError);
}

async function refreshSummary() {
  try {
    const { images, objects, vocabulary } = await api.collection();
    const words = vocabulary ? `, ${count(vocabulary.words, "visual word")}` : "";
    say(byId("summary"), `${count(images, "picture")} of ${count(objects, "object")}${words}`);
    byId("welcome").hidden = images > 0;
  } catch (error) {
    say(byId("summary"), error.message, true);
  }
}

// --- search

let lastSearch = 0;  // answers of earlier searches are dropped

async function runSearch(file) {
  const number = ++lastSearch;
  const button = byId("search-button");
  const status = byId("search-status");
  button.disabled = true;
  byId("query").hidden = true;
  byId("results").replaceChildren();
  say(status, "Searching…");
  try {
    const answer = await api.search(file, {
      group_by: byId("group-by").value,
      limit: "12",
    });
    if (number !== lastSearch) return;
    await showAnswer(file, answer);
  } catch (error) {
    if (number === lastSearch) say(status, error.message, true);
  } finally {
    if (number === lastSearch) button.disabled = false;
  }
}

async function showAnswer(file, answer) {
  const { hits, took_ms: tookMs } = answer;
  const drawn = await drawQuery(byId("query-canvas"), file, hits);
  byId("query").hidden = !drawn;
  byId("query-caption").textContent =
    drawn?.polygon ? `The outline shows where "${drawn.object}" was found.` : "Your picture";
  byId("results").replaceChildren(
    ...hits.map((hit) => hitCard(hit, hits[0].score)));
  const found = hits.length
    ? `Best: ${hits[0].object || "(no name)"}. ${count(answer.total, "result")}`
    : "Nothing alike was found";
  say(byId("search-status"), `${found}, in ${(tookMs / 1000).toFixed(2)} s.`);
}

byId("search-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const [file] = byId("search-file").files;
  if (file) runSearch(file);
  else say(byId("search-status"), "Choose a picture first.", true);
});

byId("search-file").addEventListener("change", () => {
  const [file] = byId("search-file").files;
  if (file) runSearch(file);
});

document.addEventListener("paste", (event) => {
  const file = [...event.clipboardData.files].find((item) => item.type.startsWith("image/"));
  if (file) runSearch(file);
});

// --- add

async function addOne(file, object, log) {
  const line = element("li", "", `${file.name}: …`);
  log.append(line);
  try {
    const image = await api.addPicture(file, object);
    line.textContent = `${file.name}: added, ${count(image.keypoints, "key point")}`;
  } catch (error) {
    line.textContent = `${file.name}: ${error.message}`;
    line.className = "error";
  }
}

async function addAll(files, object) {
  const log = byId("add-log");
  const bar = byId("add-bar");
  log.replaceChildren();
  byId("add-progress").hidden = false;
  bar.max = files.length;
  for (const [done, file] of files.entries()) {
    bar.value = done;
    byId("add-label").textContent = `Adding ${done + 1} of ${files.length}…`;
    await addOne(file, object, log);
  }
  bar.value = files.length;
  byId("add-label").textContent = "Done.";
  await Promise.all([refreshSummary(), refreshPictures()]);
}

byId("add-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const files = [...byId("add-files").files];
  if (!files.length) {
    byId("add-log").replaceChildren(element("li", "error", "Choose pictures first."));
    return;
  }
  const button = event.target.querySelector("button");
  button.disabled = true;
  try {
    await addAll(files, byId("object-name").value.trim());
  } finally {
    button.disabled = false;
  }
});

// --- browse

let nextPage = null;

function browseCard(image) {
  const name = image.object || "(no name)";
  const { card, text } = pictureCard(image.id, name);
  text.append(element("p", "soft", image.source || image.id.slice(0, 12)));
  const button = element("button", "", "Delete");
  button.type = "button";
  button.setAttribute("aria-label", `Delete picture ${image.source || image.id} of ${name}`);
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      await api.deletePicture(image.id);
      const neighbour = card.nextElementSibling ?? card.previousElementSibling;
      card.remove();
      (neighbour?.querySelector("button") ?? byId("main")).focus();
      refreshSummary();
    } catch (error) {
      button.disabled = false;
      text.append(element("p", "error", error.message));
    }
  });
  card.append(button);
  return card;
}

async function showPage(cursor) {
  try {
    const { images, next } = await api.listPictures(cursor);
    nextPage = next;
    byId("more").hidden = !next;
    byId("pictures").append(...images.map(browseCard));
    if (!byId("pictures").children.length) {
      byId("pictures").append(element("li", "", "None yet."));
    }
  } catch (error) {
    byId("pictures").append(element("li", "error", error.message));
  }
}

function refreshPictures() {
  byId("pictures").replaceChildren();
  return showPage(null);
}

byId("more").addEventListener("click", () => showPage(nextPage));

// --- drop a picture on either frame

for (const [frame, input] of [["search-drop", "search-file"], ["add-drop", "add-files"]]) {
  const place = byId(frame);
  place.addEventListener("dragover", (event) => {
    event.preventDefault();
    place.classList.add("over");
  });
  place.addEventListener("dragleave", () => place.classList.remove("over"));
  place.addEventListener("drop", (event) => {
    event.preventDefault();
    place.classList.remove("over");
    byId(input).files = event.dataTransfer.files;
    byId(input).dispatchEvent(new Event("change"));
  });
}

refreshSummary();
refreshPictures();
