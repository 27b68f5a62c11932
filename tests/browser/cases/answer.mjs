// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What an answer says first, and what it keeps folded away.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs, noisyThing } from "../images.mjs";

const server = await house.server("demonstration");

const unknown = { name: "unknown.png", mimeType: "image/png", buffer: blobs(77, 480, 360) };

test("what is not in the collection is said to be so; nothing is chosen, nothing outlined", async () => {
  await house.loadDemonstration(server.address);
  await house.trainVocabulary(server.address, 600);
  const page = await house.openPage(server.address);
  await page.locator("#search-file").setInputFiles(unknown);
  await house.waitForText(page, "#search-status", /^Not found\.[^]*If the object is small in your photo, select the part that shows it\.$/);
  await house.eventually(async () => assert.equal(await page.locator("#results .hit").count(), 0));
  await house.eventually(async () => assert.equal(await page.locator(".hit:visible").count(), 0));
  await house.eventually(async () => assert.equal(await page.locator("#compare").isVisible(), false));
  await house.eventually(async () => assert.equal(await page.locator(".tag").count(), 0));
  await house.shoot(page, "not-found");
  await house.checkAccessibility(page, "not found");
  await house.closePage(page);
});

test("of two objects that look the same neither is found; both are named and shown", async () => {
  const own = await house.startServer();  // what is added here is nothing to others
  await house.loadDemonstration(own.address);
  for (const [noise, object] of [[1, "sweet yoghurt"], [2, "sour yoghurt"]]) {
    const added = await fetch(`${own.address}/v1/collections/default/images/${noise}?object=${encodeURIComponent(object)}`,
                              { method: "PUT", body: noisyThing(5, noise), headers: { "content-type": "image/png" } });
    assert.equal(added.status, 201);
  }
  await house.trainVocabulary(own.address, 600);
  const page = await house.openPage(own.address);
  await page.locator("#search-file").setInputFiles({ name: "photo.png", mimeType: "image/png", buffer: noisyThing(5, 3) });
  await house.waitForText(page, "#search-status", /^Perhaps: (sweet yoghurt or sour|sour yoghurt or sweet) yoghurt\.\s+2 possible matches in /);
  await house.eventually(async () => assert.equal(await page.locator(".hit:visible").count(), 2));
  await house.eventually(async () => assert.ok(await page.locator("#compare").isVisible(), "the first one is chosen"));
  await house.shoot(page, "perhaps");
  await house.checkAccessibility(page, "perhaps");
  await house.closePage(page);
  await own.stop();
});

// An answer of the server's form: `strong` hits that are found, the rest hardly alike.
function answerOf(strong, total) {
  return (route) => {
    const form = route.request().postData();
    const offset = Number(/name="offset"\r\n\r\n(\d+)/.exec(form)[1]);
    const limit = Number(/name="limit"\r\n\r\n(\d+)/.exec(form)[1]);
    const hits = Array.from({ length: Math.min(limit, total - offset) }, (_, i) => ({
      rank: offset + i + 1, object: `thing ${offset + i + 1}`, image_id: `id-${offset + i}`, source: "",
      score: offset + i < strong ? 0.9 : 0.001, probability: offset + i < strong ? 0.99 : 0.03, verdict: offset + i < strong ? "found" : "unlikely", inliers: 0,
      polygon: null, instances: [], metadata: {} }));
    return route.fulfill({ json: { took_ms: 5, total, found: strong, hits } });
  };
}

test("weak results are folded away and counted; a button opens them, and more can be asked for", async () => {
  const page = await house.openPage(server.address);
  await page.route("**/search", answerOf(1, 32));
  await page.locator("#search-file").setInputFiles(unknown);
  await house.waitForText(page, "#search-status", /^Found: thing 1\.\s+1 match in /);
  const toggle = page.locator("#weaker-toggle");
  await house.eventually(async () => assert.equal(await toggle.innerText(), "31 weaker results"));
  await house.eventually(async () => assert.equal(await toggle.getAttribute("aria-expanded"), "false"));
  await house.eventually(async () => assert.equal(await page.locator(".hit:visible").count(), 1));
  await house.eventually(async () => assert.equal(await page.locator("#results-more").isVisible(), false));
  await toggle.click();
  await house.eventually(async () => assert.equal(await toggle.getAttribute("aria-expanded"), "true"));
  await house.eventually(async () => assert.equal(await page.locator(".hit:visible").count(), 12));
  await house.eventually(async () => assert.doesNotMatch(await house.text(page, "#weaker"), /score|0\.00/));
  await house.checkAccessibility(page, "weaker results");
  await page.getByRole("button", { name: "Show more" }).click();
  await page.waitForFunction(() => document.querySelectorAll(".hit").length === 24);
  await toggle.click();
  await house.eventually(async () => assert.equal(await page.locator(".hit:visible").count(), 1));
  await house.closePage(page);
});

test("a hit leads to its object, and shows its labels; an address among them is a link, other schemes are not", async () => {
  const page = await house.openPage(server.address);
  const labels = [{ shelf: 4, url: "https://shop.example/things?id=7" }, { url: "javascript:alert(1)" }, { site: "https://shop.example/" }];
  await page.route("**/search", (route) => route.fulfill({ json: { took_ms: 5, total: 3, found: 3, mirrored: true, hits: labels.map((metadata, i) => ({
    rank: i + 1, object: i ? `thing ${i}` : "poster", image_id: `id-${i}`, source: "", score: 0.9, probability: 0.99, verdict: "found", inliers: 9,
    polygon: null, instances: [], metadata })) } }));
  await page.locator("#search-file").setInputFiles(unknown);
  await house.waitForText(page, "#results .hit:first-child .labels", /^shelf: 4\s*url: https:\/\/shop\.example\/things\?id=7$/);
  await house.waitForText(page, "#search-status", /Your photo is mirrored\.$/);
  const links = await page.locator("#results .labels a").evaluateAll((list) => list.map(({ href, rel }) => [href, rel]));
  assert.deepEqual(links, [["https://shop.example/things?id=7", "noopener noreferrer"]]);
  await house.waitForText(page, "#results .hit:nth-child(2) .labels", /^url: javascript:alert\(1\)$/);
  await house.checkAccessibility(page, "labels of hits");
  await house.checkOverlaps(page, "labels of hits");
  await house.shoot(page, "hit-labels");
  await page.getByRole("link", { name: "Open object poster" }).click();
  await house.waitForText(page, "#object-title", /^poster$/);
  await house.closePage(page);
});

test("a search that takes long says that it looks closer", async () => {
  const page = await house.openPage(server.address);
  let answer = null;
  await page.route("**/search", (route) => { answer = () => answerOf(1, 1)(route); });
  await page.locator("#search-file").setInputFiles(unknown);
  await house.waitForText(page, "#search-status", /^Looking closer…$/);
  await answer();
  await house.waitForText(page, "#search-status", /^Found: thing 1\./);
  await house.closePage(page);
});

test("when all of a page are found, more can be asked for at once", async () => {
  const page = await house.openPage(server.address);
  await page.route("**/search", answerOf(14, 14));
  await page.locator("#search-file").setInputFiles(unknown);
  await house.waitForText(page, "#search-status", /^14 objects found: thing 1, thing 2, thing 3, thing 4 and 10 more\./);
  await house.eventually(async () => assert.equal(await page.locator("#weaker-toggle").isVisible(), false));
  await page.getByRole("button", { name: "Show more" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#results .hit").length === 14);
  assert.match(await page.evaluate(() => document.activeElement.textContent), /^13\. thing 13/);
  await house.closePage(page);
});
