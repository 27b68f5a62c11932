// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The search view: a picture in, hits out.
import * as api from "./api.js";
import { hideComparison, showComparison } from "./compare.js";
import { refreshDemonstration, whenExampleIsChosen } from "./demo.js";
import { acceptDrops, byId, count, say } from "./dom.js";
import { decode, drawOutline, drawPoints, fitCanvas, storedPicture } from "./draw.js";
import { filterSettings, whenFiltersChange } from "./filters.js";
import { regionParameter, resetRegion, whenRegionIsWanted } from "./region.js";
import { hitCard, markChosen, objectName } from "./results.js";
import { link } from "./router.js";
import { isLeaving, notify } from "./undo.js";

const status = byId("search-status");
const list = byId("results");

// What is asked with: { file } or { id }, and its decoded picture where the browser can show it.
let query = null;
let running = null;  // AbortController of the search on its way
let asked = "";      // the collection that was asked
let hits = [];
let received = 0;  // hits of the server, those on their way out included

// --- the query picture

async function setQuery(next) {
  running?.abort();
  query = next;
  hits = [];
  list.replaceChildren();
  hideComparison();
  say(status, "");
  asked = api.collectionName();
  byId("workspace").hidden = false;
  byId("view-search").classList.add("has-query");
  byId("share").hidden = !next.id;
  byId("results-panel").hidden = true;
  resetRegion(0, 0);
  const picture = next.file ? await decode(next.file) :
                              await storedPicture(api.imagePath(next.id)).catch(() => null);
  if (query !== next) return false;
  if (picture) {
    const record = next.id ? await api.ask(api.imagePath(next.id)).catch(() => null) : null;
    if (query !== next) return false;
    next.picture = picture;
    next.width = record?.width ?? picture.width;
    next.height = record?.height ?? picture.height;
    resetRegion(next.width, next.height);
  }
  byId("stage").hidden = !picture;
  drawStage(null);
  return true;
}

function drawStage(hit) {
  const canvas = byId("stage-canvas");
  const note = byId("stage-note");
  if (!query?.picture) {
    note.textContent = "This browser cannot show this kind of picture. Searching works all the same.";
    return;
  }
  const scale = fitCanvas(canvas, query.width, query.height);
  const context = canvas.getContext("2d");
  context.drawImage(query.picture, 0, 0, canvas.width, canvas.height);
  if (hit?.explain) drawPoints(context, hit.explain.pairs.map(([x, y]) => [x, y]), scale);
  // An object may be in the picture more than once.
  const outlines = hit ? [hit.polygon, ...(hit.instances ?? []).slice(1).map((one) => one.polygon)]
    .filter(Boolean) : [];
  for (const polygon of outlines) drawOutline(context, polygon, scale);
  const often = outlines.length > 1 ? `, ${outlines.length} times` : "";
  const found = outlines.length ? `Outlined: ${objectName(hit.object)}${often}` : "";
  note.textContent = found;
  canvas.setAttribute("aria-label", `Your picture${found && `. ${found}`}`);
}

// --- asking

async function run(offset = 0) {
  if (!query) return;
  running?.abort();
  const mine = running = new AbortController();
  byId("workspace").setAttribute("aria-busy", "true");
  say(status, "Searching…");
  try {
    const settings = { ...filterSettings(), offset, explain: true };
    const region = regionParameter();
    if (region) settings.region = region;
    const answer = await api.search(query, settings, mine.signal);
    if (mine === running) showAnswer(answer, offset, Boolean(region));
  } catch (error) {
    if (error.name === "AbortError" || mine !== running) return;
    showFailure(error);
  } finally {
    if (mine === running) byId("workspace").removeAttribute("aria-busy");
  }
}

function showFailure(error) {
  say(status, error.message, true);
  hits = [];
  list.replaceChildren();
  hideComparison();
  drawStage(null);
  byId("results-panel").hidden = true;
}

const isGone = (hit) => isLeaving(api.imagePath(hit.image_id)) ||
                        isLeaving(api.address(`/objects/${encodeURIComponent(hit.object)}`));

// What the answer comes to, in a sentence. `found` is null where the search does not verify.
function verdict({ found }, where) {
  if (!hits.length) return `Nothing found${where}. `;
  if (found === 0) return `Not in the collection${where}, as far as Pliant can tell. `;
  const best = objectName(hits[0].object);
  return found > 1 ? `Found${where}: ${best} and ${found - 1} more. ` : `${found ? "Found" : "Best"}${where}: ${best}. `;
}

function showAnswer(answer, offset, inPart) {
  const fresh = answer.hits.filter((hit) => !isGone(hit));
  if (!offset) {
    hits = [];
    list.replaceChildren();
  }
  const before = list.children.length;
  received = offset + answer.hits.length;
  hits.push(...fresh);
  list.append(...fresh.map((hit) => hitCard(hit, choose)));
  byId("results-panel").hidden = false;
  byId("results-more").hidden = received >= answer.total || !answer.hits.length;
  const empty = byId("results-empty");
  empty.hidden = hits.length > 0;
  empty.textContent = "Nothing alike is in the collection, or the filters leave nothing over.";
  const where = inPart ? " inside the part" : "";
  say(status, `${verdict(answer, where)}${count(answer.total, "result")} in ${(answer.took_ms / 1000).toFixed(2)} s.`);
  if (offset) list.children[before]?.querySelector("button").focus();
  else if (hits.length) choose(hits[0]);
  else {
    hideComparison();
    drawStage(null);
  }
}

function choose(hit) {
  markChosen(list, hit.image_id);
  drawStage(hit);
  showComparison(hit, query.picture ? query : null);
}

// Back to the empty view.
function forget() {
  running?.abort();
  query = null;
  byId("workspace").hidden = true;
  byId("view-search").classList.remove("has-query");
  say(status, "");
}

// --- ways in

async function searchFile(file) {
  if (!file) return;
  if (location.hash.includes("image=")) history.pushState(null, "", link("search"));
  if (await setQuery({ file })) run();
}

for (const id of ["search-file", "search-camera"]) {
  byId(id).addEventListener("change", (event) => {
    searchFile(event.target.files[0]);
    event.target.value = "";  // so that the same file can be chosen again
  });
}
acceptDrops(byId("view-search"), (dropped) => searchFile(dropped[0]?.file));
document.addEventListener("paste", (event) => {
  if (byId("view-search").hidden) return;
  searchFile([...event.clipboardData.files].find((file) => file.type.startsWith("image/")));
});

whenExampleIsChosen(searchFile);
whenRegionIsWanted(() => run());
whenFiltersChange(() => run());
byId("results-more").addEventListener("click", () => run(received));
byId("share").addEventListener("click", async () => {
  const address = new URL(link("search", { image: query.id }), location.href).href;
  try {
    await navigator.clipboard.writeText(address);
    notify("The link is copied.");
  } catch {  // not allowed without https, for example
    notify(`The link: ${address}`);
  }
});

export const searchView = {
  title: "Search",
  async show(parameters) {
    refreshDemonstration();
    const id = parameters.get("image");
    const elsewhere = asked !== api.collectionName();
    if (id) {
      if ((elsewhere || query?.id !== id) && await setQuery({ id })) run();
    } else if (query?.id || (query && elsewhere)) {
      forget();
    }
  },
};
