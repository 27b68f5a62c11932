// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A collection's page: how large, which vocabulary, what runs in the background.
import * as api from "./api.js";
import { byId, count, make, say, shortTime } from "./dom.js";
import { refreshHeader } from "./header.js";
import { isActive, jobItem } from "./jobs.js";
import { collectionNameFor, shownName } from "./names.js";

const kPollMs = 2000;
const kShownJobs = 12;
const kFullSample = 40_000;  // descriptors that training looks at unless told otherwise
const kGrowth = 2;           // retraining pays when there are so many times as many

let timer = 0;

// --- size and vocabulary

function fact(name, value) {
  return make("div", {}, make("dt", { text: name }), make("dd", { text: value }));
}

function showFacts(record) {
  byId("collection-title").textContent = `Collection: ${shownName(record)}`;
  const field = byId("collection-shown");
  if (document.activeElement !== field) field.value = record.display_name ?? "";
  byId("collection-facts").replaceChildren(
    fact("Pictures", record.images.toLocaleString("en")),
    fact("Objects", record.objects.toLocaleString("en")),
    fact("Key points", record.descriptors.toLocaleString("en")),
    fact("Visual words", record.vocabulary ? record.vocabulary.words.toLocaleString("en") : "none yet"),
    fact("Since", new Date(record.created_at).toLocaleDateString("en", { dateStyle: "medium" })));
}

// What to do about the vocabulary, in words.
export function recommendation({ images, descriptors, vocabulary }) {
  if (!images) return { text: "Add pictures first: there is nothing to choose words from.", due: false };
  if (!vocabulary) {
    return { text: "There is none yet, so nothing can be found. Train one now.", due: true };
  }
  const { available, sampled } = vocabulary;
  const growth = descriptors / Math.max(1, available);
  if (growth >= kGrowth && sampled < kFullSample) {
    return { due: true, text: `Retraining is recommended: it was chosen from ${count(sampled, "key point")}, ` +
      `and there are ${growth.toFixed(1)} times as many now.` };
  }
  if (growth >= 5 * kGrowth) {
    return { due: true, text: `Retraining may help: the collection is ${growth.toFixed(0)} times as large as ` +
      "when the words were chosen." };
  }
  if (growth <= 1 / kGrowth) {
    return { due: true, text: "Retraining may help: most of the pictures that the words were chosen from are gone." };
  }
  return { text: "Nothing to do: the words were chosen from a collection much like today's.", due: false };
}

function vocabularyRow(vocabulary) {
  const use = make("td");
  if (vocabulary.active) use.append("yes");
  else {
    use.append(make("button", {
      type: "button", class: "small", text: "Use", "data-needs": "write", "aria-label": `Use vocabulary ${vocabulary.id}`,
      onclick: () => change(
        () => api.ask(api.address(`/vocabularies/${vocabulary.id}/active`), { method: "PUT" }),
        ({ state }) => (state ? "The switch has begun: pictures are written in its words first." :
                                `Vocabulary ${vocabulary.id} is in use.`)),
    }));
  }
  return make("tr", {}, make("th", { scope: "row", text: vocabulary.id }),
              make("td", { text: vocabulary.words.toLocaleString("en") }),
              make("td", { text: `${vocabulary.sampled.toLocaleString("en")} of ` +
                `${vocabulary.available.toLocaleString("en")} key points` }),
              make("td", { text: shortTime(vocabulary.created_at) }), use);
}

// done(answer): what to say then.
async function change(action, done) {
  const status = byId("retrain-status");
  try {
    say(status, done(await action()));
  } catch (error) {
    say(status, error.message, true);
  }
  refresh();
}

byId("retrain").addEventListener("click", () => change(
  () => api.askJson(api.address("/vocabularies"), "POST", {}),
  () => "Training has begun. Searches go on with the old words until it is done."));

// --- jobs

let jobsText = "";  // what is shown, so that a button keeps the focus while nothing changes

function showJobs(jobs) {
  const text = JSON.stringify(jobs);
  if (text === jobsText) return;
  jobsText = text;
  const mine = jobs.slice(0, kShownJobs);
  byId("jobs").replaceChildren(...mine.map((job) => jobItem(job, refresh)));
  if (!mine.length) byId("jobs").append(make("li", { class: "quiet", text: "None." }));
}

// --- collections

function collectionItem(label) {
  const { name, display_name: shown, aliases } = label;
  const item = make("li", {});
  const here = [name, ...aliases].includes(api.collectionName());
  if (here) item.append(make("strong", { text: `${shownName(label)} (this one)` }));
  else item.append(make("a", { href: name === "default" ? "#/collection" :
                               `#/collection?${new URLSearchParams({ in: name })}`, text: shownName(label) }));
  const others = [...(shown ? [name] : []), ...aliases];
  if (others.length) item.append(" ", make("span", { class: "quiet beside", text: others.join(", ") }));
  if (name !== "default") {
    item.append(" ", make("button", {
      type: "button", class: "small", text: "Delete", "data-needs": "admin", "aria-label": `Delete the collection ${name}`,
      onclick: (event) => askBeforeDeleting(event.target, name),
    }));
  }
  return item;
}

// All that is in it goes at once and for good, so this asks instead of offering to undo.
function askBeforeDeleting(button, name) {
  const sure = make("button", { type: "button", class: "small danger", text: "Yes, delete all in it" });
  const no = make("button", { type: "button", class: "small", text: "Keep it" });
  const question = make("span", { class: "row", role: "group", "aria-label": `Delete ${name}?` },
                        make("span", { text: "With all its pictures, for good?" }), no, sure);
  button.replaceWith(question);
  no.focus();
  no.addEventListener("click", () => { question.replaceWith(button); button.focus(); });
  sure.addEventListener("click", async () => {
    try {
      await api.deletePath(api.address("", name));
      say(byId("collection-made"), `The collection ${name} is deleted.`);
      if (name === api.collectionName()) location.hash = "#/collection";
      else showCollections().catch(() => {});  // refresh() says what is wrong
    } catch (error) {
      say(byId("collection-made"), error.message, true);
    }
    refresh();
    refreshHeader();
  });
}

byId("collection-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const typed = byId("collection-name").value.trim();
  try {
    const { labels } = await api.collections();
    const name = collectionNameFor(typed, labels.flatMap((label) => [label.name, ...label.aliases]));
    await api.ask(api.address("", name), { method: "PUT" });
    if (name !== typed) await api.askJson(api.address("", name), "PATCH", { display_name: typed });
    say(byId("collection-made"), `The collection ${typed} is there.`);
    byId("collection-name").value = "";
    showCollections();
    refreshHeader();
  } catch (error) {
    say(byId("collection-made"), error.message, true);
  }
});

byId("collection-rename").addEventListener("submit", async (event) => {
  event.preventDefault();
  const shown = byId("collection-shown").value.trim();
  try {
    await api.askJson(api.address(), "PATCH", { display_name: shown || null });
    say(byId("collection-made"), shown ? `It is called ${shown} now.` : "It is called by its name in addresses again.");
    document.activeElement?.blur();
    await showCollections();
    refresh();
    refreshHeader();
  } catch (error) {
    say(byId("collection-made"), error.message, true);
  }
});

let collectionsText = "";  // what is shown: while nothing changes, a question that is being answered stays
let latestCollections = 0;

async function showCollections() {
  const number = ++latestCollections;
  const { labels } = await api.collections();
  if (number !== latestCollections) return;
  const text = JSON.stringify([api.collectionName(), labels]);
  if (text === collectionsText) return;
  collectionsText = text;
  byId("collections").replaceChildren(...labels.map(collectionItem));
}

// --- all of it

async function refresh() {
  clearTimeout(timer);
  if (byId("view-collection").hidden) return;
  try {
    const [record, { vocabularies }, { jobs }] = await Promise.all([
      api.collection(), api.ask(api.address("/vocabularies")), api.ask("/v1/jobs")]);
    showFacts(record);
    const advice = recommendation(record);
    byId("recommendation").textContent = advice.text;
    byId("recommendation").classList.toggle("due", advice.due);
    byId("retrain").classList.toggle("primary", advice.due);
    byId("retrain").textContent = record.vocabulary ? "Retrain" : "Train";
    const mine = jobs.filter((job) => job.collection === record.name);
    const training = mine.some((job) => job.kind === "train" && isActive(job));
    byId("retrain").disabled = training || !record.images;
    byId("vocabularies").replaceChildren(...vocabularies.map(vocabularyRow));
    showJobs(mine);
    say(byId("collection-status"), "");
    if (mine.some(isActive)) timer = setTimeout(refresh, kPollMs);
  } catch (error) {
    say(byId("collection-status"), error.message, true);
  }
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
