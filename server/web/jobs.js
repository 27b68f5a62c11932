// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Background jobs of the server.
import { ask, deletePath } from "./api.js";
import { count, make, makeButton, makeLiveList, shortTime, wait } from "./dom.js";
import { t } from "./texts.js";
import { problemWords } from "./words.js";

const kPollMs = 1000;
const kShown = 12;
const kKinds = { train: t`Preparing search`, demo: t`Loading demonstration objects`, import: t`Importing images`, bulk_import: t`Importing uploaded images`,
                 activate: t`Switching the vocabulary`, selftest: t`Testing the collection`, backup: t`Creating a backup` };
const kStates = { queued: t`waiting`, running: t`running`, done: t`done`, failed: t`failed`, cancelled: t`stopped` };

export const isActive = (job) => job.state === "queued" || job.state === "running";
const pathOf = (id) => `v1/jobs/${encodeURIComponent(id)}`;

// Follows a job to its end; onProgress(job) is told each time. Throws if the job failed.
export async function follow(id, onProgress = () => {}) {
  for (;;) {
    const job = await ask(pathOf(id));
    onProgress(job);
    if (job.state === "failed") throw new Error(job.problem ? problemWords(500, job.problem) : t`The job failed.`);
    if (!isActive(job)) return;
    await wait(kPollMs);
  }
}

function jobItem(job, onChange) {
  const name = kKinds[job.kind] ?? job.kind;
  const state = `${kStates[job.state]}, ${shortTime(job.finished_at ?? job.created_at)}`;
  const item = make("li", {}, make("strong", { text: name }), make("span", { class: "quiet", text: state }));
  if (job.failed) item.append(make("span", { class: "error", text: t`${count(job.failed, "item")} failed` }));
  if (job.system_files) item.append(make("span", { class: "quiet", text: t`${count(job.system_files, "file")} of system folders left out` }));
  if (job.problem) item.append(make("span", { class: "error", text: problemWords(500, job.problem) }));
  if (!isActive(job)) return item;
  item.append(make("progress", { max: job.total || 1, value: job.done, "aria-label": name }), makeButton(t`Stop`, async ({ target }) => {
    target.disabled = true;
    await deletePath(pathOf(job.id)).catch(() => {});
    onChange();
  }, { "data-needs": "write", "aria-label": t`Stop: ${name}` }));
  return item;
}

// show(jobs) for the list with this id.
export function makeJobList(id, onChange) {
  const show = makeLiveList(id, (job) => jobItem(job, onChange), t`No background jobs.`);
  return (jobs) => show(jobs.slice(0, kShown));
}
