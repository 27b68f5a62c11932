// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first visit: what to do, and demonstration objects to try it with.
import * as api from "./api.js";
import { byId, make, say } from "./dom.js";
import { collectionWords, refreshHeader } from "./header.js";
import { follow } from "./jobs.js";
import { link } from "./router.js";

let choose = () => {};
let loading = false;

export const whenExampleIsChosen = (call) => { choose = call; };

// Shows the welcome in an empty collection, and the crumpled pictures where their objects are.
export async function refreshDemonstration() {
  if (loading) return;
  byId("welcome-add").href = link("add");
  try {
    const [record, demo] = await Promise.all([api.collection(), api.ask(api.address("/demo"))]);
    byId("welcome").hidden = record.images > 0;
    byId("filters").hidden = record.images === 0;
    showExamples(demo);
    if (!byId("view-search").classList.contains("has-query")) {
      say(byId("search-status"), record.images ? `${collectionWords(record)} to find.` : "");
    }
  } catch (error) {
    say(byId("search-status"), error.message, true);
  }
}

function showExamples(demo) {
  byId("examples").hidden = !demo.loaded;
  if (!demo.loaded || byId("examples-list").children.length) return;
  byId("examples-list").replaceChildren(...demo.objects.map(({ object, crumpled }) => {
    const image = make("img", { alt: "", loading: "lazy", width: 160, height: 120 });
    api.showPicture(image, crumpled);
    return make("li", {}, make("button", {
      type: "button", "aria-label": `Search with a crumpled picture of: ${object}`,
      onclick: () => useExample(crumpled, object),
    }, image));
  }));
}

async function useExample(path, object) {
  try {
    const blob = await api.pictureBlob(path);
    choose(new File([blob], `${object}.jpg`, { type: "image/jpeg" }));
  } catch (error) {
    say(byId("search-status"), error.message, true);
  }
}

byId("demo-load").addEventListener("click", async () => {
  const button = byId("demo-load");
  const status = byId("demo-status");
  const bar = byId("demo-bar");
  loading = true;
  button.disabled = true;
  byId("demo-progress").hidden = false;
  bar.removeAttribute("value");
  say(status, "");
  try {
    const job = await api.askJson(api.address("/demo"), "POST", {});
    await follow(job.id, ({ done, total }) => {
      bar.max = total || 1;
      bar.value = done;
    });
    loading = false;
    await Promise.all([refreshDemonstration(), refreshHeader()]);
    byId("examples-list").querySelector("button")?.focus();
  } catch (error) {
    say(status, error.message, true);
  } finally {
    loading = false;
    button.disabled = false;
    byId("demo-progress").hidden = true;
  }
});
