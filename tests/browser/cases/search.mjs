// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ways to ask: file, paste, drop, link; filters; what goes wrong; by keyboard alone.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blank } from "../images.mjs";

const server = await house.server("demonstration");
let crumpled;

async function prepare() {
  const objects = await house.loadDemonstration(server.address);
  const poster = objects.find(({ object }) => object === "poster");
  crumpled = await house.bytesOf(server.address, poster.crumpled);
}

const image = () => ({ name: "mine.jpg", mimeType: "image/jpeg", buffer: crumpled });

// Gives the page a file by an event, as dropping and pasting do.
const give = (page, selector, type) => page.evaluate(([where, kind, base64]) => {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const transfer = new DataTransfer();
  transfer.items.add(new File([bytes], "mine.jpg", { type: "image/jpeg" }));
  const event = kind === "paste" ? new ClipboardEvent("paste", { clipboardData: transfer, bubbles: true }) :
    new DragEvent(kind, { dataTransfer: transfer, bubbles: true, cancelable: true });
  document.querySelector(where).dispatchEvent(event);
}, [selector, type, crumpled.toString("base64")]);

test("a chosen, a pasted and a dropped image are searched with", async () => {
  await prepare();
  for (const how of ["choose", "paste", "drop"]) {
    const page = await house.openPage(server.address);
    if (how === "choose") await page.locator("#search-file").setInputFiles(image());
    else await give(page, how === "drop" ? "#search-drop" : "body", how);
    assert.match((await house.hitNames(page))[0], /poster/, how);
    await house.closePage(page);
  }
});

test("a search survives Reload, Back and Forward", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await page.locator("#search-file").setInputFiles(image());
  await house.waitForText(page, "#search-status", /^Found: poster/);
  const first = page.url();
  assert.match(first, /#\/search\?photo=/);
  await page.reload();
  await house.waitForText(page, "#search-status", /^Found: poster/);
  await page.getByRole("button", { name: "crumpled photo of town map" }).click();
  await house.waitForText(page, "#search-status", /^Found: town map/);
  await page.goBack();
  await house.waitForText(page, "#search-status", /^Found: poster/);
  assert.equal(page.url(), first);
  await page.goForward();
  await house.waitForText(page, "#search-status", /^Found: town map/);
  await page.getByRole("link", { name: "Search", exact: true }).click();
  await page.locator("#workspace").waitFor({ state: "hidden" });
  await page.goBack();
  await house.waitForText(page, "#search-status", /^Found: town map/);
  await page.goto(`${server.address}/#/search?photo=gone`);
  await house.waitForText(page, "#search-status.error", /no longer keeps that photo/);
  for (let i = 0; i < 8; ++i) {
    await page.evaluate(async () => (await import("/assets/kept.js")).keepQuery(new File(["x"], "x.png")));
  }
  assert.equal(await page.evaluate(() => new Promise((good) => {
    indexedDB.open("pliant").onsuccess = ({ target }) => {
      target.result.transaction("queries").objectStore("queries").count().onsuccess = (event) => good(event.target.result);
    };
  })), 6, "no more than that are kept");
  await house.closePage(page);
});

test("a stored image has a link that can be shared", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/search?image=demo-newspaper`);
  await house.waitForText(page, "#search-status", /^(No other similar object found|Perhaps)/);
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.locator("#share").click();
  await house.waitForText(page, "#notices", /copied/);
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.equal(link, `${server.address}/#/search?image=demo-newspaper`);
  await house.closePage(page);

  const gone = await house.openPage(`${server.address}/#/search?image=nothing`);
  await house.waitForText(gone, "#search-status.error", /no longer exists/);
  await house.closePage(gone);
});

test("filters limit what is found", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await page.locator("#search-file").setInputFiles(image());
  assert.equal((await house.hitNames(page)).length, 1);
  await page.locator("#filters summary").click();
  await page.locator("#filter-object").fill("town map");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await house.waitForText(page, "#search-status", /^Not found with these filters/);
  await page.getByRole("button", { name: "1 weaker result" }).click();
  await house.waitForText(page, "#weaker", /^\s*1\. town map/);
  await page.locator("#filters-form").getByRole("button", { name: "Clear" }).click();
  await house.waitForText(page, "#results", /^\s*1\. poster/);
  await page.locator("#filter-labels").fill("made_of=cloth");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await page.getByRole("button", { name: "2 weaker results" }).click();
  await house.waitForText(page, "#weaker", /made_of: cloth/);
  await page.locator("#filter-labels").fill("made_of=stone");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await house.waitForText(page, "#results-empty", /No match/);
  await page.locator("#filter-labels").fill("no label at all");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await house.waitForText(page, "#search-status.error", /name=value/);
  await page.locator("#search-file").setInputFiles(image());  // a filter that was mistyped does not hold for the next photo
  await house.waitForText(page, "#search-status", /^Found: poster/);
  assert.equal(await page.locator("#filter-labels").inputValue(), "");
  await page.locator("#filter-object").fill("pooster");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await house.waitForText(page, "#results-empty", /No match/);
  await page.locator("#search-file").setInputFiles(image());
  await house.waitForText(page, "#search-status", /^Found: poster/);
  await house.closePage(page);
});

test("what a search is limited to survives Reload and Back, and goes with its link", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await page.locator("#search-file").setInputFiles(image());
  await house.waitForText(page, "#search-status", /^Found: poster/);
  await page.locator("#filters summary").click();
  await page.locator("#filter-labels").fill("made_of=cloth");
  await page.locator("#filter-limit").selectOption("24");
  await page.locator("#filters-form").getByRole("button", { name: "Apply" }).click();
  await house.waitForText(page, "#search-status", /^Not found with these filters/);
  await page.reload();
  await house.waitForText(page, "#search-status", /^Not found with these filters/);
  assert.equal(await page.locator("#filter-labels").inputValue(), "made_of=cloth");
  assert.equal(await page.locator("#filter-limit").inputValue(), "24");
  assert.match(await house.text(page, "#filters-set"), /1 set/);
  await page.getByRole("button", { name: "crumpled photo of town map" }).click();  // they hold for the next one
  await house.waitForText(page, "#search-status", /^(Found|Not found)/);
  await page.locator("#filters summary").click();
  await page.locator("#filters-form").getByRole("button", { name: "Clear" }).click();
  await house.waitForText(page, "#search-status", /^Found: town map/);
  await page.locator("#region-start").focus();
  await page.keyboard.press("Enter");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#search-status", /in this part: town map/);
  const part = await page.locator("#region").getAttribute("aria-label");
  await page.reload();
  await house.waitForText(page, "#search-status", /in this part: town map/);
  assert.equal(await page.locator("#region").getAttribute("aria-label"), part);
  await page.goBack();
  await house.waitForText(page, "#search-status", /^Not found with these filters/);
  assert.equal(await page.locator("#region").isVisible(), false);
  await page.goForward();
  await house.waitForText(page, "#search-status", /in this part: town map/);
  assert.equal(await page.locator("#filter-labels").inputValue(), "");

  // A link says all of it; what makes no sense in one is left out.
  await page.goto(`${server.address}/#/search?image=demo-newspaper&min_score=0.3&group_by=image&limit=7&part=a,b`);
  await house.waitForText(page, "#search-status", /^Not found with these filters/);
  assert.deepEqual([await page.locator("#filter-score").inputValue(), await page.locator("#filter-group").inputValue(),
                    await page.locator("#filter-limit").inputValue()], ["0.3", "image", "12"]);
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.locator("#share").click();
  await house.waitForText(page, "#notices", /copied/);
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()),
               `${server.address}/#/search?image=demo-newspaper&min_score=0.3&group_by=image`);
  await house.closePage(page);
});

test("what goes wrong is said in words", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  const ask = (name, mimeType, buffer) =>
    page.locator("#search-file").setInputFiles({ name, mimeType, buffer });
  await ask("notes.txt", "text/plain", Buffer.from("These are words, no image."));
  await house.waitForText(page, "#search-status.error", /cannot read this file as an image/);
  await ask("blank.png", "image/png", blank());
  await house.waitForText(page, "#search-status.error", /too little detail/);
  await ask("large.png", "image/png", Buffer.alloc(34_000_000));
  await house.waitForText(page, "#search-status.error", /^The file is too large: this server accepts up to 32 MiB/);
  await ask("half.jpg", "image/jpeg", crumpled.subarray(0, crumpled.length / 2));
  await house.waitForText(page, "#search-status.error", /ends too early|damaged/);
  await house.shoot(page, "error");
  await house.checkAccessibility(page, "error");
  await ask("mine.jpg", "image/jpeg", crumpled);
  assert.match((await house.hitNames(page))[0], /poster/, "it goes on after errors");
  await house.closePage(page);
});

test("a server that is gone is said in words", async () => {
  await prepare();
  const other = await house.startServer();
  const page = await house.openPage(other.address);
  await page.locator("#welcome").waitFor();
  await other.stop();
  await page.locator("#search-file").setInputFiles(image());
  await house.waitForText(page, "#search-status.error", /cannot be reached/);
  await house.closePage(page);
});

test("a busy server is asked again", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  let refused = 0;
  await page.route("**/search", (route) => {
    if (++refused > 1) return route.continue();
    return route.fulfill({ status: 503, headers: { "Retry-After": "1" },
                           contentType: "application/problem+json",
                           body: JSON.stringify({ code: "busy", detail: "busy" }) });
  });
  await page.locator("#search-file").setInputFiles(image());
  assert.match((await house.hitNames(page))[0], /poster/);
  assert.equal(refused, 2);
  await house.closePage(page);
});

test("by keyboard alone: skip, choose an example, compare, select a part", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await page.locator("#examples-list button").first().waitFor();
  const focused = () => page.evaluate(() => {
    const { id, textContent, ariaLabel } = document.activeElement;
    return `${id} ${ariaLabel ?? textContent.trim()}`;
  });
  const tabTo = async (pattern) => {
    for (let i = 0; i < 40; ++i) {
      if (pattern.test(await focused())) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`Tab does not lead to ${pattern}, but to ${await focused()}`);
  };
  await page.keyboard.press("Tab");
  assert.match(await focused(), /^skip/);
  await page.keyboard.press("Enter");
  await tabTo(/search-file/);
  await tabTo(/crumpled photo of poster/);
  await page.keyboard.press("Enter");
  assert.match((await house.hitNames(page))[0], /poster/);
  await tabTo(/region-start/);
  await page.keyboard.press("Enter");
  assert.match(await focused(), /^region /);
  const before = await focused();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowDown");
  const [, left, top, width, height] = /left (\d+), top (\d+), width (\d+), height (\d+)/.exec(before);
  const [, left2, top2, width2, height2] =
    /left (\d+), top (\d+), width (\d+), height (\d+)/.exec(await focused());
  assert.ok(+left2 > +left && top2 === top && width2 === width && +height2 > +height, await focused());
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#search-status", /in this part: poster/);
  await page.keyboard.press("Escape");
  await house.waitForText(page, "#search-status", /^Found: poster/);
  await tabTo(/^weaker-toggle 5 weaker results/);
  await page.keyboard.press("Enter");
  await tabTo(/^ *2\. /);
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#compare-title", /^Compare: (?!poster)/);
  await house.closePage(page);
});
