// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page of a collection: size, vocabularies, background jobs, and the other collections.
import * as api from "./api.js";
import { askingButton, attempt, byId, count, fact, figure, make, makeLiveList, onSubmit, say, shortTime, smallButton } from "./dom.js";
import { refreshHeader } from "./header.js";
import { isActive, makeJobList } from "./jobs.js";
import { collectionNameFor, shownName } from "./names.js";
import { go, link } from "./router.js";
import { makeSelfTest, showSelfTest } from "./selftest.js";
import { language, t } from "./texts.js";
import { notify } from "./undo.js";

const kPollMs = 2000;
const kFullSample = 40_000;  // descriptors that training samples by default
const kGrowth = 2;           // retraining pays from this many times as many descriptors

let timer = 0;
let latest = 0;  // drops an answer that comes too late

// Runs the action and says its words, if any, or what went wrong.
async function tell(action) {
  await action().then((text) => text && notify(text), ({ message }) => notify(message, true));
  refresh();
}

// --- size and vocabulary

function showFacts(record) {
  byId("collection-title").textContent = t`Collection: ${shownName(record)}`;
  const field = byId("collection-shown");
  field.placeholder = record.name;
  if (document.activeElement !== field) field.value = record.display_name ?? "";
  byId("collection-facts").replaceChildren(
    fact(t`Images`, figure(record.images)), fact(t`Objects`, figure(record.objects)), fact(t`Keypoints`, figure(record.descriptors)),
    fact(t`Visual words`, record.vocabulary ? figure(record.vocabulary.words) : t`none yet`),
    fact(t`Created`, new Date(record.created_at).toLocaleDateString(language, { dateStyle: "medium" })));
  const place = byId("collection-delete");
  if (place.dataset.name === record.name) return;  // its question stays open
  place.dataset.name = record.name;
  place.replaceChildren(record.name === "default" ? "" : askingButton(t`Delete collection`, t`Delete collection ${record.name}`, {
    question: t`Delete with all its images? This cannot be undone.`, yes: t`Delete all`, act: () => deleteCollection(record.name) }));
}

// What to do about the vocabulary: { text, due }.
export function recommendation({ images, descriptors, vocabulary }) {
  if (!images) return { text: t`Add images first. The vocabulary is trained on them.`, due: false };
  if (!vocabulary) return { text: t`There is no vocabulary yet, so a search finds nothing. Train one now.`, due: true };
  const growth = descriptors / Math.max(1, vocabulary.available);
  if (growth >= kGrowth && vocabulary.sampled < kFullSample) {
    return { due: true, text: t`Retraining is recommended. The vocabulary was trained on ${count(vocabulary.sampled, "keypoint")};
      the collection now has ${growth.toFixed(1)} times as many.` };
  }
  const due = growth >= 5 * kGrowth || growth <= 1 / kGrowth;
  return { due, text: due ? t`Retraining may help. The collection has changed a lot since the last training.` : t`The vocabulary fits this collection.` };
}

function vocabularyRow({ id, active, words, sampled, available, created_at: created }) {
  const use = () => tell(async () => {
    const { state } = await api.ask(api.address(`/vocabularies/${id}/active`), { method: "PUT" });
    return state ? t`The switch has started. Searches use the old vocabulary until it ends.` : t`Vocabulary ${id} is in use.`;
  });
  return make("tr", {}, make("th", { scope: "row", text: id }), make("td", { text: figure(words) }),
    make("td", { text: t`${figure(sampled)} of ${figure(available)} keypoints` }), make("td", { text: shortTime(created) }),
    make("td", {}, active ? t`yes` : smallButton(t`Use`, use, { class: "small", "data-needs": "write", "aria-label": t`Use vocabulary ${id}` })));
}

byId("retrain").addEventListener("click", () => tell(async () => {
  await api.askJson(api.address("/vocabularies"), "POST", {});
  return t`Training has started. Searches use the old vocabulary until it ends.`;
}));

// --- collections

const showCollections = makeLiveList("collections", ({ here, ...collection }) => {
  const { name, display_name: shown, aliases, images } = collection;
  return make("li", {}, here ? make("strong", { text: t`${shownName(collection)} (this one)` }) :
    make("a", { href: link("collection", { in: name }), text: shownName(collection) }), " ",
    make("span", { class: "quiet beside", text: [...(shown ? [name] : []), ...aliases, count(images, "image")].join(", ") }));
});

const changeCollections = (action) => tell(() => action().finally(refreshHeader));

const deleteCollection = (name) => changeCollections(async () => {
  await api.deletePath(api.address("", name));
  if (name === api.collectionName()) go("collection", { in: "default" });
  return t`Collection ${name} deleted.`;
});

// A new collection is entered.
onSubmit(byId("collection-form"), () => changeCollections(async () => {
  const typed = byId("collection-name").value.trim();
  const { collections } = await api.collections();
  const name = collectionNameFor(typed, collections.flatMap((one) => [one.name, ...one.aliases]));
  await api.ask(api.address("", name), { method: "PUT" });
  if (name !== typed) await api.askJson(api.address("", name), "PATCH", { display_name: typed });
  byId("collection-name").value = "";
  go("collection", { in: name });
  byId("collection-title").focus();
  return t`Collection ${typed} created.`;
}));

onSubmit(byId("collection-rename"), () => changeCollections(async () => {
  const shown = byId("collection-shown").value.trim();
  const path = api.address();
  const { display_name: before } = await api.ask(path);
  const rename = (name) => api.askJson(path, "PATCH", { display_name: name || null });
  await rename(shown);
  document.activeElement?.blur();
  notify(t`Renamed to ${shown || api.collectionName()}.`, false, () => rename(before).then(refreshHeader));
}));

// --- all of it

const showJobs = makeJobList("jobs", refresh);
makeSelfTest(refresh);

async function refresh() {
  clearTimeout(timer);
  if (byId("view-collection").hidden) return;
  const number = ++latest;
  await attempt(byId("collection-status"), async () => {
    const answers = await Promise.all([
      api.ask(api.address()), api.ask(api.address("/vocabularies")), api.ask("v1/jobs?limit=500"), api.collections()])
      .catch((error) => { if (number === latest) throw error; });
    if (number !== latest) return;
    const [record, { vocabularies }, { jobs }, { collections }] = answers;
    showFacts(record);
    showCollections(collections.map((one) => ({ ...one, here: one.name === record.name })));
    const { text, due } = recommendation(record);
    byId("recommendation").textContent = text;
    byId("recommendation").classList.toggle("due", due);
    byId("advanced-note").textContent = due ? record.vocabulary ? t`Retraining may help.` : t`There is no vocabulary yet.` : "";
    byId("retrain").classList.toggle("primary", due);
    byId("retrain").textContent = record.vocabulary ? t`Retrain` : t`Train`;
    const mine = jobs.filter((job) => job.collection === record.name);
    byId("retrain").disabled = !record.images || mine.some((job) => job.kind === "train" && isActive(job));
    await showSelfTest(record, mine.some((job) => job.kind === "selftest" && isActive(job)));
    byId("vocabularies").replaceChildren(...vocabularies.map(vocabularyRow));
    showJobs(mine);
    say(byId("collection-status"), "");
    const isPreparing = record.images && !record.vocabulary;  // training starts a moment after the first images
    if (isPreparing || mine.some(isActive)) timer = setTimeout(refresh, kPollMs);
  }, refresh);
}

export const collectionView = {
  title: t`Collection`,
  show: refresh,
  hide() { clearTimeout(timer); },
};
