// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The search view: from a photo to hits.
import { take } from "./add.js";
import * as api from "./api.js";
import { hideComparison, showComparison } from "./compare.js";
import { refreshDemonstration, whenExampleIsChosen } from "./demo.js";
import { byId, copyText, count, make, say, sayError } from "./dom.js";
import { decode, storedImage } from "./draw.js";
import { filterParameters, filterSettings, forgetLimits, isFiltered, takeFilters, whenFiltersChange } from "./filters.js";
import { accept, fileOfData, refuseOther } from "./incoming.js";
import { keepQuery, keptQuery } from "./kept.js";
import { objectName } from "./names.js";
import { regionParameter, resetRegion, whenRegionIsWanted } from "./region.js";
import { addHits, clearHits, focusHit, markChosen, showRest, whenFolded } from "./results.js";
import { link, noteAddress, pushAddress, showing } from "./router.js";
import { coloursOf, drawStage, whenHitIsPicked } from "./stage.js";
import { t } from "./texts.js";
import { isLeaving, notify } from "./undo.js";
import { adviceWords, isWeak, verdictWords } from "./words.js";

const kCloserMs = 1000;  // the server's second pass begins about then
const status = byId("search-status");

// { file }, { id } or { url }; `bitmap`: its decoded pixels; `part`: the region in its address. The pixels of a url, or of a
// kind that the browser cannot read, come with the first answer.
let query = null;
let running = null;  // AbortController of the current search
let asked = "";      // the collection of the query
let hits = [];       // each with its name
let chosen = null;   // the hit that is compared
let mistyped = false;  // the last filter could not be read, or nothing in the collection has what it names
let latest = null;   // the last file that was given, before it is searched with
let received = 0, total = 0;  // hits of the server, including hits that are being deleted

// --- the photo

// Shows the photo, and searches with it.
async function setQuery(next) {
  running?.abort();
  query = next;
  forgetHits();
  say(status, "");
  asked = api.collectionName();
  byId("workspace").hidden = byId("query-figure").hidden = false;
  byId("results-panel").hidden = true;
  byId("view-search").classList.add("has-query");
  byId("share").hidden = !next.id;
  resetRegion(0, 0);
  const [bitmap, record] = next.file ? [await decode(next.file)] : next.id ? await Promise.all(
    [storedImage(api.imagePath(next.id)), api.ask(api.imagePath(next.id))].map((one) => one.catch(() => null))) : [];
  if (query !== next) return;
  if (bitmap) {
    const { width, height } = record ?? bitmap;
    Object.assign(next, { bitmap, width, height });
    resetRegion(width, height, next.part);
  }
  byId("stage").hidden = !bitmap;
  drawStage(query, [], null);
  run();
}

// --- the search

const regionWanted = () => (query.bitmap ? regionParameter() : query.part || undefined);

// The address of the search with all its limits: Reload, Back and a link give the same answer.
const searchLink = () => link("search", { photo: query.key, image: query.id, url: query.url, part: regionWanted(), ...filterParameters() });

async function run(offset = 0) {
  if (!query) return;
  running?.abort();
  const mine = running = new AbortController();
  if (query.key || query.id || query.url) noteAddress(searchLink());
  byId("workspace").setAttribute("aria-busy", "true");
  say(status, t`Searching…`);
  const closer = setTimeout(() => { if (mine === running) say(status, t`Looking closer…`); }, kCloserMs);
  try {
    mistyped = true;
    const settings = { ...filterSettings(), offset, explain: true };
    mistyped = false;
    if (!query.bitmap && !query.id) settings.preview = true;
    const region = regionWanted();
    if (region) settings.region = region.split(",").map(Number);
    const answer = await api.search(query, settings, mine.signal);
    if (answer.query?.preview) await showPreview(answer.query, mine);
    if (mine === running) showAnswer(answer, offset, { inPart: Boolean(region), grouped: settings.group_by === "object" });
  } catch (error) {
    if (error.name === "AbortError" || mine !== running) return;
    sayError(status, error, () => run(offset));
    forgetHits();
    drawStage(query, [], null);
    byId("query-figure").hidden = !query.bitmap;  // it comes with an answer only
    byId("results-panel").hidden = true;
  } finally {
    clearTimeout(closer);
    if (mine === running) byId("workspace").removeAttribute("aria-busy");
  }
}

// The photo as the server decoded it.
async function showPreview({ preview, width, height }, mine) {
  const bitmap = await decode(fileOfData(preview));
  if (mine !== running || !bitmap) return;
  Object.assign(query, { bitmap, width, height });
  resetRegion(width, height, query.part);
  byId("stage").hidden = byId("query-figure").hidden = false;
}

function forgetHits() {
  hits = [];
  chosen = null;
  clearHits();
  hideComparison();
}

const isStored = (hit) => !isLeaving(api.imagePath(hit.image_id)) && !isLeaving(api.objectPath(hit.object));
const named = (hit) => ({ ...hit, name: objectName(hit.object, hit.source) });

function showAnswer(answer, offset, how) {
  const fresh = answer.hits.filter(isStored).map(named);
  if (!offset) forgetHits();
  const before = hits.length;
  received = offset + answer.hits.length;
  total = answer.hits.length ? answer.total : received;
  mistyped = !received && !("min_score" in filterParameters());
  hits.push(...fresh);
  addHits(fresh, coloursOf(hits), choose);
  byId("results-panel").hidden = false;
  showRest(total - received);
  const said = { hits, found: answer.found, filtered: isFiltered(), stored: Boolean(query.id), ...how };
  const possible = hits.filter((hit) => !isWeak(hit)).length;
  const matches = answer.found ? count(answer.found, "match", "matches") : possible ? count(possible, "possible match", "possible matches") : t`No match`;
  const mirrored = answer.mirrored ? t`Your photo is mirrored.` : "";
  const quiet = [t`${matches} in ${(answer.took_ms / 1000).toFixed(2)} s.`, mirrored, adviceWords(said)];
  say(status, "");
  status.append(make("strong", { class: "verdict", text: verdictWords(said) }), make("span", { class: "quiet", text: quiet.filter(Boolean).join(" ") }));
  if (!offset && hits.length && !isWeak(hits[0])) choose(hits[0]);
  else drawStage(query, hits, chosen);
  if (offset) focusHit(before);
  else showVerdict();
}

// In a small window the answer must not stay below the edge.
function showVerdict() {
  const { top } = status.getBoundingClientRect();
  if (top < 0 || top > innerHeight / 2) status.scrollIntoView({ block: "start" });
}

function choose(hit, visibly = false) {
  chosen = hit;
  drawStage(query, hits, hit);
  showComparison(hit, query.bitmap ? query : null);
  markChosen(hit.image_id, visibly);
}

// Back to the empty view.
function forget() {
  running?.abort();
  query = null;
  forgetHits();
  byId("workspace").hidden = true;
  byId("view-search").classList.remove("has-query");
  say(status, "");
}

// --- ways in

// Reading a file may take long. Meanwhile people go elsewhere or give another one.
async function searchFile(file) {
  if (!file) return;
  latest = file;
  const isWanted = () => latest === file && showing() === "search";
  try {
    await refuseOther(file);
  } catch (error) {
    if (isWanted()) say(status, error.message, true);
    return;
  }
  const key = await keepQuery(file);
  if (!isWanted()) return;
  if (mistyped) forgetLimits();
  pushAddress(link("search", { photo: key, ...filterParameters() }));
  setQuery({ file, key });
}

// Several images: added, or only the first is searched with. An empty collection has nothing to find.
async function takeMany(given, images) {
  const n = count(images.length, "image");
  const words = given.how === "dropped" ? t`You dropped ${n}.` : t`You pasted ${n}.`;
  const first = () => searchFile(images[0].file);
  if (!await api.mayWrite()) {
    notify(t`${words} Pliant searches with the first, because your key does not allow adding.`);
    first();
  } else if (byId("welcome").hidden) {
    const dialog = byId("many-dialog");
    byId("many-text").textContent = t`${words} Add all of them, or search with the first?`;
    dialog.returnValue = "";
    dialog.onclose = () => ({ add: () => take(given), search: first })[dialog.returnValue]?.();
    dialog.showModal();
  } else {
    take(given);
  }
}

accept(byId("view-search"), ["search-file", "search-camera"], (given) => {
  const { files, stored, address, problem } = given;
  if (stored) location.hash = link("search", { image: stored.id, in: stored.collection });
  else if (address) location.hash = link("search", { url: address });
  else if (problem) say(status, problem, true);
  else {
    const images = files.filter(({ file }) => /^(image\/|$)/.test(file.type));
    if (images.length > 1) takeMany(given, images);
    else searchFile((images[0] ?? files[0]).file);
  }
});

whenExampleIsChosen(searchFile);
whenFolded(() => showRest(total - received));
whenHitIsPicked((hit) => choose(hit, true));
whenRegionIsWanted(() => run());
whenFiltersChange(() => run());
byId("results-more").addEventListener("click", () => run(received));
byId("share").addEventListener("click", async () => {
  const address = new URL(searchLink(), location.href).href;
  notify(await copyText(address) ? t`Link copied.` : t`Link: ${address}`);
});

// An earlier search of this browser: Reload and Back lead here.
async function showKept(key, part, greeted) {
  const file = await keptQuery(key);
  if (!file) {
    forget();
    await greeted;  // its words would replace these
    say(status, t`This browser no longer keeps that photo. Choose the photo again.`, true);
  } else {
    await setQuery({ file, key, part });
  }
}

export const searchView = {
  title: t`Search`,
  async show(parameters) {
    latest = null;
    const greeted = refreshDemonstration();
    const [id, key, url, part] = ["image", "photo", "url", "part"].map((name) => parameters.get(name) ?? "");
    const isOther = () => takeFilters(parameters) || asked !== api.collectionName() || part !== (regionParameter() ?? "");
    if (key) {
      if (isOther() || query?.key !== key) await showKept(key, part, greeted);
    } else if (id || url) {
      if (isOther() || query?.id !== id && query?.url !== url) await setQuery(id ? { id, part } : { url, part });
    } else if (query) {
      forget();
    }
  },
};
