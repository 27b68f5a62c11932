// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page of a collection: size, vocabularies, background jobs, and the other collections.
import * as api from "./api.js";
import { askingButton, attempt, byId, count, fact, figure, make, makeLiveList, onSubmit, say, shortTime, smallButton } from "./dom.js";
import { refreshHeader } from "./header.js";
import { isActive, makeJobList } from "./jobs.js";
import { collectionNameFor, shownName } from "./names.js";
import { makeSelfTest, showSelfTest } from "./selftest.js";

const kPollMs = 2000;
const kFullSample = 40_000;  // descriptors that training samples by default
const kGrowth = 2;           // retraining pays from this many times as many descriptors

let timer = 0;

// Runs the action and says its words, or what went wrong.
async function tell(id, action) {
  await attempt(byId(id), async () => say(byId(id), await action()));
  refresh();
}

// --- size and vocabulary

function showFacts(record) {
  byId("collection-title").textContent = `Collection: ${shownName(record)}`;
  const field = byId("collection-shown");
  if (document.activeElement !== field) field.value = record.display_name ?? "";
  byId("collection-facts").replaceChildren(
    fact("Images", figure(record.images)), fact("Objects", figure(record.objects)), fact("Keypoints", figure(record.descriptors)),
    fact("Visual words", record.vocabulary ? figure(record.vocabulary.words) : "none yet"),
    fact("Created", new Date(record.created_at).toLocaleDateString("en", { dateStyle: "medium" })));
}

// What to do about the vocabulary: { text, due }.
export function recommendation({ images, descriptors, vocabulary }) {
  if (!images) return { text: "Add images first. The vocabulary is trained on them.", due: false };
  if (!vocabulary) return { text: "There is no vocabulary yet, so a search finds nothing. Train one now.", due: true };
  const growth = descriptors / Math.max(1, vocabulary.available);
  if (growth >= kGrowth && vocabulary.sampled < kFullSample) {
    return { due: true, text: `Retraining is recommended. The vocabulary was trained on ${count(vocabulary.sampled, "keypoint")}; ` +
      `the collection now has ${growth.toFixed(1)} times as many.` };
  }
  const due = growth >= 5 * kGrowth || growth <= 1 / kGrowth;
  return { due, text: due ? "Retraining may help. The collection has changed a lot since the last training." : "The vocabulary fits this collection." };
}

function vocabularyRow({ id, active, words, sampled, available, created_at: created }) {
  const use = () => tell("retrain-status", async () => {
    const { state } = await api.ask(api.address(`/vocabularies/${id}/active`), { method: "PUT" });
    return state ? "The switch has started. Searches use the old vocabulary until it ends." : `Vocabulary ${id} is in use.`;
  });
  return make("tr", {}, make("th", { scope: "row", text: id }), make("td", { text: figure(words) }),
    make("td", { text: `${figure(sampled)} of ${figure(available)} keypoints` }), make("td", { text: shortTime(created) }),
    make("td", {}, active ? "yes" : smallButton("Use", use, { class: "small", "data-needs": "write", "aria-label": `Use vocabulary ${id}` })));
}

byId("retrain").addEventListener("click", () => tell("retrain-status", async () => {
  await api.askJson(api.address("/vocabularies"), "POST", {});
  return "Training has started. Searches use the old vocabulary until it ends.";
}));

// --- collections

function collectionItem({ here, ...collection }) {
  const { name, display_name: shown, aliases, images } = collection;
  const href = `#/collection${name === "default" ? "" : `?${new URLSearchParams({ in: name })}`}`;
  const item = make("li", {}, here ? make("strong", { text: `${shownName(collection)} (this one)` }) : make("a", { href, text: shownName(collection) }));
  item.append(" ", make("span", { class: "quiet beside", text: [...(shown ? [name] : []), ...aliases, count(images, "image")].join(", ") }));
  if (name !== "default") {
    const remove = askingButton("Delete", `Delete the collection ${name}`, {
      question: "Delete with all its images? This cannot be undone.", yes: "Delete all", act: () => deleteCollection(name) });
    remove.dataset.needs = "admin";
    item.append(" ", remove);
  }
  return item;
}

// Runs an action on collections, says its words, and shows the collections again.
const changeCollections = (action) => tell("collection-made", async () => {
  const words = await action();
  refreshHeader();
  await showCollections();
  return words;
});

const deleteCollection = (name) => changeCollections(async () => {
  await api.deletePath(api.address("", name));
  if (name === api.collectionName()) location.hash = "#/collection";
  return `Collection ${name} deleted.`;
});

onSubmit(byId("collection-form"), () => changeCollections(async () => {
  const typed = byId("collection-name").value.trim();
  const { collections } = await api.collections();
  const name = collectionNameFor(typed, collections.flatMap((one) => [one.name, ...one.aliases]));
  await api.ask(api.address("", name), { method: "PUT" });
  if (name !== typed) await api.askJson(api.address("", name), "PATCH", { display_name: typed });
  byId("collection-name").value = "";
  return `Collection ${typed} created.`;
}));

onSubmit(byId("collection-rename"), () => changeCollections(async () => {
  const shown = byId("collection-shown").value.trim();
  await api.askJson(api.address(), "PATCH", { display_name: shown || null });
  document.activeElement?.blur();
  return `Renamed to ${shown || api.collectionName()}.`;
}));

const listCollections = makeLiveList("collections", collectionItem);
let latestCollections = 0;

async function showCollections() {
  const number = ++latestCollections;
  const { collections } = await api.collections();
  const isHere = ({ name, aliases }) => [name, ...aliases].includes(api.collectionName());
  if (number === latestCollections) listCollections(collections.map((one) => ({ ...one, here: isHere(one) })));
}

// --- all of it

const showJobs = makeJobList("jobs", refresh);
makeSelfTest(refresh);

async function refresh() {
  clearTimeout(timer);
  if (byId("view-collection").hidden) return;
  await attempt(byId("collection-status"), async () => {
    const [record, { vocabularies }, { jobs }] = await Promise.all([
      api.ask(api.address()), api.ask(api.address("/vocabularies")), api.ask("v1/jobs?limit=500")]);
    showFacts(record);
    const { text, due } = recommendation(record);
    byId("recommendation").textContent = text;
    byId("recommendation").classList.toggle("due", due);
    byId("retrain").classList.toggle("primary", due);
    byId("retrain").textContent = record.vocabulary ? "Retrain" : "Train";
    const mine = jobs.filter((job) => job.collection === record.name);
    byId("retrain").disabled = !record.images || mine.some((job) => job.kind === "train" && isActive(job));
    await showSelfTest(record, mine.some((job) => job.kind === "selftest" && isActive(job)));
    byId("vocabularies").replaceChildren(...vocabularies.map(vocabularyRow));
    showJobs(mine);
    say(byId("collection-status"), "");
    if (mine.some(isActive)) timer = setTimeout(refresh, kPollMs);
  });
}

export const collectionView = {
  title: "Collection",
  show() {
    say(byId("retrain-status"), "");
    showCollections().catch(() => {});  // refresh() says what is wrong
    refresh();
  },
  hide() { clearTimeout(timer); },
};
