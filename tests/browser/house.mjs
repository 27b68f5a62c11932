// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A real server, a real browser, and what the cases ask of them. Set by run.sh: PLIANT_BIN (folder of
// the programs) and PLIANT_OUT (where screenshots go).
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after } from "node:test";
import { chromium } from "playwright-core";

const kBrowsers = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const kPatienceMs = 120_000;
const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const out = process.env.PLIANT_OUT;
const bin = process.env.PLIANT_BIN;
assert.ok(out && bin, "run this by tests/browser/run.sh");
mkdirSync(out, { recursive: true });

// A server with an empty database of its own. RootSIFT describes quickly; `flags` may say otherwise.
export async function startServer(...flags) {
  const folder = mkdtempSync(join(tmpdir(), "pliant-browser-"));
  const program = spawn(join(bin, "pliant-server"), [
    "--db", join(folder, "test.db"), "--listen", "127.0.0.1:0",
    ...(flags.includes("--descriptor") ? [] : ["--descriptor", "rootsift"]), ...flags]);
  let log = "";
  program.stderr.on("data", (text) => { log += text; });
  const ended = new Promise((end) => program.once("exit", end));
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
    async stop() {
      program.kill("SIGTERM");
      await ended;
      rmSync(folder, { recursive: true, force: true });
    },
  };
}

// Servers that cases share, by name; started when first asked for.
const servers = new Map();
export function server(name, ...flags) {
  if (!servers.has(name)) servers.set(name, startServer(...flags));
  return servers.get(name);
}

let launched = null;
const browser = () => (launched ??= startBrowser());

after(async () => {
  await (await launched)?.close();
  for (const one of servers.values()) await (await one).stop();
});

async function startBrowser() {
  const executablePath = kBrowsers.find(existsSync);
  assert.ok(executablePath, "Debian's chromium package is not installed");
  // No sandbox inside: tests run as root and in containers.
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"] });
}

// A page of its own context. page.faults: what must never happen, wherever it happens.
export async function openPage(url, { width = 1200, height = 900, ...more } = {}) {
  const context = await (await browser()).newContext({ viewport: { width, height }, ...more });
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
  await servePageFrom(page, process.env.PLIANT_WEB);
  await page.goto(url);
  return page;
}

// While the page is being written: its files from a folder, in place of those built into the server.
async function servePageFrom(page, folder) {
  if (!folder) return;
  const types = { html: "text/html", css: "text/css", js: "text/javascript" };
  await page.route(/\/(assets\/[^?]*)?$/, (route) => {
    const name = new URL(route.request().url()).pathname.replace("/assets/", "").replace(/^\/$/, "index.html");
    return route.fulfill({ body: readFileSync(join(folder, name)),
                           contentType: `${types[name.split(".").pop()]}; charset=utf-8` });
  });
}

export async function closePage(page) {
  assert.deepEqual(page.faults, []);
  await page.context().close();
}

export const shoot = (page, name) =>
  page.screenshot({ path: join(out, `${name}.png`), fullPage: true, animations: "disabled" });

// No violation of axe-core's rules (WCAG 2.2 A and AA, and its best practices).
export async function checkAccessibility(page, where) {
  await page.evaluate(axeSource);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
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

// Waits until a search is answered; the names of the hits.
export async function hitNames(page) {
  await waitForText(page, "#search-status", /result/);
  return page.locator("#results .name").allInnerTexts();
}

// The demonstration objects, added over HTTP.
export async function loadDemonstration(address) {
  const ask = async (path, options) => (await fetch(address + path, options)).json();
  const { id } = await ask("/v1/collections/default/demo", { method: "POST" });
  for (;;) {
    const job = await ask(`/v1/jobs/${id}`);
    if (job.state === "done") break;
    assert.ok(["queued", "running"].includes(job.state), JSON.stringify(job));
    await new Promise((wake) => setTimeout(wake, 250));
  }
  return (await ask("/v1/collections/default/demo")).objects;
}

export async function bytesOf(address, path) {
  const answer = await fetch(address + path);
  assert.equal(answer.status, 200, path);
  return Buffer.from(await answer.arrayBuffer());
}
