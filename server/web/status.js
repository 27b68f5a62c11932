// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How the server is doing: what it holds, what it uses, what waits, what runs.
import * as api from "./api.js";
import { forgetBackups, refreshBackups, whenBackupStarts } from "./backups.js";
import { byId, count, fileSize, make, say } from "./dom.js";
import { isActive, jobItem } from "./jobs.js";
import { parseMetrics, quantile, total } from "./metrics.js";
import { shownName } from "./names.js";
import { showing } from "./router.js";

const kPollMs = 3000;
const kRemembered = 100;  // polls that the curves show
const kShownJobs = 12;
const kMostCollections = 50;

let timer = 0;
let history = [];  // [{ at, requests, memory }]

function fact(name, value, note = "", curve = null) {
  return make("div", {}, make("dt", { text: name }), make("dd", {}, value, note ? make("span", { class: "quiet beside", text: note }) : "", curve ?? ""));
}

// A curve of values over time, from zero to their largest.
function curveOf(values, label) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  for (const [name, value] of Object.entries({ viewBox: "0 0 100 24", preserveAspectRatio: "none", class: "curve", role: "img", "aria-label": label })) {
    svg.setAttribute(name, value);
  }
  const line = document.createElementNS(svg.namespaceURI, "polyline");
  const most = Math.max(...values, 1e-9);
  const step = 100 / Math.max(1, kRemembered - 1);
  const start = 100 - step * (values.length - 1);
  line.setAttribute("points", values.map((value, i) => `${(start + i * step).toFixed(2)},${(23 - (22 * value) / most).toFixed(2)}`).join(" "));
  svg.append(line);
  return svg;
}

const seconds = (s) => (s === null ? "none yet" : s < 1 ? `${Math.round(1000 * s)} ms` : `${s.toFixed(1)} s`);
const number = (value) => (value === null ? "unknown" : value.toLocaleString("en", { maximumFractionDigits: 1 }));
const bytes = (value) => (value === null ? "unknown" : fileSize(Math.round(value)));

// Requests a second between polls.
function rates() {
  return history.slice(1).map(({ at, requests }, i) =>
    Math.max(0, requests - history[i].requests) / Math.max(0.001, (at - history[i].at) / 1000));
}

function showFacts(samples, took) {
  const of = (name, labels) => total(samples, name, labels);
  const requests = of("pliant_http_requests_total") ?? 0;
  history = [...history, { at: performance.now(), requests, memory: of("process_resident_memory_bytes") ?? 0 }].slice(-kRemembered);
  const failed = of("pliant_http_requests_total", { status: /^5/ }) ?? 0;
  const rate = rates();
  const search = (share) => quantile(samples, "pliant_http_request_seconds", { route: "search" }, share);
  byId("status-facts").replaceChildren(
    fact("Pictures", number(of("pliant_images"))),
    fact("Objects", number(of("pliant_objects"))),
    fact("Database", bytes(of("pliant_database_bytes")), `${bytes(of("pliant_disk_free_bytes"))} free on its disk`),
    fact("Memory", bytes(of("process_resident_memory_bytes")), `${bytes(of("pliant_index_bytes"))} of it the index`,
         curveOf(history.map(({ memory }) => memory), "Memory over the last minutes")),
    fact("Requests", `${number(rate.at(-1) ?? 0)} a second`, `${number(requests)} in all, ${number(failed)} failed`,
         curveOf(rate.length ? rate : [0], "Requests a second over the last minutes")),
    fact("A search takes", seconds(search(0.5)), search(0.95) === null ? "" : `1 in 20 more than ${seconds(search(0.95))}`),
    fact("Waiting", number(of("pliant_queue_length") ?? 0), `${number(of("pliant_queue_length", { lane: "search" }) ?? 0)} searches`),
    fact("Busy cores", number(of("pliant_busy_cores")), of("pliant_decoders") === null ? "" : count(of("pliant_decoders"), "decoder")),
    fact("Processor time", seconds(of("process_cpu_seconds_total"))));
  const info = samples.find(({ name }) => name === "pliant_info")?.labels ?? {};
  byId("status-version").textContent = [`Pliant ${info.version ?? ""}`, info.descriptor ? `descriptor ${info.descriptor}` : "",
                                        `answered in ${Math.round(took)} ms`].filter(Boolean).join(", ");
}

async function showCollections() {
  const { collections } = await api.collections();
  const records = await Promise.all(collections.slice(0, kMostCollections).map((name) => api.ask(api.address("", name)).catch(() => null)));
  byId("status-collections").replaceChildren(...records.filter(Boolean).map((one) => make("tr", {},
    make("th", { scope: "row" }, make("a", { href: one.name === "default" ? "#/collection" : `#/collection?${new URLSearchParams({ in: one.name })}`, text: shownName(one) })),
    make("td", { text: number(one.images) }), make("td", { text: number(one.objects) }), make("td", { text: number(one.descriptors) }),
    make("td", { text: one.vocabulary ? number(one.vocabulary.words) : "none yet" }))));
  byId("status-more").textContent = collections.length > kMostCollections ? `And ${count(collections.length - kMostCollections, "more", "more")}.` : "";
}

async function showReady() {
  const answer = await fetch("/readyz");
  const body = await answer.json().catch(() => ({}));
  const state = answer.ok ? ["Ready", "sure"] :
    body.code === "starting" ? [`Starting: ${Math.round(100 * (body.progress ?? 0))} % of the index is loaded`, "perhaps"] :
      [body.detail ?? "Not ready", "bad"];
  byId("status-ready").textContent = state[0];
  byId("status-ready").className = `grade-${state[1]}`;
  return answer.ok;
}

let jobsText = "";
async function showJobs() {
  const { jobs } = await api.ask("/v1/jobs");
  const text = JSON.stringify(jobs.slice(0, kShownJobs));
  if (text === jobsText) return;  // buttons keep the focus
  jobsText = text;
  byId("status-jobs").replaceChildren(...jobs.slice(0, kShownJobs).map((job) => jobItem(job, refresh)));
  if (!jobs.length) byId("status-jobs").append(make("li", { class: "quiet", text: "None." }));
  byId("status-running").textContent = `${count(jobs.filter(isActive).length, "job")} at work`;
}

async function refresh() {
  clearTimeout(timer);
  if (showing() !== "status") return;
  try {
    if (!document.hidden) {
      const start = performance.now();
      if (await showReady()) {
        const samples = parseMetrics(await api.plainText("/metrics"));
        showFacts(samples, performance.now() - start);
        await Promise.all([showCollections(), showJobs(), refreshBackups()]);
      }
      say(byId("status-status"), "");
    }
  } catch (error) {
    say(byId("status-status"), error instanceof TypeError ? "The server cannot be reached." : error.message, true);
  }
  clearTimeout(timer);
  timer = setTimeout(refresh, kPollMs);
}

whenBackupStarts(refresh);

export const statusView = {
  title: "Status",
  show() {
    history = [];
    jobsText = "";
    return refresh();
  },
  hide() {
    clearTimeout(timer);
    forgetBackups();
  },
};
