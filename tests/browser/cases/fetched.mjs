// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that this browser does not have, or cannot read, and that are shown all the same: fetched by the server
// from their addresses, and TIFFs.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, test } from "node:test";
import { canvasShares, correlation } from "../canvas.mjs";
import * as house from "../house.mjs";
import { photograph, thing, thingTiff } from "../images.mjs";

// A photograph larger than a preview, in which two things lie at known places.
const kSize = [1600, 1200];
const kParts = [{ seed: 701, x: 480, y: 400, scale: 2, angle: 10 }, { seed: 702, x: 1150, y: 800, scale: 2, angle: -15 }];
const table = photograph(kParts, ...kSize);

let requests = 0;
const elsewhere = createServer((request, answer) => {
  ++requests;
  const found = request.url === "/table.png";
  answer.writeHead(found ? 200 : 404, { "Content-Type": "text/html" }).end(found ? table : "");  // nobody believes it
});
await new Promise((ready) => elsewhere.listen(0, "127.0.0.1", ready));
after(() => elsewhere.close());
const host = `127.0.0.1:${elsewhere.address().port}`;
const address = `http://${host}/table.png`;

const server = await house.server("fetching", "--fetch-hosts", host, "--fetch-private", "true");
let ready = null;
const prepare = () => (ready ??= (async () => {
  for (const [id, seed] of [["map", 701], ["poster", 702], ["card", 703]]) {
    const answer = await fetch(`${server.address}/v1/collections/default/images/${id}?object=${id}`, {
      method: "PUT", headers: { "Content-Type": "image/png" }, body: thing(seed) });
    assert.ok(answer.ok);
  }
})());

const drop = (page, url, place = "#search-drop") => page.evaluate(([one, where]) => {
  const transfer = new DataTransfer();
  transfer.setData("text/uri-list", one);
  document.querySelector(where).dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, [url, place]);

const sizeOf = (page) => page.locator("#stage-canvas").evaluate(({ width, height }) => [width, height]);

// Mean grey values of a coarse grid over what is drawn.
const gridOf = (page) => page.locator("#stage-canvas").evaluate((canvas) => {
  const small = new OffscreenCanvas(32, 24).getContext("2d");
  small.drawImage(canvas, 0, 0, 32, 24);
  const { data } = small.getImageData(0, 0, 32, 24);
  return Array.from({ length: data.length / 4 }, (_, i) => data[4 * i]);
});

const middleOf = (page, name) => page.locator("#stage-tags .tag", { hasText: name }).evaluate((tag) => {
  const [frame, stage] = [tag.getBoundingClientRect(), document.querySelector("#stage-canvas").getBoundingClientRect()];
  return [(frame.left + frame.width / 2 - stage.left) / stage.width, (frame.top + frame.height / 2 - stage.top) / stage.height];
});

for (const [size, options] of [["wide", {}], ["phone", { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" }]]) {
  test(`an image that is searched with by its address is shown with what was found in it, ${size}`, async () => {
    await prepare();
    const page = await house.openPage(server.address, options);
    await house.waitForText(page, "#search-status", /in this collection/);
    const before = requests;
    await drop(page, address);
    await house.waitForText(page, "#search-status", /^2 objects found: /);
    await house.waitForText(page, "#stage-note", /^Outlined: /);
    assert.equal(requests, before + 1, "one fetch gives the answer and the image");
    assert.deepEqual(await sizeOf(page), [1280, 960]);
    const fetched = await gridOf(page);
    assert.ok((await canvasShares(page, "#stage-canvas")).outline > 0.001);
    await house.eventually(async () => {  // the outlines' tops are where the things' are
      const [map, poster] = [await middleOf(page, "map"), await middleOf(page, "poster")];
      assert.ok(map[0] < 0.5 && map[1] < 0.4, `map at ${map}`);
      assert.ok(poster[0] > 0.45 && poster[1] > 0.35, `poster at ${poster}`);
    });
    await house.waitForText(page, "#compare-title", /^Compare: /);
    await house.eventually(async () => {
      const same = await correlation(page, "#reference-canvas", "#flat-canvas");
      assert.ok(same > 0.6, `un-crumpled from the preview: ${same}`);
    });
    await house.checkAccessibility(page, `a fetched image, ${size}`);
    await house.checkWidth(page, `a fetched image, ${size}`);
    await house.checkOverlaps(page, `a fetched image, ${size}`);
    await house.shoot(page, `fetched-shown-${size}`);
    await page.locator("#stage-tags .tag", { hasText: "poster" }).click();
    await house.waitForText(page, "#compare-title", /^Compare: poster/);

    await page.reload();
    await house.waitForText(page, "#search-status", /^2 objects found: /);
    await house.eventually(async () => assert.deepEqual(await sizeOf(page), [1280, 960]));

    // Sent as a file it looks the same.
    await page.locator("#search-file").setInputFiles([{ name: "table.png", mimeType: "image/png", buffer: table }]);
    await page.waitForFunction(() => location.hash.includes("photo="));
    await house.waitForText(page, "#search-status", /^2 objects found: /);
    await house.waitForText(page, "#stage-note", /^Outlined: /);
    const uploaded = await gridOf(page);
    const difference = uploaded.reduce((sum, value, i) => sum + Math.abs(value - fetched[i]), 0) / uploaded.length;
    assert.ok(difference < 4, `grey values differ by ${difference}`);
    await house.closePage(page);
  });
}

test("a part of a fetched image is searched in; one that cannot be fetched leaves nothing behind", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/search?${new URLSearchParams({ url: address })}`);
  await house.waitForText(page, "#search-status", /^2 objects found: /);
  await page.getByRole("button", { name: "Select a part" }).focus();
  await page.keyboard.press("Enter");
  await page.locator("#region-width").fill("700");
  await page.locator("#region-x").fill("850");
  await page.locator("#region-y").fill("500");
  await page.locator("#region-height").fill("650");
  await page.keyboard.press("Tab");
  const [sent] = await Promise.all([page.waitForRequest(/\/search$/), page.getByRole("button", { name: "Search this part" }).click()]);
  assert.equal(JSON.parse(sent.postData()).preview, undefined, "the image is here already");
  await house.waitForText(page, "#search-status", /^Found in this part: poster/);
  assert.deepEqual(await sizeOf(page), [1280, 960]);
  await drop(page, `http://${host}/none.png`);
  await house.waitForText(page, "#search-status.error", /^The host of this address answered with status 404\.$/);
  assert.equal(await page.locator("#query-figure").isVisible(), false);
  assert.equal(await page.getByRole("button", { name: "Select a part" }).isVisible(), false);
  assert.equal(await page.locator("#compare").isVisible(), false);
  await house.shoot(page, "fetched-none");
  await house.closePage(page);
});

for (const [size, options] of [["wide", {}], ["phone", { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" }]]) {
  test(`an image that is to be added by its address is shown before it is stored, ${size}`, async () => {
    await prepare();
    const page = await house.openPage(`${server.address}/#/add`, options);
    const before = requests;
    await drop(page, address, "#add-drop");
    const seen = (row) => page.locator(`#add-list li:nth-child(${row})`).scrollIntoViewIfNeeded();  // only these are fetched
    await seen(1);
    const previewSize = (row) => page.locator(`#add-list li:nth-child(${row}) .upload-thumb`)
      .evaluate(({ complete, naturalWidth, naturalHeight }) => complete && [naturalWidth, naturalHeight]);
    await house.eventually(async () => assert.deepEqual(await previewSize(1), [320, 240]));
    assert.equal(requests, before + 1);
    assert.equal(await page.locator("#add-list .note").first().innerText(), "from the web");
    // What cannot be fetched says so at once; the file beside it does not wait for either.
    await drop(page, `http://${host}/none.png`, "#add-drop");
    await page.locator("#add-files").setInputFiles([{ name: "mug.png", mimeType: "image/png", buffer: thing(704) }]);
    await seen(2);
    await house.waitForText(page, "#add-list li:nth-child(2) .note", /^from the web; no preview: The host of this address answered with status 404\.$/);
    await seen(3);
    await house.eventually(async () => assert.deepEqual(await previewSize(3), [320, 240]));
    assert.equal(await page.locator("#add-list li:nth-child(2) input").inputValue(), "none");
    await house.checkAccessibility(page, `rows from the web, ${size}`);
    await house.checkWidth(page, `rows from the web, ${size}`);
    await house.checkOverlaps(page, `rows from the web, ${size}`);
    await house.shoot(page, `add-fetched-${size}`);
    await drop(page, "http://elsewhere.example/x.png", "#add-drop");
    await seen(4);
    await house.waitForText(page, "#add-list li:nth-child(4) .note", /no preview: .*does not fetch from this host/);
    await house.closePage(page);
  });
}

test("a TIFF, which the browser cannot read, is shown as the server reads it", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await page.locator("#search-file").setInputFiles([{ name: "scan.tif", mimeType: "image/tiff", buffer: thingTiff(703) }]);
  await house.waitForText(page, "#search-status", /^Found: card/);
  await house.waitForText(page, "#stage-note", /^Outlined: card/);
  assert.deepEqual(await sizeOf(page), [320, 240]);
  assert.ok((await canvasShares(page, "#stage-canvas")).outline > 0.001);
  await house.waitForText(page, "#compare-title", /^Compare: card/);
  await house.eventually(async () => assert.ok(await correlation(page, "#reference-canvas", "#flat-canvas") > 0.6));
  await house.shoot(page, "tiff");
  await house.closePage(page);
});
