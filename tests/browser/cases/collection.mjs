// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A collection's page: size, vocabularies, training, and other collections.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const server = await house.server("collection", "--auto-train", "false");

test("what to do is said in words, training is followed, a vocabulary can be chosen", async () => {
  const page = await house.openPage(`${server.address}/#/collection`);
  const advanced = page.locator("summary", { hasText: "Advanced" });
  await advanced.click();
  await house.waitForText(page, "#recommendation", /Add images first/);
  await house.loadDemonstration(server.address);
  await page.reload();
  await house.waitForText(page, "#advanced-note", /There is no vocabulary yet/);
  assert.equal(await page.locator("#recommendation").isVisible(), false);
  await advanced.click();
  await house.waitForText(page, "#recommendation", /no vocabulary yet[^]*Train one now/);
  await house.eventually(async () => assert.match(await house.text(page, "#collection-facts"), /Images\s+6\s+Objects\s+6/));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await house.waitForText(page, "#recommendation", /The vocabulary fits/);
  await house.eventually(async () => assert.match(await house.text(page, "#jobs"), /Preparing search\s*done/));
  await page.getByRole("button", { name: "Retrain" }).click();
  await page.locator("#vocabularies tr").nth(1).waitFor();
  await page.getByRole("button", { name: "Use vocabulary 1" }).click();
  await house.waitForText(page, "#notices", /Vocabulary 1 is in use/);
  await page.getByRole("button", { name: "Use vocabulary 2" }).waitFor();
  await house.shoot(page, "collection");
  await house.checkAccessibility(page, "collection");
  await house.closePage(page);
});

test("a new collection is entered; all links stay in it; it is renamed and deleted on its page", async () => {
  const page = await house.openPage(`${server.address}/#/collection`);
  const create = async (name) => {
    await page.getByLabel("New collection").fill(name);
    await page.getByRole("button", { name: "Create", exact: true }).click();
    await house.waitForText(page, "#collection-title", new RegExp(`^Collection: ${name}$`));
    await house.waitForText(page, "#notices", new RegExp(`Collection ${name} created`));
  };
  await create("attic");
  assert.match(page.url(), /#\/collection\?in=attic$/);
  const links = await page.locator('a[href^="#/"]').evaluateAll((list) => list.filter((one) => !one.closest("#collections"))
    .map((one) => one.getAttribute("href")).filter((href) => !href.includes("in=attic")));
  assert.deepEqual(links, []);
  await page.getByRole("link", { name: "Pliant" }).click();  // the logo
  await page.locator("#welcome").waitFor();
  assert.match(page.url(), /#\/search\?in=attic$/);
  await page.getByLabel("Collection", { exact: true }).selectOption("default");
  await page.locator("#examples").waitFor();

  await page.goto(`${server.address}/#/collection`);
  await create("Summer shirts 2026!");
  assert.match(page.url(), /in=summer-shirts-2026$/);
  await page.getByLabel("Name of this collection").fill("Winter");
  await page.getByRole("button", { name: "Rename" }).click();
  await house.waitForText(page, "#collection-title", /^Collection: Winter$/);
  await house.waitForText(page, "#collections", /Winter \(this one\)\s*summer-shirts-2026/);
  await house.shoot(page, "collection-named");
  await house.checkAccessibility(page, "named collection");
  await house.checkWidth(page, "named collection");

  await page.getByRole("link", { name: "attic" }).click();
  await house.waitForText(page, "#collection-title", /attic/);
  await page.getByRole("button", { name: "Delete collection attic" }).click();
  await Promise.all([page.waitForResponse((one) => one.url().endsWith("/v1/collections")),
                     page.getByRole("link", { name: "Collection", exact: true }).click()]);  // the same page again
  await page.getByRole("button", { name: "Delete all" }).click();
  await house.waitForText(page, "#notices", /Collection attic deleted/);
  await house.waitForText(page, "#collections", /^(?![^]*attic)/);
  await house.waitForText(page, "#collection-title", /^Collection: default$/);
  assert.equal((await fetch(`${server.address}/v1/collections/attic`)).status, 404);
  assert.equal(await page.getByRole("button", { name: /^Delete collection/ }).count(), 0, "the default collection stays");
  await house.closePage(page);
});

test("Add says to which collection images go; another one is chosen there", async () => {
  await fetch(`${server.address}/v1/collections/shelf`, { method: "PUT" });
  const page = await house.openPage(`${server.address}/#/add`);
  await page.locator("#add-files").setInputFiles([{ name: "box.png", mimeType: "image/png", buffer: blobs(700) }]);
  await page.getByLabel("Images go to the collection").selectOption("shelf");
  await page.waitForFunction(() => location.hash === "#/add?in=shelf");
  await house.waitForText(page, "#collection-label", /shelf/);
  assert.equal(await page.locator("#collection-choice").inputValue(), "shelf");
  await house.checkAccessibility(page, "add to a collection");
  await house.shoot(page, "add-collection");
  await page.getByRole("button", { name: "Add 1 image" }).click();
  await house.waitForText(page, "#add-status", /Finished: 1 image added\./);
  const { images } = await (await fetch(`${server.address}/v1/collections/shelf/images`)).json();
  assert.deepEqual(images.map(({ source }) => source), ["box.png"]);
  await page.getByRole("link", { name: "Search with a photo" }).click();
  assert.match(page.url(), /#\/search\?in=shelf$/);
  await house.closePage(page);
});
