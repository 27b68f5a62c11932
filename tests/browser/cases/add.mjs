// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adding images: many at once, names from folders and typed, labels, failures one by one.
import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blank, blobs } from "../images.mjs";

const server = await house.server("add");

const file = (name, buffer) => ({ name, mimeType: "image/png", buffer });
const images = async (query = "") =>
  (await (await fetch(`${server.address}/v1/collections/default/images?limit=100${query}`)).json()).images;

test("many at once, with names; what fails says why", async () => {
  const page = await house.openPage(`${server.address}/#/add`);
  await page.locator("#add-files").setInputFiles([
    file("scarf 1.png", blobs(1)), file("scarf 2.png", blobs(2)), file("mug.png", blobs(3)),
    file("notes.txt", Buffer.from("words")), file("blank.png", blank())]);
  await page.locator("#add-object").fill("red scarf");
  await page.getByLabel("Object in mug.png").fill("mug");
  await page.locator("#add-labels").fill("shelf=4, colour=red");
  await house.checkAccessibility(page, "add, before");
  await page.getByRole("button", { name: "Add 5 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 3 images added, 2 failed/);
  const row = (name) => page.locator("#add-list li", { hasText: name });
  await house.eventually(async () => assert.match(await row("scarf 1.png").innerText(), /added: \d+ keypoints/));
  await house.eventually(async () => assert.match(await row("notes.txt").innerText(), /cannot read this file as an image/));
  await house.eventually(async () => assert.match(await row("blank.png").innerText(), /too little detail/));
  await house.eventually(async () => assert.match(await house.text(page, "#add-summary"), /3 of 5 images added, 2 failed/));
  const [value, max] = await page.locator("#add-bar").evaluate((bar) => [bar.value, bar.max]);
  assert.deepEqual([value, max], [5, 5]);
  await house.shoot(page, "added");
  await house.checkAccessibility(page, "add, after");

  const scarves = await images("&object=red%20scarf");
  assert.deepEqual(scarves.map(({ source }) => source).sort(), ["scarf 1.png", "scarf 2.png"]);
  assert.deepEqual(scarves[0].metadata, { shelf: 4, colour: "red" });
  assert.equal((await images("&object=mug")).length, 1);

  assert.equal(await page.getByRole("button", { name: "Retry failed images" }).isVisible(), false, "these files never become images");
  await page.locator("#add-files").setInputFiles([file("scarf 1.png", blobs(1))]);
  await page.getByRole("button", { name: "Add 1 image" }).click();
  await house.waitForText(page, "#add-list li:last-child", /already stored/);
  await house.waitForText(page, "#add-status", /Finished: 3 images added, 1 already stored, 2 failed\. See each image/);
  await house.waitForText(page, "#add-summary", /^3 of 6 images added, 1 already stored, 2 failed$/);
  await page.getByRole("button", { name: "Clear the list" }).click();
  await house.eventually(async () => assert.equal(await page.locator("#add-form").isVisible(), false));
  await house.closePage(page);
});

test("a folder's name is the object's name", async () => {
  const folder = mkdtempSync(join(tmpdir(), "pliant-folder-"));
  for (const [i, name] of ["lamp/a.png", "lamp/b.png", "chair/c.png", "chair/side/d.png", "lamp/@eaDir/a.png/M.png", "#recycle/e.png",
                           ".trash/f.png"].entries()) {
    mkdirSync(join(folder, name, ".."), { recursive: true });
    writeFileSync(join(folder, name), blobs(10 + i));
  }
  const page = await house.openPage(`${server.address}/#/add`);
  await page.locator("#add-folder").setInputFiles(folder);
  await house.waitForText(page, "#add-status", /^2 files of system folders left out\.$/);
  await page.getByRole("button", { name: "Add 4 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 4 images added\./);
  assert.equal((await images("&object=lamp")).length, 2);
  assert.equal((await images("&object=chair")).length, 1);
  assert.equal((await images("&object=chair%2Fside")).length, 1);
  await house.closePage(page);
  rmSync(folder, { recursive: true });
});

test("images are called what their files are called, unless somebody says otherwise", async () => {
  const own = await house.startServer();
  const page = await house.openPage(`${own.address}/#/add`);
  const name = (of) => page.getByLabel(`Object in ${of}`);
  const stored = async () => Object.fromEntries(
    (await (await fetch(`${own.address}/v1/collections/default/images?limit=100`)).json()).images
      .map(({ object, source }) => [source, object]));
  await page.locator("#add-files").setInputFiles(
    ["green tin.png", "v1.2 box.jpeg", "image.png", "IMG.PNG"].map((one, i) => file(one, blobs(40 + i))));
  await house.eventually(async () => assert.equal(await name("green tin.png").inputValue(), "green tin"));
  await house.eventually(async () => assert.equal(await name("v1.2 box.jpeg").inputValue(), "v1.2 box"));
  const made = [await name("image.png").inputValue(), await name("IMG.PNG").inputValue()];
  assert.match(made[0], /^Photo \d{4}-\d\d-\d\d \d\d\.\d\d\.\d\d$/);
  assert.notEqual(made[0], made[1], "two of a name that says nothing are not one object");
  await page.waitForFunction(() => [...document.querySelectorAll(".upload-thumb")]
    .every((image) => image.naturalHeight > 1));
  await house.shoot(page, "names");

  await page.locator("#add-object").fill("all of it");
  await house.eventually(async () => assert.equal(await name("green tin.png").inputValue(), "all of it"));
  await name("v1.2 box.jpeg").fill("a box");
  await page.locator("#add-object").fill("");
  await house.eventually(async () => assert.equal(await name("green tin.png").inputValue(), "green tin", "the file's name comes back"));
  await house.eventually(async () => assert.equal(await name("v1.2 box.jpeg").inputValue(), "a box", "what was typed stays"));
  await page.getByRole("button", { name: "Add 4 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 4 images added\./);
  assert.deepEqual(await stored(), { "green tin.png": "green tin", "v1.2 box.jpeg": "a box",
                                     "image.png": made[0], "IMG.PNG": made[1] });

  // The same image by another file's name: nobody has said that it is something else.
  await page.locator("#add-files").setInputFiles([file("copy.png", blobs(40))]);
  await page.getByRole("button", { name: "Add 1 image" }).click();
  await house.waitForText(page, "#add-list li:last-child", /already stored under another name/);
  await house.waitForText(page, "#add-status", /Finished: 4 images added, 1 already stored\.$/);
  await house.closePage(page);
  await own.stop();
});

test("images that others added without a name are shown by their files'", async () => {
  const own = await house.startServer();
  for (const [i, source] of ["teapot.png", "kettle.png"].entries()) {
    const form = new FormData();
    form.append("image", new Blob([blobs(50 + i)], { type: "image/png" }), source);
    const answer = await fetch(`${own.address}/v1/collections/default/images`, { method: "POST", body: form });
    assert.equal(answer.status, 201);
  }
  const page = await house.openPage(`${own.address}/#/objects`);
  await house.waitForText(page, "#objects-list", /Without a name/);
  await page.locator("#objects-list a").first().click();
  await house.waitForText(page, "#images-title", /Images without a name/);
  await house.waitForText(page, "#images-list", /teapot/);
  await page.goto(`${own.address}/#/search`);
  await page.locator("#search-file").setInputFiles([file("query.png", blobs(51))]);
  assert.match((await house.hitNames(page))[0], /kettle/);
  await house.eventually(async () => assert.match(await house.text(page, "#search-status"), /kettle/));
  await house.closePage(page);
  await own.stop();
});

test("uploads can be stopped and gone on with", async () => {
  const page = await house.openPage(`${server.address}/#/add`);
  const waiting = [];
  await page.route("**/images", (route) => waiting.push(route));
  await page.locator("#add-files").setInputFiles(
    [20, 21, 22, 23].map((seed) => file(`p${seed}.png`, blobs(seed))));
  await page.locator("#add-object").fill("late");
  await page.getByRole("button", { name: "Add 4 images" }).click();
  await page.getByRole("button", { name: "Stop" }).click();
  await house.waitForText(page, "#add-status", /Stopped: 0 images added/);
  assert.ok(waiting.length <= 2, "no more than two at once");
  await page.unroute("**/images");
  await page.getByRole("button", { name: "Add 4 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 4 images added\./);
  assert.equal((await images("&object=late")).length, 4);
  await house.closePage(page);
});

test("a server that goes away is waited for; images are not sent again before it is back", async () => {
  const page = await house.openPage(`${server.address}/#/add`);
  let away = false, uploads = 0;
  await page.route(/\/v1\/(me|collections\/default\/images)$/, (route) => {
    if (route.request().method() === "POST" && ++uploads === 3) away = true;
    return away ? route.abort("connectionrefused") : route.continue();
  });
  await page.locator("#add-files").setInputFiles([60, 61, 62, 63, 64].map((seed) => file(`q${seed}.png`, blobs(seed))));
  await page.getByRole("button", { name: "Add 5 images" }).click();
  await house.waitForText(page, "#add-status.error", /The server cannot be reached\.[^]*Adding continues by itself when the server answers\.$/);
  await house.waitForText(page, "#add-list li:nth-child(3) .note", /^waiting for the server$/);
  await house.checkAccessibility(page, "the server is away");
  await house.shoot(page, "server-away");
  await house.waitForText(page, "#add-summary", /^2 of 5 images added, less than a minute left$/);
  await house.waitForText(page, "#add-list li:nth-child(4) .note", /^waiting for the server$/);
  for (let i = 0; i < 2; ++i) await page.waitForRequest(/v1\/me$/);
  assert.equal(uploads, 4, "each of the two that were being sent, once");
  away = false;
  await house.waitForText(page, "#add-status", /^Finished: 5 images added\.$/);
  assert.equal(uploads, 7);

  away = true;  // Stop does not wait for the server
  await page.locator("#add-files").setInputFiles([file("q65.png", blobs(65))]);
  await page.getByRole("button", { name: "Add 1 image" }).click();
  await house.waitForText(page, "#add-status.error", /Adding continues/);
  await page.getByRole("button", { name: "Stop" }).click();
  await house.waitForText(page, "#add-status", /^Stopped: 5 images added\.$/);
  await house.closePage(page);
});

test("what may succeed later can be tried again; a key that may not add stops all", async () => {
  const page = await house.openPage(`${server.address}/#/add`);
  let status = 500, code = "internal";
  await page.route("**/images", (route) => (status ? route.fulfill({
    status, contentType: "application/problem+json", body: JSON.stringify({ code, detail: "no" }) }) : route.continue()));
  await page.locator("#add-files").setInputFiles([file("r70.png", blobs(70)), file("r71.png", blobs(71))]);
  await page.getByRole("button", { name: "Add 2 images" }).click();
  await house.waitForText(page, "#add-status.error", /^Finished: 0 images added, 2 failed/);
  [status, code] = [403, "forbidden"];
  await page.getByRole("button", { name: "Retry failed images" }).click();
  await house.waitForText(page, "#add-status.error", /^Stopped: 0 images added\. Your key does not allow this/);
  status = 0;
  await page.getByRole("button", { name: "Add 2 images" }).click();
  await house.waitForText(page, "#add-status", /^Finished: 2 images added\.$/);
  await house.closePage(page);
});

test("an image that was added is deleted from the collection where it is listed, with time to undo", async () => {
  const page = await house.openPage(`${server.address}/#/add`);
  await page.locator("#add-files").setInputFiles([file("s80.png", blobs(80)), file("s81.png", blobs(81))]);
  await page.getByRole("button", { name: "Remove s81.png from the list" }).click();
  await page.getByRole("button", { name: "Add 1 image" }).click();
  await house.waitForText(page, "#add-status", /^Finished: 1 image added\.$/);
  const remove = page.getByRole("button", { name: "Delete s80.png from the collection" });
  await remove.click();
  await house.waitForText(page, "#notices", /Deleted: s80\.png/);
  await page.getByRole("button", { name: "Undo" }).click();
  await house.waitForText(page, "#add-summary", /^1 of 1 image added$/);
  assert.equal((await images("&object=s80")).length, 1);
  await remove.click();
  await page.mouse.move(5, 5);
  await page.locator("#notices .notice").waitFor({ state: "detached" });
  assert.equal((await images("&object=s80")).length, 0);
  await house.closePage(page);
});
