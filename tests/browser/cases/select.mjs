// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several images or objects at once: chosen, moved, labelled, made one, deleted; thumbnails are kept by the browser.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const kPhone = { width: 390, height: 844, hasTouch: true, isMobile: true };
const server = await house.server("select", "--auto-train", "false");
const base = `${server.address}/v1/collections/default`;
const images = async (query = "") => (await (await fetch(`${base}/images?limit=100${query}`)).json()).images;

async function prepare() {
  for (const { id } of await images()) await fetch(`${base}/images/${id}`, { method: "DELETE" });
  for (let i = 0; i < 9; ++i) {
    const query = new URLSearchParams({ object: `box ${i % 3}`, metadata: JSON.stringify({ n: i, old: true }) });
    const answer = await fetch(`${base}/images/p${i}?${query}`, {
      method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(700 + i) });
    assert.ok(answer.ok);
  }
}

const box = (page, name) => page.getByRole("checkbox", { name: `Select ${name}`, exact: true });

test("images are moved and labelled together; what fails is said and stays selected", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images?sort=created`);
  await page.locator("#images-list .card").nth(8).waitFor();
  await page.getByRole("button", { name: "Select several" }).click();
  await box(page, "p0").check();
  await box(page, "p3").click({ modifiers: ["Shift"] });
  await house.waitForText(page, "#images-bar + .selection", /4 images selected/);
  await page.locator("#images-list .card > a").nth(3).click();  // the image itself, too
  await house.waitForText(page, "#images-bar + .selection", /3 images selected/);
  assert.match(page.url(), /#\/images\?sort=created$/);
  await house.checkAccessibility(page, "selecting");
  await house.checkOverlaps(page, "selecting");
  await house.shoot(page, "selecting");

  await page.getByRole("button", { name: "Done", exact: true }).click();
  await house.eventually(async () => assert.equal(await page.locator(".pick:visible").count(), 0));
  await page.getByRole("button", { name: "Select several" }).click();
  await box(page, "p0").check();
  await box(page, "p2").click({ modifiers: ["Shift"] });
  await house.waitForText(page, "#images-bar + .selection", /3 images selected/);

  await page.getByRole("button", { name: "Name…" }).click();
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("crate");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#notices", /3 images moved to crate/);
  assert.deepEqual((await images("&object=crate")).map(({ id }) => id).sort(), ["p0", "p1", "p2"]);
  await page.locator("#notices").getByRole("button", { name: "Undo" }).click();
  await house.eventually(async () => assert.deepEqual((await images("&sort=id")).map(({ object }) => object).slice(0, 3), ["box 0", "box 1", "box 2"]));

  await page.getByRole("button", { name: "Select several" }).click();
  await page.getByRole("button", { name: "All shown" }).click();
  await house.waitForText(page, "#images-bar + .selection", /9 images selected/);
  await page.getByRole("button", { name: "Label…" }).click();
  await page.getByLabel("Labels to add").fill("no label");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#images-bar + .selection .error", /name=value/);
  await page.getByLabel("Labels to add").fill("shelf=4, old=");
  await page.route("**/images/p5", (route) => (route.request().method() === "PATCH" ? route.fulfill({
    status: 507, contentType: "application/problem+json", body: JSON.stringify({ code: "no_space" }) }) : route.continue()));
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#images-bar + .selection .error", /1 image could not be changed\. The server's disk is full/);
  await house.waitForText(page, "#images-bar + .selection", /1 image selected/);
  await page.unroute("**/images/p5");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#notices", /1 image labelled/);
  for (const { id, metadata } of await images()) assert.deepEqual(metadata, { n: Number(id[1]), shelf: 4 });
  await house.closePage(page);
});

test("several are deleted at once, and undone at once", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`, kPhone);
  await page.locator("#images-list .card").nth(8).waitFor();
  await page.getByRole("button", { name: "Select several" }).click();
  await box(page, "p1").check();
  await box(page, "p2").check();
  await house.checkWidth(page, "selecting, phone");
  await house.checkOverlaps(page, "selecting, phone");
  await house.shoot(page, "selecting-phone");
  await page.locator("#images-bar + .selection").getByRole("button", { name: "Delete" }).click();
  await house.waitForText(page, "#notices", /Deleted: 2 images/);
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 7);
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length === 9);
  assert.equal((await images()).length, 9);

  await page.getByRole("button", { name: "Select several" }).click();
  await box(page, "p1").check();
  await box(page, "p2").check();
  await page.locator("#images-bar + .selection").getByRole("button", { name: "Delete" }).click();
  await page.goto("about:blank");  // leaving deletes at once
  const deadline = Date.now() + 20_000;
  while ((await images()).length !== 7) {
    assert.ok(Date.now() < deadline, "they are still there");
    await new Promise((wake) => setTimeout(wake, 100));
  }
  await house.closePage(page);
});

test("several objects become one", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.locator("#objects-list .card").nth(2).waitFor();
  await page.getByRole("button", { name: "Select several" }).click();
  await box(page, "box 0").check();
  await box(page, "box 2").check();
  await page.getByRole("button", { name: "Merge…" }).click();
  await house.eventually(async () => assert.equal(await page.getByLabel("Name of the merged object").inputValue(), "box 0"));
  await page.getByLabel("Name of the merged object").fill("chest");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#notices", /2 objects merged into chest/);
  await house.waitForText(page, "#objects-list", /chest\s+6 images/);
  assert.equal((await images("&object=chest")).length, 6);
  await house.closePage(page);
});

test("images and objects move to another collection", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  const choose = async (view, name, count) => {
    await page.goto("about:blank");
    await page.goto(`${server.address}/#/${view}`);
    await page.locator(`#${view}-list .card`).nth(count - 1).waitFor();
    await page.getByRole("button", { name: "Select several" }).click();
    await box(page, name).check();
    await page.getByRole("button", { name: "Move…" }).click();
  };
  await choose("images", "p0", 9);
  await house.waitForText(page, "#notices .error", /no other collection/);
  await fetch(`${server.address}/v1/collections/winter`, { method: "PUT" });
  await choose("images", "p0", 9);
  await house.checkAccessibility(page, "moving");
  await house.shoot(page, "moving");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#notices", /1 image moved to winter/);
  assert.equal((await images()).length, 8);
  await choose("objects", "box 0", 3);
  await page.locator("#view-objects").getByLabel("To the collection").selectOption("winter");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#notices", /1 object moved to winter/);
  assert.equal((await images()).length, 6);
  await page.goto(`${server.address}/#/objects?in=winter`);
  await house.waitForText(page, "#objects-list", /box 0\s+3 images/);
  await fetch(`${server.address}/v1/collections/winter`, { method: "DELETE" });
  await house.closePage(page);
});

test("thumbnails are kept by the browser: a second look asks for none", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  const loaded = () => page.waitForFunction(() => {
    const list = [...document.querySelectorAll("#images-list img")];
    return list.length === 9 && list.every((image) => image.complete && image.naturalWidth > 0);
  });
  await loaded();
  await page.goto(`${server.address}/#/objects`);
  await page.goto("about:blank");
  await page.goto(`${server.address}/#/images`);
  await loaded();
  const transferred = await page.evaluate(() => performance.getEntriesByType("resource")
    .filter(({ name }) => name.includes("/thumbnail?sha256=")).map(({ transferSize }) => transferSize));
  assert.equal(transferred.length, 9);
  assert.deepEqual([...new Set(transferred)], [0], "nothing came over the network");

  const [{ id, sha256 }] = await images();
  const cacheControl = async (query) => (await fetch(`${base}/images/${id}/thumbnail${query}`)).headers.get("Cache-Control");
  assert.match(await cacheControl(`?sha256=${sha256}`), /immutable/);
  assert.doesNotMatch(await cacheControl(`?sha256=${"0".repeat(64)}`), /immutable/);
  assert.doesNotMatch(await cacheControl(""), /immutable/);
  await house.closePage(page);
});
