// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Work that the server does in the background.
import { ask, deletePath } from "./api.js";
import { count, make, shortTime, wait } from "./dom.js";
import { problemWords } from "./words.js";

const kPollMs = 1000;

const kKinds = {
  train: "Choosing a vocabulary",
  demo: "Loading demonstration objects",
  import: "Adding pictures",
  bulk_import: "Adding pictures that were sent",
  activate: "Switching the vocabulary",
  backup: "Backing up",
};
const kStates = { queued: "waiting", running: "running", done: "done", failed: "failed",
                  cancelled: "stopped" };

export const isActive = (job) => job.state === "queued" || job.state === "running";

// Follows a job to its end; onProgress(job) is told each time. Throws when it failed.
export async function follow(id, onProgress = () => {}) {
  for (;;) {
    const job = await ask(`/v1/jobs/${encodeURIComponent(id)}`);
    onProgress(job);
    if (job.state === "failed") throw new Error(job.problem ? problemWords(500, job.problem, 0) : "The work failed.");
    if (!isActive(job)) return job;
    await wait(kPollMs);
  }
}

// One job as an item of a list.
export function jobItem(job, onChange) {
  const name = kKinds[job.kind] ?? job.kind;
  const item = make("li", {}, make("strong", { text: name }),
                    make("span", { class: "quiet", text: `${kStates[job.state] ?? job.state}, ` +
                      shortTime(job.finished_at ?? job.created_at) }));
  if (job.failed) item.append(make("span", { class: "error", text: `${count(job.failed, "item")} failed` }));
  if (job.problem) item.append(make("span", { class: "error", text: problemWords(500, job.problem, 0) }));
  if (!isActive(job)) return item;
  item.append(make("progress", { max: job.total || 1, value: job.done, "aria-label": name }));
  item.append(make("button", {
    type: "button", text: "Stop", "data-needs": "write", "aria-label": `Stop: ${name}`,
    onclick: async (event) => {
      event.target.disabled = true;
      await deletePath(`/v1/jobs/${encodeURIComponent(job.id)}`).catch(() => {});
      onChange();
    },
  }));
  return item;
}
