// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A collection's page: size, vocabularies, training, and other collections.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("collection", "--auto-train", "false");

test("what to do is said in words, training is followed, a vocabulary can be chosen", async () => {
  const page = await house.openPage(`${server.address}/#/collection`);
  await house.waitForText(page, "#recommendation", /Add images first/);
  await house.loadDemonstration(server.address);
  await page.reload();
  await house.waitForText(page, "#recommendation", /no vocabulary yet[^]*Train one now/);
  await house.eventually(async () => assert.match(await house.text(page, "#collection-facts"), /Images\s+6\s+Objects\s+6/));
  await page.getByRole("button", { name: "Train", exact: true }).click();
  await house.waitForText(page, "#recommendation", /The vocabulary fits/);
  await house.eventually(async () => assert.match(await house.text(page, "#jobs"), /Preparing search\s*done/));
  await page.getByRole("button", { name: "Retrain" }).click();
  await page.locator("#vocabularies tr").nth(1).waitFor();
  await page.getByRole("button", { name: "Use vocabulary 1" }).click();
  await house.waitForText(page, "#retrain-status", /Vocabulary 1 is in use/);
  await page.getByRole("button", { name: "Use vocabulary 2" }).waitFor();
  await house.shoot(page, "collection");
  await house.checkAccessibility(page, "collection");
  await house.closePage(page);
});

test("collections are made, entered and deleted", async () => {
  const page = await house.openPage(`${server.address}/#/collection`);
  await page.locator("#collection-name").fill("attic");
  await page.getByRole("button", { name: "Create", exact: true }).click();
  await house.waitForText(page, "#collection-made", /Collection attic created/);
  await page.getByRole("link", { name: "attic" }).click();
  await house.waitForText(page, "#collection-title", /attic/);
  await page.getByRole("link", { name: "Search", exact: true }).click();
  await page.locator("#welcome").waitFor();
  await page.getByLabel("Collection", { exact: true }).selectOption("default");
  await page.locator("#examples").waitFor();
  await page.goto(`${server.address}/#/collection`);
  await page.getByLabel("New collection").fill("Summer shirts 2026!");
  await page.getByRole("button", { name: "Create", exact: true }).click();
  await house.waitForText(page, "#collection-made", /Collection Summer shirts 2026! created/);
  await page.getByRole("link", { name: "Summer shirts 2026!" }).click();
  await house.waitForText(page, "#collection-title", /^Collection: Summer shirts 2026!$/);
  assert.match(page.url(), /in=summer-shirts-2026$/);
  await page.getByLabel("Collection", { exact: true }).selectOption({ label: "Summer shirts 2026!" });
  await page.goto(`${server.address}/#/collection?in=summer-shirts-2026`);
  await page.getByLabel("Name of this collection").fill("Winter");
  await page.getByRole("button", { name: "Rename" }).click();
  await house.waitForText(page, "#collection-title", /^Collection: Winter$/);
  await house.waitForText(page, "#collections", /Winter \(this one\)\s*summer-shirts-2026/);
  await house.shoot(page, "collection-named");
  await house.checkAccessibility(page, "named collection");
  await house.checkWidth(page, "named collection");
  await page.goto(`${server.address}/#/collection`);
  await page.getByRole("button", { name: "Delete the collection attic" }).click();
  await Promise.all([page.waitForResponse((one) => one.url().endsWith("/v1/collections")),
                     page.getByRole("link", { name: "Collection", exact: true }).click()]);  // the same ones, shown anew
  await page.getByRole("button", { name: "Delete all" }).click();
  await house.waitForText(page, "#collection-made", /Collection attic deleted/);
  await house.waitForText(page, "#collections", /^(?![^]*attic)/);
  assert.equal((await fetch(`${server.address}/v1/collections/attic`)).status, 404);
  await house.closePage(page);
});
