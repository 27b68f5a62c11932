// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The search view: a picture in, hits out.
import * as api from "./api.js";
import { hideComparison, showComparison } from "./compare.js";
import { refreshDemonstration, whenExampleIsChosen } from "./demo.js";
import { readable } from "./convert.js";
import { byId, count, make, say } from "./dom.js";
import { decode, storedPicture } from "./draw.js";
import { filterParameters, filterSettings, isFiltered, takeFilters, whenFiltersChange } from "./filters.js";
import { acceptDrops, acceptPastes, fileOfData } from "./incoming.js";
import { keepQuery, keptQuery } from "./kept.js";
import { objectName } from "./names.js";
import { regionParameter, resetRegion, whenRegionIsWanted } from "./region.js";
import { addHits, clearHits, focusHit, markChosen, showRest, whenFolded } from "./results.js";
import { link, noteAddress, pushAddress, showing } from "./router.js";
import { coloursOf, drawStage, whenHitIsPicked } from "./stage.js";
import { isLeaving, notify } from "./undo.js";
import { adviceWords, isWeak, sharing, verdictWords } from "./words.js";

const status = byId("search-status");

// What is asked with: { file }, { id } or { url }, its decoded picture, and the part that the address limits it to. The
// picture of an address, or of a kind that the browser cannot read, comes with the first answer.
let query = null;
let running = null;  // AbortController of the search on its way
let asked = "";      // the collection that was asked
let hits = [];       // each with its name
let chosen = null;   // the hit that is compared
let latest = null;   // the file that was given last, and not yet asked with
let received = 0, total = 0;  // hits of the server, those on their way out included

// --- the query picture

async function setQuery(next) {
  running?.abort();
  query = next;
  forgetHits();
  say(status, "");
  asked = api.collectionName();
  byId("workspace").hidden = false;
  byId("view-search").classList.add("has-query");
  byId("share").hidden = !next.id;
  byId("results-panel").hidden = true;
  byId("query-figure").hidden = false;
  resetRegion(0, 0);
  const picture = next.file ? await decode(next.file) :
    next.id ? await storedPicture(api.imagePath(next.id)).catch(() => null) : null;
  if (query !== next) return false;
  if (picture) {
    const record = next.id ? await api.ask(api.imagePath(next.id)).catch(() => null) : null;
    if (query !== next) return false;
    next.picture = picture;
    next.width = record?.width ?? picture.width;
    next.height = record?.height ?? picture.height;
    resetRegion(next.width, next.height, next.part);
  }
  byId("stage").hidden = !picture;
  drawStage(query, [], null);
  return true;
}

// --- asking

const regionWanted = () => (query.picture ? regionParameter() : query.part || undefined);

// The address of what is asked, with all that limits it: Reload, Back and a link lead to the same answer.
const searchLink = () => link("search", { photo: query.key, image: query.id, url: query.url, part: regionWanted(),
                                          ...filterParameters() });

async function run(offset = 0) {
  if (!query) return;
  running?.abort();
  const mine = running = new AbortController();
  if (query.key || query.id || query.url) noteAddress(searchLink());
  byId("workspace").setAttribute("aria-busy", "true");
  say(status, "Searching…");
  try {
    const settings = { ...filterSettings(), offset, explain: true };
    if (!query.picture && !query.id) settings.preview = true;
    const region = regionWanted();
    if (region) settings.region = region;
    const answer = await api.search(query, settings, mine.signal);
    if (answer.query?.preview) await showPreview(answer.query, mine);
    const grouped = settings.group_by === "object";
    if (mine === running) showAnswer(answer, offset, { inPart: Boolean(region), grouped });
  } catch (error) {
    if (error.name === "AbortError" || mine !== running) return;
    showFailure(error);
  } finally {
    if (mine === running) byId("workspace").removeAttribute("aria-busy");
  }
}

// The query as the server gives it: what it has fetched, or what the browser cannot read.
async function showPreview({ preview, width, height }, mine) {
  const picture = await decode(fileOfData(preview));
  if (mine !== running || !picture) return;
  Object.assign(query, { picture, width, height });
  resetRegion(width, height, query.part);
  byId("stage").hidden = byId("query-figure").hidden = false;
}

function showFailure(error) {
  say(status, error.message, true);
  forgetHits();
  drawStage(query, [], null);
  byId("query-figure").hidden = !query.picture;  // it comes with an answer, or not at all
  byId("results-panel").hidden = true;
}

function forgetHits() {
  hits = [];
  chosen = null;
  clearHits();
  hideComparison();
}

const isGone = (hit) => isLeaving(api.imagePath(hit.image_id)) ||
                        isLeaving(api.address(`/objects/${encodeURIComponent(hit.object)}`));

const named = (hit) => ({ ...hit, name: objectName(hit.object, hit.source) });

function showAnswer(answer, offset, how) {
  const fresh = (answer.verdict === "undecided" && !offset ? sharing(answer.hits) : answer.hits)
    .filter((hit) => !isGone(hit)).map(named);
  if (!offset) forgetHits();
  const before = hits.length;
  received = offset + answer.hits.length;
  total = answer.hits.length ? answer.total : received;
  hits.push(...fresh);
  addHits(fresh, coloursOf(hits), choose);
  byId("results-panel").hidden = false;
  showRest(total - received);
  const said = { hits, found: answer.found, filtered: isFiltered(), stored: Boolean(query.id), ...how };
  const results = count(answer.total, hits.length && hits.every(isWeak) ? "weak result" : "result");
  say(status, "");
  status.append(make("strong", { class: "verdict", text: verdictWords(said) }),
                make("span", { class: "quiet", text: ` ${results} in ${(answer.took_ms / 1000).toFixed(2)} s` }));
  const advice = adviceWords(said);
  if (advice) status.append(make("span", { class: "quiet advice", text: ` ${advice}` }));
  if (!offset && hits.length && !isWeak(hits[0])) choose(hits[0]);
  else drawStage(query, hits, chosen);
  if (offset) focusHit(before);
  else showVerdict();
}

// Where the window is small, the answer must not stay below its edge.
function showVerdict() {
  const { top } = status.getBoundingClientRect();
  if (top < 0 || top > innerHeight / 2) status.scrollIntoView({ block: "start" });
}

function choose(hit) {
  chosen = hit;
  markChosen(hit.image_id);
  drawStage(query, hits, hit);
  showComparison(hit, query.picture ? query : null);
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

// A picture may take long to be read: whoever has gone elsewhere or given another one meanwhile wants that.
async function searchFile(given) {
  if (!given) return;
  latest = given;
  const isWanted = () => latest === given && showing() === "search";
  let file = null;
  try {
    file = await readable(given);
  } catch (error) {
    if (isWanted()) say(status, error.message, true);
    return;
  }
  const key = await keepQuery(file);
  if (!isWanted()) return;
  pushAddress(link("search", { photo: key, ...filterParameters() }));
  if (await setQuery({ file, key })) run();
}

for (const id of ["search-file", "search-camera"]) {
  byId(id).addEventListener("change", (event) => {
    searchFile(event.target.files[0]);
    event.target.value = "";  // so that the same file can be chosen again
  });
}
function searchReceived({ files, stored, address, problem }) {
  const here = stored?.collection === api.collectionName();
  if (stored) location.hash = link("search", { image: stored.id, ...(!here && { in: stored.collection }) });
  else if (address) location.hash = link("search", { url: address });
  else if (problem) say(status, problem, true);
  else searchFile((files.find(({ file }) => file.type.startsWith("image/")) ?? files[0]).file);
}
acceptDrops(byId("view-search"), searchReceived);
acceptPastes(byId("view-search"), searchReceived);

whenExampleIsChosen(searchFile);
whenFolded(() => showRest(total - received));
whenHitIsPicked((hit) => {
  choose(hit);
  markChosen(hit.image_id, true);
});
whenRegionIsWanted(() => run());
whenFiltersChange(() => run());
byId("results-more").addEventListener("click", () => run(received));
byId("share").addEventListener("click", async () => {
  const address = new URL(searchLink(), location.href).href;
  try {
    await navigator.clipboard.writeText(address);
    notify("The link is copied.");
  } catch {  // not allowed without https, for example
    notify(`The link: ${address}`);
  }
});

// A search that was made in this browser before: Reload and Back lead here.
async function showKept(key, part, greeted) {
  const file = await keptQuery(key);
  if (!file) {
    forget();
    await greeted;  // its words would take the place of these
    say(status, "That picture is no longer kept in this browser. Choose it once more.", true);
  } else if (await setQuery({ file, key, part })) {
    run();
  }
}

export const searchView = {
  title: "Search",
  async show(parameters) {
    latest = null;
    const greeted = refreshDemonstration();
    const id = parameters.get("image");
    const key = parameters.get("photo");
    const url = parameters.get("url");
    const part = parameters.get("part") ?? "";
    const isOther = () => takeFilters(parameters) || asked !== api.collectionName() || part !== (regionParameter() ?? "");
    if (id) {
      if ((isOther() || query?.id !== id) && await setQuery({ id, part })) run();
    } else if (key) {
      if (isOther() || query?.key !== key) await showKept(key, part, greeted);
    } else if (url) {
      if ((isOther() || query?.url !== url) && await setQuery({ url, part })) run();
    } else if (query) {
      forget();
    }
  },
};
