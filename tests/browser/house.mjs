// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A real server, a real browser, and what the cases ask of them. Set by run.sh: PLIANT_BIN (folder of
// the programs) and PLIANT_OUT (where screenshots go).
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after } from "node:test";
import { chromium } from "playwright-core";

// A connection of its own for each request: Node keeps them, and only finds by writing that the server has ended one
// that was idle for long, as while an image was made here.
const fetchOnKeptConnections = globalThis.fetch;
globalThis.fetch = (url, options = {}) =>
  fetchOnKeptConnections(url, { ...options, headers: { ...options.headers, Connection: "close" } });

const kBrowsers = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const kPatienceMs = Number(process.env.PLIANT_PATIENCE_MS ?? 120_000);
const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const out = process.env.PLIANT_OUT;
const bin = process.env.PLIANT_BIN;
assert.ok(out && bin, "run this by tests/browser/run.sh");
mkdirSync(out, { recursive: true });

const started = new Set();  // of servers that run: what ends them

// A server with an empty database of its own. RootSIFT describes quickly; `flags` may say otherwise.
export async function startServer(...flags) {
  const folder = mkdtempSync(join(tmpdir(), "pliant-browser-"));
  const program = spawn(join(bin, "pliant-server"), [
    "--db", join(folder, "test.db"), "--listen", "127.0.0.1:0",
    ...(flags.includes("--descriptor") ? [] : ["--descriptor", "rootsift"]), ...flags]);
  let log = "";
  program.stderr.on("data", (text) => { log += text; });
  const ended = new Promise((end) => program.once("exit", end));
  const end = async () => {
    program.kill("SIGTERM");
    await ended;
    rmSync(folder, { recursive: true, force: true });
  };
  started.add(end);
  const address = await new Promise((ready, fail) => {
    let said = "";
    program.stdout.on("data", (text) => {
      said += text;
      const found = /http:\/\/\S+/.exec(said);
      if (found) ready(found[0]);
    });
    ended.then((status) => fail(new Error(`the server ended with ${status}: ${log}`)));
  });
  return {
    address,
    database: join(folder, "test.db"),
    log: () => log,
    createKey: (scope) => execFileSync(join(bin, "pliant-server"), [
      "keys", "create", "--scope", scope, "--name", scope, "--db", join(folder, "test.db")],
      { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }).trim(),
    async stop() {
      started.delete(end);
      await end();
    },
  };
}

// Servers that cases share, by name; started when first asked for.
const servers = new Map();
export function server(name, ...flags) {
  if (!servers.has(name)) servers.set(name, startServer(...flags));
  return servers.get(name);
}

// Browsers by what they are started with beside what all have.
const launched = new Map();
function browser(flags) {
  const key = flags.join(" ");
  if (!launched.has(key)) launched.set(key, startBrowser(flags));
  return launched.get(key);
}

after(async () => {
  for (const one of launched.values()) await (await one).close();
  for (const end of started) await end();  // also where a case has failed before it stopped its own
});

async function startBrowser(flags) {
  const executablePath = kBrowsers.find(existsSync);
  assert.ok(executablePath, "Debian's chromium package is not installed");
  // No sandbox inside: tests run as root and in containers.
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", ...flags] });
}

// A page of its own context. page.faults: what must never happen, wherever it happens.
export async function openPage(url, { width = 1200, height = 900, flags = [], ...more } = {}) {
  const context = await (await browser(flags)).newContext({ viewport: { width, height }, ...more });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatienceMs);
  page.faults = [];
  page.on("pageerror", (error) => page.faults.push(String(error)));
  page.on("console", (message) => {
    if (/Content Security Policy/i.test(message.text())) page.faults.push(message.text());
  });
  const origin = new URL(url).origin;
  page.on("request", (request) => {
    if (/^https?:/.test(request.url()) && new URL(request.url()).origin !== origin) {
      page.faults.push(`a request to elsewhere: ${request.url()}`);
    }
  });
  if (process.env.PLIANT_SLOW) await slowDown(page, Number(process.env.PLIANT_SLOW));
  await servePageFrom(page, process.env.PLIANT_WEB);
  await page.goto(url);
  return page;
}

// A page whose answers come `latency` ms late, on a quarter of a processor: a case that reads what the page has
// not drawn yet fails here every time, and not only on a busy machine.
async function slowDown(page, latency) {
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Network.enable");
  await devtools.send("Network.emulateNetworkConditions", { offline: false, latency, downloadThroughput: -1, uploadThroughput: -1 });
  await devtools.send("Emulation.setCPUThrottlingRate", { rate: 4 });
}

// While the page is being written: its files from a folder, in place of those built into the server.
async function servePageFrom(page, folder) {
  if (!folder) return;
  const types = { html: "text/html", css: "text/css", js: "text/javascript", jpg: "image/jpeg" };
  await page.route(/\/(docs|assets\/[^?]*)?$/, (route) => {
    const name = new URL(route.request().url()).pathname.replace("/assets/", "").replace(/^\/$/, "index.html")
      .replace(/^\/docs$/, "docs.html");
    return route.fulfill({ body: readFileSync(join(folder, name)),
                           contentType: `${types[name.split(".").pop()]}; charset=utf-8` });
  });
}

export async function closePage(page) {
  assert.deepEqual(page.faults, []);
  await page.context().close();
}

// Of the whole page; on a telephone of the screen: what goes beyond it would take the touch screen away, from the
// image and from all that is checked after it (Chromium's Page.captureScreenshot with captureBeyondViewport).
export async function shoot(page, name) {
  const touched = await isTouched(page);
  await page.screenshot({ path: join(out, `${name}.png`), fullPage: !touched, animations: "disabled" });
  assert.equal(await isTouched(page), touched, `${name}: the screenshot has changed the device`);
}

const isTouched = (page) => page.evaluate(() => matchMedia("(any-pointer: coarse)").matches);

// No violation of axe-core's rules (WCAG 2.2 A and AA, and its best practices). The name that is spoken has the label
// that is seen (WCAG 2.5.3), which axe-core calls experimental.
export async function checkAccessibility(page, where) {
  await page.evaluate(axeSource);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, {
    rules: { "label-content-name-mismatch": { enabled: true } } }));
  const words = violations.map(({ id, help, nodes }) =>
    `${id}: ${help}\n${nodes.map((node) => `    ${node.html}\n    ${node.failureSummary}`).join("\n")}`);
  assert.equal(violations.length, 0, `${where}: ${words.join("\n")}`);
}

// Nothing sticks out to the side.
export async function checkWidth(page, where) {
  const [content, window] = await page.evaluate(
    () => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(content <= window, `${where}: ${content} px wide in a window of ${window} px`);
}

// Nothing that is to be read or pressed lies on something else of that kind: elements with text or a use of
// their own, where neither is inside the other. notices: those may lie over the page, as they go by themselves.
export async function checkOverlaps(page, where, { notices = false } = {}) {
  const found = await page.evaluate((skipNotices) => {
    const uses = "a, button, input, select, textarea, img, canvas, progress, summary, h1, h2, p, dt, dd, th, td, span, label";
    const skipped = [".tag, .region, .grip", ".hidden-text, .skip, .file", "#stage *", ".top", ".selection", ".notice", ...(skipNotices ? ["#notices *"] : [])].join();
    const list = [...document.querySelectorAll(uses)].filter((one) => one.checkVisibility() && !one.closest(skipped) &&
      (one.matches("img, canvas, input, select, textarea, progress, button, .button") || one.innerText?.trim()));
    const seen = list.map((one) => [one, one.getBoundingClientRect()]).filter(([, box]) => box.width > 1 && box.height > 1);
    const words = (one) => `${one.tagName.toLowerCase()}${one.id ? `#${one.id}` : ""} "${(one.innerText ?? one.ariaLabel ?? "").slice(0, 40)}"`;
    const bad = [];
    for (const [i, [a, p]] of seen.entries()) {
      for (const [b, q] of seen.slice(i + 1)) {
        if (a.contains(b) || b.contains(a)) continue;
        const across = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const down = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (across > 2 && down > 2) bad.push(`${words(a)} lies on ${words(b)} by ${Math.round(across)} x ${Math.round(down)}`);
      }
    }
    return bad.slice(0, 5);
  }, notices);
  assert.deepEqual(found, [], where);
}

export const text = (page, selector) => page.locator(selector).innerText();

// Waits until what can be seen there matches.
export async function waitForText(page, selector, pattern) {
  try {
    await page.waitForFunction(
      ([where, source]) => {
        const place = document.querySelector(where);
        return place?.checkVisibility() && new RegExp(source).test(place.innerText);
      },
      [selector, pattern.source]);
  } catch {
    assert.fail(`${selector} says "${await text(page, selector)}", not ${pattern}`);
  }
}

// Waits until `check` throws no more: for what the page draws a moment after what was waited for.
export async function eventually(check) {
  for (const end = Date.now() + kPatienceMs;;) {
    try {
      return await check();
    } catch (error) {
      if (Date.now() > end) throw error;
      await new Promise((wake) => setTimeout(wake, 50));
    }
  }
}

// Waits until a search is answered; the names of the hits.
export async function hitNames(page) {
  await waitForText(page, "#search-status", / in \d+\.\d\d s/);
  return page.locator("#results .name").allInnerTexts();
}

const ask = async (address, path, options) => (await fetch(address + path, options)).json();

// Begins a job and waits for its end.
async function finish(address, path, options = {}) {
  const { id } = await ask(address, path, { method: "POST", ...options });
  for (;;) {
    const job = await ask(address, `/v1/jobs/${id}`);
    if (job.state === "done") break;
    assert.ok(["queued", "running"].includes(job.state), JSON.stringify(job));
    await new Promise((wake) => setTimeout(wake, 250));
  }
}

// The demonstration objects, added over HTTP.
export async function loadDemonstration(address) {
  await finish(address, "/v1/collections/default/demo");
  return (await ask(address, "/v1/collections/default/demo")).objects;
}

// A vocabulary of all that is there now: the one that the server trains by itself may be of what was there a moment ago.
export const trainVocabulary = (address, words) => finish(address, "/v1/collections/default/vocabularies", {
  headers: { "Content-Type": "application/json" }, body: JSON.stringify({ words }) });

export async function bytesOf(address, path) {
  const answer = await fetch(address + path);
  assert.equal(answer.status, 200, path);
  return Buffer.from(await answer.arrayBuffer());
}
