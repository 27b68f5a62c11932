// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first visit: what to do, and demonstration objects.
import * as api from "./api.js";
import { attempt, byId, count, make, makeButton, say } from "./dom.js";
import { follow } from "./jobs.js";
import { t } from "./texts.js";

let choose = () => {};

export const whenExampleIsChosen = (call) => { choose = call; };

// Shows the welcome in an empty collection, and the crumpled photos if their objects are stored.
export async function refreshDemonstration() {
  if (byId("demo-load").disabled) return;
  await attempt(byId("search-status"), async () => {
    const [{ images, objects }, demo] = await Promise.all([api.ask(api.address()), api.ask(api.address("/demo"))]);
    byId("welcome").hidden = images > 0;
    byId("filters").hidden = images === 0;
    showExamples(demo);
    if (byId("view-search").classList.contains("has-query")) return;
    say(byId("search-status"), images ? t`${count(images, "image")} of ${count(objects, "object")} in this collection.` : "");
  });
}

function showExamples(demo) {
  byId("examples").hidden = !demo.loaded;
  if (!demo.loaded || byId("examples-list").children.length) return;
  byId("examples-list").replaceChildren(...demo.objects.map(({ object, crumpled: path }) => {
    const crumpled = path.slice(path.indexOf("assets/"));  // relative, as all addresses of the page
    const image = make("img", { alt: "", loading: "lazy", width: 160, height: 120 });
    api.showImage(image, crumpled);
    const search = async () => choose(new File([await api.blobOf(crumpled)], `${object}.jpg`, { type: "image/jpeg" }));
    const button = makeButton("", () => attempt(byId("search-status"), search), { "aria-label": t`Search with the crumpled photo of ${object}` });
    button.append(image);
    return make("li", {}, button);
  }));
}

byId("demo-load").addEventListener("click", async () => {
  const bar = byId("demo-bar");
  byId("demo-load").disabled = true;
  byId("demo-progress").hidden = false;
  bar.removeAttribute("value");
  say(byId("demo-status"), "");
  await attempt(byId("demo-status"), async () => {
    const job = await api.askJson(api.address("/demo"), "POST", {});
    await follow(job.id, ({ done, total }) => { [bar.max, bar.value] = [total || 1, done]; });
    byId("demo-load").disabled = false;
    await refreshDemonstration();
    byId("examples-list").querySelector("button")?.focus();
  });
  byId("demo-load").disabled = false;
  byId("demo-progress").hidden = true;
});
