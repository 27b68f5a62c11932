// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The state of the server: what it stores, uses and does; and backups of its database, for admins.
import * as api from "./api.js";
import { askingButton, attempt, byId, count, fact, figure, fileSize, make, makeLiveList, say, shortTime } from "./dom.js";
import { follow, isActive, makeJobList } from "./jobs.js";
import { showing } from "./router.js";
import { t } from "./texts.js";

const kPollMs = 3000;
const kUnescaped = { n: "\n", "\\": "\\", '"': '"' };

let timer = 0;
let before = null;  // { at, requests } of the poll before

// Prometheus' text format as [{ name, labels, value }], without comments and malformed lines.
export function parseMetrics(text) {
  const samples = [];
  for (const line of text.split("\n")) {
    const part = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})?\s+(\S+)/.exec(line);
    if (!part) continue;
    const labels = [...(part[2] ?? "").matchAll(/([a-zA-Z_]\w*)="((?:[^"\\]|\\.)*)"/g)]
      .map(([, name, value]) => [name, value.replace(/\\(.)/g, (_, letter) => kUnescaped[letter] ?? letter)]);
    samples.push({ name: part[1], labels: Object.fromEntries(labels), value: part[3] === "+Inf" ? Infinity : Number(part[3]) });
  }
  return samples;
}

// The sum of all series whose labels match the patterns; null if there are none.
export function total(samples, name, patterns = {}) {
  const found = samples.filter((one) => one.name === name && Object.entries(patterns).every(([label, pattern]) => pattern.test(one.labels[label] ?? "")));
  return found.length ? found.reduce((sum, { value }) => sum + value, 0) : null;
}

function showFacts(samples, took) {
  const of = (name, patterns) => total(samples, name, patterns);
  const known = (name, words) => (of(name) === null ? t`unknown` : words(of(name)));
  const number = (name) => known(name, figure);
  const bytes = (name) => known(name, (value) => fileSize(Math.round(value)));
  const noted = (name, value, note) => fact(name, value, make("span", { class: "quiet beside", text: note }));
  const now = { at: performance.now(), requests: of("pliant_http_requests_total") ?? 0 };
  const rate = before ? Math.max(0, now.requests - before.requests) / Math.max(0.001, (now.at - before.at) / 1000) : 0;
  before = now;
  byId("status-facts").replaceChildren(
    fact(t`Images`, number("pliant_images")), fact(t`Objects`, number("pliant_objects")),
    noted(t`Database`, bytes("pliant_database_bytes"), t`${bytes("pliant_disk_free_bytes")} of disk space free`),
    noted(t`Memory`, bytes("process_resident_memory_bytes"), t`index: ${bytes("pliant_index_bytes")}`),
    noted(t`Requests`, t`${figure(rate)} per second`,
          t`${figure(now.requests)} in total, ${figure(of("pliant_http_requests_total", { status: /^5/ }) ?? 0)} failed`),
    noted(t`Waiting`, figure(of("pliant_queue_length") ?? 0), count(of("pliant_queue_length", { lane: /^search$/ }) ?? 0, "search", "searches")),
    noted(t`Busy cores`, number("pliant_busy_cores"), of("pliant_decoders") === null ? "" : count(of("pliant_decoders"), "decoder")));
  const { version = "", descriptor } = samples.find(({ name }) => name === "pliant_info")?.labels ?? {};
  byId("status-version").textContent = [`Pliant ${version}`, descriptor ? t`descriptor ${descriptor}` : "",
                                        t`answered in ${Math.round(took)} ms`].filter(Boolean).join(", ");
}

async function showReady() {
  const answer = await fetch("readyz");
  const body = await answer.json().catch(() => ({}));
  byId("status-ready").textContent = answer.ok ? t`Ready` : body.code === "starting" ?
    t`Starting: ${Math.round(100 * (body.progress ?? 0))} % of the index is loaded` : body.detail ?? t`Not ready`;
  byId("status-ready").classList.toggle("error", !answer.ok && body.code !== "starting");
  return answer.ok;
}

const listJobs = makeJobList("status-jobs", refresh);

async function showJobs() {
  const { jobs } = await api.ask("v1/jobs?limit=500");
  listJobs(jobs);
  const running = jobs.filter(isActive).length;
  byId("status-running").textContent = running ? t`${count(running, "job")} running` : "";
}

// --- backups

const backupPath = ({ name }, what = "") => `v1/backups/${encodeURIComponent(name)}${what}`;
const tell = (text) => say(byId("backups-said"), text);

async function deleteBackup(backup) {
  await attempt(byId("backups-said"), async () => {
    await api.deletePath(backupPath(backup));
    tell(t`Backup ${backup.name} deleted.`);
  });
  await refresh();
  byId("backups-title").focus();
}

function backupItem(backup) {
  const note = make("span", { class: "quiet", role: "status" });
  return make("li", {}, make("strong", { text: backup.name }),
    make("span", { class: "quiet", text: `${fileSize(backup.bytes)}, ${shortTime(backup.created_at)}` }),
    api.downloadLink(backupPath(backup, "/content"), backup.name, note, { class: "button small", "aria-label": t`Download the backup ${backup.name}` }),
    askingButton(t`Delete`, t`Delete the backup ${backup.name}`, {
      question: t`This cannot be undone.`, yes: t`Delete`, act: () => deleteBackup(backup) }), note);
}

const listBackups = makeLiveList("backups", backupItem, t`No backups yet.`);

async function showBackups() {
  if (!api.isAdmin()) return;
  const { backups } = await api.hasBackups() ? await api.ask("v1/backups") : {};
  byId("backups-off").hidden = Boolean(backups);
  byId("backups-on").hidden = !backups;
  listBackups(backups ?? []);
}

byId("backup-make").addEventListener("click", () => attempt(byId("backups-said"), async () => {
  const { id } = await api.askJson("v1/backups", "POST", {});
  tell(t`The backup has started. It is listed here when it is complete.`);
  refresh();
  await follow(id);
  await refresh();
  tell(t`The backup is complete.`);
}));

// --- all of it

async function refresh() {
  clearTimeout(timer);
  if (showing() !== "status") return;
  try {
    if (!document.hidden) {
      const start = performance.now();
      if (await showReady()) {
        showFacts(parseMetrics(await (await api.blobOf("metrics")).text()), performance.now() - start);
        await Promise.all([showJobs(), showBackups()]);
      }
      say(byId("status-status"), "");
    }
  } catch (error) {
    say(byId("status-status"), error instanceof TypeError ? t`The server cannot be reached.` : error.message, true);
  }
  clearTimeout(timer);
  timer = setTimeout(refresh, kPollMs);
}

export function show() {
  before = null;
  tell("");
  return refresh();
}

export const hide = () => clearTimeout(timer);
