// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A page for every image and every object: looked at, downloaded, compared with its copies, deleted; and
// the way back.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs, partOfBlobs } from "../images.mjs";

const kPhone = { width: 390, height: 844, hasTouch: true, isMobile: true };
const server = await house.server("image");
const base = `${server.address}/v1/collections/default`;

async function put(id, object, body, metadata = {}) {
  const query = new URLSearchParams({ object, metadata: JSON.stringify(metadata) });
  const answer = await fetch(`${base}/images/${id}?${query}`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body });
  assert.ok(answer.ok, await answer.text());
}

// Two objects of two images, two copies of one of them (the same bytes; smaller), and a part of it.
let ready = null;
const prepare = () => (ready ??= (async () => {
  const kettle = blobs(301, 480, 360);
  await put("kettle-1", "kettle", kettle, { shelf: 4, colour: "red" });
  await put("kettle-2", "kettle", blobs(302, 480, 360));
  await put("lamp-1", "lamp", blobs(303, 480, 360));
  await put("lamp-2", "lamp", blobs(304, 480, 360));
  await put("copy-same", "kettle", kettle, { shelf: 5 });
  await put("copy-small", "other", blobs(301, 360, 270, 0.75));
  await put("part", "other", partOfBlobs(301, 480, 360, 160, 90));
  for (let i = 0; i < 40; ++i) await put(`many-${String(i).padStart(2, "0")}`, "many", blobs(400 + i));
})());

const status = async (path) => (await fetch(base + path)).status;

for (const [size, options] of Object.entries({ wide: {}, phone: kPhone })) {
  test(`an image's page, ${size}: large, known, downloaded, edited`, async () => {
    await prepare();
    const page = await house.openPage(`${server.address}/#/image?id=kettle-1`, options);
    await house.waitForText(page, "#image-title", /^kettle$/);
    assert.equal(await page.title(), "kettle – Pliant");
    await page.waitForFunction(() => document.querySelector("#image-frame img")?.naturalWidth === 480);
    await house.eventually(async () => assert.match(await house.text(page, "#image-facts"), /480 × 360[^]*Keypoints/));
    await house.eventually(async () => assert.match(await house.text(page, "#image-labels"), /colour: red\s*shelf: 4/));
    await house.checkAccessibility(page, `image ${size}`);
    await house.checkWidth(page, `image ${size}`);
    await house.checkOverlaps(page, `image ${size}`);
    await house.shoot(page, `image-page-${size}`);

    const waiting = page.waitForEvent("download");
    await page.getByRole("link", { name: "Download" }).click();
    const download = await waiting;
    assert.match(download.suggestedFilename(), /^kettle-1\.png$/);
    assert.deepEqual(readFileSync(await download.path()), blobs(301, 480, 360), "the bytes that were added");

    await page.locator("#view-image").getByRole("button", { name: "Edit the image kettle-1" }).click();
    await page.getByLabel("Labels, one per line").fill("shelf=7\ncolour=red");
    await house.checkOverlaps(page, `editing ${size}`);
    await page.getByRole("button", { name: "Save" }).click();
    await house.waitForText(page, "#image-labels", /shelf: 7/);
    await put("kettle-1", "kettle", blobs(301, 480, 360), { shelf: 4, colour: "red" });

    await page.getByRole("button", { name: "Full size" }).click();
    await house.eventually(async () => assert.equal(await page.getByRole("button", { name: "Full size" }).getAttribute("aria-pressed"), "true"));
    assert.ok(await page.locator("#image-frame img").evaluate((one) => one.clientWidth) === 480);
    await house.checkWidth(page, `full size ${size}`);
    await house.closePage(page);
  });
}

test("copies: the same file and the same photograph are told from parts and others", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/image?id=kettle-1`);
  await page.getByRole("button", { name: "Find copies" }).click();
  await house.waitForText(page, "#copies-status", /^2 copies found/);
  const list = await house.text(page, "#copies-list");
  assert.match(list, /kettle\s+The same file, stored again\s+copy-same/);
  assert.match(list, /other\s+Almost the same image[^]*copy-small, 360 × 270/);
  await house.shoot(page, "copies");
  await house.checkAccessibility(page, "copies");
  await page.locator("#copies-list a").first().click();
  await page.waitForFunction(() => location.hash.includes("copy-"));
  await page.goto(`${server.address}/#/image?id=lamp-1`);
  await house.waitForText(page, "#image-title", /^lamp$/);
  await house.eventually(async () => assert.equal(await page.locator("#copies-list li").count(), 0, "those of the image before are gone"));
  await page.getByRole("button", { name: "Find copies" }).click();
  await house.waitForText(page, "#copies-status", /No copies found/);
  await house.closePage(page);
});

test("the way back leads to where one was, however far down", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  await page.locator("#images-list .card").nth(20).waitFor();
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  await page.waitForFunction(() => document.querySelectorAll("#images-list .card").length > 40);
  const link = page.locator("#images-list .card > a").nth(38);
  await link.scrollIntoViewIfNeeded();
  const href = await link.getAttribute("href");
  await link.click();
  await page.locator("#image-body").waitFor();
  assert.equal(await page.evaluate(() => scrollY), 0);
  await page.locator("#image-back").click();
  await page.waitForFunction((one) => document.activeElement.getAttribute("href") === one, href);
  assert.ok(await page.evaluate(() => scrollY) > 1000);
  const box = await page.locator(`#images-list a[href="${href}"]`).boundingBox();
  assert.ok(box.y >= 0 && box.y < 900, `${box.y}: on the screen`);

  // Who came by an address goes to the object.
  await house.closePage(page);
  const direct = await house.openPage(`${server.address}/#/image?id=lamp-1`);
  await house.waitForText(direct, "#image-title", /^lamp$/);
  await direct.locator("#image-back").click();
  await house.waitForText(direct, "#object-title", /^lamp$/);
  await house.closePage(direct);
});

test("an object's page: its images, its name, its end", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.locator("#objects-list a", { hasText: "lamp" }).click();
  await house.waitForText(page, "#object-count", /^2 images$/);
  await page.locator("#object-list .card").nth(1).waitFor();
  await house.shoot(page, "object-page");
  await house.checkAccessibility(page, "object");
  await house.checkOverlaps(page, "object");
  await page.locator("#view-object").getByRole("button", { name: "Edit lamp", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("desk lamp");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#object-title", /^desk lamp$/);
  assert.equal(await status("/objects/lamp"), 404);
  await page.goBack();
  await house.waitForText(page, "#objects-list", /desk lamp/);
  await page.locator("#objects-list a", { hasText: "desk lamp" }).click();
  await page.locator("#view-object").getByRole("button", { name: "Edit desk lamp", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("lamp");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#object-title", /^lamp$/);
  await page.getByRole("link", { name: "Add images of lamp" }).click();
  await page.locator("#add-files").setInputFiles([{ name: "x.png", mimeType: "image/png", buffer: blobs(399) }]);
  await house.eventually(async () => assert.equal(await page.getByLabel("Object in x.png").inputValue(), "lamp"));
  await page.goto(`${server.address}/#/object?name=nothing`);
  await house.waitForText(page, "#object-status.error", /no object named nothing/);
  await page.goto(`${server.address}/#/object`);
  await house.waitForText(page, "#images-title", /^Images without a name$/);
  await house.closePage(page);
});

test("what is deleted on its page is gone from the list one comes back to, and undo brings it back", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/object?name=kettle`);
  await page.locator("#object-list .card").nth(2).waitFor();
  await page.locator("#object-list a", { hasText: "kettle-2" }).click();
  await page.locator("#view-image").getByRole("button", { name: "Delete the image kettle-2" }).click();
  await house.waitForText(page, "#object-title", /^kettle$/);
  await page.waitForFunction(() => document.querySelectorAll("#object-list .card").length === 2);
  await house.checkOverlaps(page, "deleted", { notices: true });
  await page.getByRole("button", { name: "Undo" }).click();
  await house.waitForText(page, "#image-facts", /kettle-2/);
  assert.equal(await status("/images/kettle-2"), 200);

  await page.locator("#view-image").getByRole("button", { name: "Delete the image kettle-2" }).click();
  await page.mouse.move(5, 5);
  await page.locator("#notices .notice").waitFor({ state: "detached" });
  assert.equal(await status("/images/kettle-2"), 404);
  await page.goto(`${server.address}/#/image?id=kettle-2`);
  await house.waitForText(page, "#image-status.error", /no longer exists/);
  await put("kettle-2", "kettle", blobs(302, 480, 360));
  await house.closePage(page);
});

test("find similar, and \"Find similar\" of a hit: the image that is searched with does not find itself", async () => {
  await prepare();
  const demonstration = await house.server("demonstration");
  await house.loadDemonstration(demonstration.address);
  const alone = await house.openPage(`${demonstration.address}/#/image?id=demo-poster`);
  await alone.getByRole("link", { name: "Find similar" }).click();
  await house.waitForText(alone, "#search-status", /^(No other similar object found|Perhaps)/);
  await house.eventually(async () => assert.equal(await alone.locator('.hit[data-id="demo-poster"]').count(), 0));
  await house.closePage(alone);

  const page = await house.openPage(`${server.address}/#/search?image=copy-small`);
  await house.waitForText(page, "#search-status", /^(Found|[0-9] objects found): kettle/);
  await page.getByRole("link", { name: "Find similar to kettle" }).click();
  await page.waitForFunction(() => !location.hash.includes("copy-small"));
  await house.waitForText(page, "#search-status", /ound: |objects found/);
  const used = await page.evaluate(() => new URLSearchParams(location.hash.split("?")[1]).get("image"));
  await house.eventually(async () => assert.equal(await page.locator(`.hit[data-id="${used}"]`).count(), 0, used));
  await house.closePage(page);
});

test("an image without an original is said to be so", async () => {
  const own = await house.startServer("--keep-originals", "false");
  await fetch(`${own.address}/v1/collections/default/images/bare`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(5) });
  const page = await house.openPage(`${own.address}/#/image?id=bare`);
  await house.waitForText(page, "#image-frame", /cannot be shown\. The server does not store its original/);
  await house.closePage(page);
  await own.stop();
});

test("a mesh tells copies from parts and bent things", async () => {
  const page = await house.openPage(server.address);
  const isCopy = (bend, given) => {
    const mesh = { columns: 11, rows: 6, reference_width: 200, reference_height: 100, points: [] };
    for (let r = 0; r < 6; ++r) for (let c = 0; c < 11; ++c) mesh.points.push(bend(19.9 * c, 19.8 * r));
    if (given) mesh.trusted = mesh.points.map((_, i) => i % 10 < given);
    return page.evaluate(async (bent) => {
      const { isNearCopy } = await import("/assets/image.js");
      return isNearCopy({ explain: { mesh: bent } }, { width: 400, height: 200 });
    }, mesh);
  };
  const larger = (x, y) => [2 * x + 0.5, 2 * y + 0.5];
  assert.equal(await isCopy(larger), true, "twice the size");
  assert.equal(await isCopy(larger, 3), false, "hardly anything is believed");
  assert.equal(await isCopy((x, y) => [x, y]), false, "a part");
  assert.equal(await isCopy((x, y) => [2 * x + 20, 2 * y]), false, "moved");
  assert.equal(await isCopy((x, y) => [2 * x + 12 * Math.sin(y / 20), 2 * y]), false, "bent");
  await house.closePage(page);
});
