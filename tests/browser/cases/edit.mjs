// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names and labels, changed in place.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../pictures.mjs";

const server = await house.server("edit", "--auto-train", "false");
const base = `${server.address}/v1/collections/default`;

const read = async (path) => (await fetch(base + path)).json();
const status = async (path) => (await fetch(base + path)).status;

async function put(id, object, metadata, seed) {
  const query = new URLSearchParams({ object, metadata: JSON.stringify(metadata) });
  const answer = await fetch(`${base}/images/${id}?${query}`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(seed) });
  assert.ok(answer.ok, await answer.text());
}

async function prepare() {
  for (const { object } of (await read("/objects?limit=100")).objects) {
    await fetch(`${base}/objects/${encodeURIComponent(object)}`, { method: "DELETE" });
  }
  await put("a", "mug", { shelf: 4, code: "007", colour: "red", deep: { x: 1 } }, 200);
  await put("b", "mug", {}, 201);
  await put("c", "cup", {}, 202);
}

const card = (page, view, name) => page.locator(`#${view}-list .card`, { hasText: name });

test("an object is renamed in place, with all its pictures", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Rename mug" }).click();
  await house.checkAccessibility(page, "renaming");
  await house.shoot(page, "renaming");
  await page.getByLabel("Name", { exact: true }).fill("tea mug");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#objects-list", /tea mug/);
  assert.match(await card(page, "objects", "tea mug").innerText(), /2 pictures/);
  assert.equal(await status("/objects/mug"), 404);
  await page.waitForFunction(() => document.activeElement.textContent.includes("tea mug"));

  // Escape closes the form, and nothing has changed.
  await page.getByRole("button", { name: "Rename cup" }).click();
  await page.keyboard.press("Escape");
  assert.equal(await page.locator("form.edit").count(), 0);
  assert.match(await page.evaluate(() => document.activeElement.ariaLabel), /Rename cup/);

  // A name that is taken: nothing happens unless somebody says so.
  await page.getByRole("button", { name: "Rename cup" }).click();
  await page.getByLabel("Name", { exact: true }).fill("tea mug");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /called tea mug already/);
  assert.equal((await read("/objects/cup")).images, 1);
  await house.checkAccessibility(page, "a taken name");
  await page.getByRole("button", { name: "Make one object of both" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#objects-list .card").length === 1);
  assert.equal((await read("/objects/tea%20mug")).images, 3);
  await house.closePage(page);
});

test("a picture moves to another object and gets other labels; what was not touched stays as it was", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/pictures`);
  await page.getByRole("button", { name: "Edit the picture a of mug" }).click();
  const labels = page.getByLabel("Labels, one a line");
  assert.equal(await labels.inputValue(), "code=007\ncolour=red\nshelf=4");
  await page.getByLabel("Shows").fill("cup");
  await labels.fill("code=007\nshelf=5\nnew=true, and more");
  await house.checkAccessibility(page, "editing");
  await house.shoot(page, "editing");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#pictures-list .card:first-child .name", /cup/);
  assert.match(await page.locator("#pictures-list .card").first().innerText(), /shelf: 5/);
  assert.match(await page.evaluate(() => document.activeElement.ariaLabel), /Edit the picture a of cup/);
  const now = await read("/images/a");
  assert.equal(now.object, "cup");
  assert.deepEqual(now.metadata, { shelf: 5, code: "007", deep: { x: 1 }, new: "true, and more" });
  assert.equal((await read("/objects/cup")).images, 2);

  await page.getByRole("button", { name: "Edit the picture b of mug" }).click();
  await labels.fill("no label");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /name=value/);
  await house.closePage(page);
});

test("what somebody else has changed meanwhile is not overwritten", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/pictures`);
  await page.getByRole("button", { name: "Edit the picture a of mug" }).click();
  await page.getByLabel("Shows").fill("mine");
  await put("a", "theirs", {}, 200);
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /Somebody else has changed it/);
  assert.equal((await read("/images/a")).object, "theirs");
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: "Edit the picture a of mug" }).click();
  assert.equal(await page.getByLabel("Shows").inputValue(), "theirs");
  await house.closePage(page);
});

test("a picture that is there already by another name can be renamed where it is added", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/add`);
  const add = async () => {
    await page.locator("#add-files").setInputFiles([{ name: "again.png", mimeType: "image/png", buffer: blobs(200) }]);
    await page.getByLabel("Object that again.png shows").last().fill("beaker");
    await page.getByRole("button", { name: "Add 1 picture" }).click();
    await house.waitForText(page, "#add-list li:last-child .error", /there already, as mug/);
  };
  await add();
  await house.checkAccessibility(page, "an offer to rename");
  await house.shoot(page, "rename-offer");
  await page.getByRole("button", { name: "Call it beaker" }).click();
  await house.waitForText(page, "#add-list li:last-child", /is called beaker now/);
  assert.equal((await read("/images/a")).object, "beaker");
  assert.match(await house.text(page, "#add-summary"), /1 of 1 picture added/);
  await house.closePage(page);
});

test("labels are read and written as people type them", async () => {
  const page = await house.openPage(server.address);
  const patch = (metadata, lines) => page.evaluate(async ([before, text]) => {
    const { labelsPatch } = await import("/assets/labels.js");
    try {
      return labelsPatch(before, text);
    } catch (error) {
      return error.message;
    }
  }, [metadata, lines]);
  const before = { n: 7, s: "7", t: true, list: [1], "a=b": 1, two: "x\ny" };
  assert.equal(await patch(before, "n=7\ns=7\nt=true"), null);
  assert.deepEqual(await patch(before, "n=8\n  t = false \nz="), { n: 8, s: null, t: false, z: "" });
  assert.match(await patch(before, "=x"), /no label/);
  await house.closePage(page);
});
