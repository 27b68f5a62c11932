// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Browsing without an end; doing something to many; deleting with time to undo.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const kImages = 30;

const server = await house.server("browse", "--auto-train", "false");

async function addImages() {
  for (let i = 0; i < kImages; ++i) {
    const query = `?object=thing%20${i % 3}`;
    const answer = await fetch(`${server.address}/v1/collections/default/images${query}`, {
      method: "POST", headers: { "Content-Type": "image/png" }, body: blobs(100 + i) });
    assert.equal(answer.status, 201);
  }
}

const count = async () => (await (await fetch(`${server.address}/v1/collections/default`)).json()).images;
const cards = (page, view) => page.locator(`#${view}-list .card`);

test("images come as one scrolls, or by a button", async () => {
  await addImages();
  const page = await house.openPage(`${server.address}/#/images`);
  await cards(page, "images").first().waitFor();
  await house.eventually(async () => assert.equal(await cards(page, "images").count(), 24));
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 30);
  const hrefs = await page.locator("#images-list .card > a").evaluateAll((list) => list.map((one) => one.href));
  assert.equal(new Set(hrefs).size, kImages, "each once");
  await house.eventually(async () => assert.equal(await page.getByRole("button", { name: "Show more" }).isVisible(), false));
  await house.shoot(page, "images");
  await house.checkAccessibility(page, "images");
  await house.checkOverlaps(page, "images");

  // What comes next cannot be fetched: it is said, and can be asked for again.
  await page.route("**/images?*cursor=*", (route) => route.abort());
  await page.reload();
  await cards(page, "images").first().waitFor();
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  await house.waitForText(page, "#images-status.error", /cannot be reached/);
  await house.eventually(async () => assert.equal(await cards(page, "images").count(), 24));
  await page.unroute("**/images?*cursor=*");
  await page.getByRole("button", { name: "Show more" }).focus();
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 30);
  assert.equal(await page.evaluate(() => document.activeElement.getAttribute("href")),
               hrefs[24].slice(hrefs[24].indexOf("#")));
  await house.closePage(page);
});

test("an object leads to its images, an image to its page", async () => {
  const page = await house.openPage(`${server.address}/#/objects`);
  await cards(page, "objects").first().waitFor();
  await house.eventually(async () => assert.equal(await cards(page, "objects").count(), 3));
  await house.eventually(async () => assert.match(await cards(page, "objects").nth(1).innerText(), /thing 1\s+10 images/));
  await house.checkAccessibility(page, "objects");
  await cards(page, "objects").nth(1).getByRole("link").click();
  await house.waitForText(page, "#object-title", /^thing 1$/);
  await page.waitForFunction(() => document.querySelectorAll("#object-list .card").length === 10);
  await page.locator("#object-list .card a").first().click();
  await page.waitForFunction(() => !document.querySelector("#view-image").hidden);
  assert.match(page.url(), /#\/image\?id=/);
  await house.closePage(page);
});

test("words find images and objects; the order can be chosen, and stands in the address", async () => {
  const page = await house.openPage(`${server.address}/#/images`);
  const names = (view) => page.locator(`#${view}-list .name`).allInnerTexts();
  await cards(page, "images").first().waitFor();
  await house.waitForText(page, "#images-bar", /30 images/);
  const { images } = await (await fetch(`${server.address}/v1/collections/default/images?sort=-created&limit=1`)).json();
  await house.eventually(async () => assert.match(await page.locator("#images-list .card > a").first().getAttribute("href"), new RegExp(images[0].id)));
  const { images: some } = await (await fetch(`${server.address}/v1/collections/default/images?limit=2`)).json();
  for (const { id } of some) {
    await fetch(`${server.address}/v1/collections/default/images/${id}`, {
      method: "PATCH", headers: { "Content-Type": "application/merge-patch+json" }, body: '{"source": "zebra crossing.png"}' });
  }
  await page.getByRole("searchbox", { name: "Find images" }).pressSequentially("ZEBRA thing", { delay: 20 });
  await house.waitForText(page, "#images-bar", /^\D*2 images/);
  assert.match((await names("images")).join(), /^thing \d,thing \d$/);
  assert.match(page.url(), /#\/images\?q=ZEBRA\+thing$/);
  await house.checkAccessibility(page, "found by words");
  await house.checkOverlaps(page, "found by words");
  await house.shoot(page, "find-images");
  await page.getByRole("combobox", { name: "Order of the images" }).selectOption("created");
  await page.waitForFunction(() => location.hash.includes("sort=created"));
  await page.reload();
  await house.waitForText(page, "#images-bar", /2 images/);
  await house.eventually(async () => assert.equal(await page.getByRole("searchbox", { name: "Find images" }).inputValue(), "ZEBRA thing"));
  await house.eventually(async () => assert.equal(await page.getByRole("combobox", { name: "Order of the images" }).inputValue(), "created"));
  await page.getByRole("searchbox", { name: "Find images" }).fill("nothing like this");
  await house.waitForText(page, "#images-status", /No name or file contains "nothing like this"/);

  await page.goto(`${server.address}/#/objects`);
  await house.waitForText(page, "#objects-bar", /3 objects/);
  await page.getByRole("combobox", { name: "Order of the objects" }).selectOption("-created");
  await page.waitForFunction(() => /^thing 2/.test(document.querySelector("#objects-list .name")?.innerText));
  assert.deepEqual(await names("objects"), ["thing 2", "thing 1", "thing 0"]);
  await page.getByRole("searchbox", { name: "Find objects" }).fill("1");
  await house.waitForText(page, "#objects-bar", /1 object\s/);
  assert.deepEqual(await names("objects"), ["thing 1"]);
  await house.closePage(page);
});

test("deleting can be undone; else it is done when the time is over", async () => {
  const page = await house.openPage(`${server.address}/#/images`);
  await cards(page, "images").first().waitFor();
  const before = await count();
  const remove = page.getByRole("button", { name: /^Delete the image/ }).first();
  await remove.click();
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 23);
  await house.checkAccessibility(page, "deleted");
  await house.shoot(page, "deleted");
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 24);
  assert.equal(await count(), before);

  await remove.click();
  assert.equal(await count(), before, "not before the time is over");
  await page.mouse.move(5, 5);
  await page.locator("#notices .notice").waitFor({ state: "detached" });
  assert.equal(await count(), before - 1);
  await house.closePage(page);
});

test("leaving the page deletes at once; a whole object goes too", async () => {
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Delete thing 2 with its images" }).click();
  await house.waitForText(page, "#notices", /Deleted: thing 2/);
  await page.goto("about:blank");
  const deadline = Date.now() + 20_000;
  const left = async () =>
    (await fetch(`${server.address}/v1/collections/default/objects/thing%202`)).status;
  while (await left() !== 404) {
    assert.ok(Date.now() < deadline, "the object is still there");
    await new Promise((wake) => setTimeout(wake, 100));
  }
  await house.closePage(page);
});

test("an image that cannot be deleted comes back with the reason", async () => {
  const page = await house.openPage(`${server.address}/#/images`);
  await page.route("**/images/*", (route) => (route.request().method() === "DELETE" ?
    route.fulfill({ status: 403, contentType: "application/problem+json",
                    body: JSON.stringify({ code: "forbidden", detail: "no" }) }) : route.continue()));
  await page.getByRole("button", { name: /^Delete the image/ }).first().click();
  await page.mouse.move(5, 5);
  await house.waitForText(page, "#images-list", /does not allow this/);
  await house.closePage(page);
});
