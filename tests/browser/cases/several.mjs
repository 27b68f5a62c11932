// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several objects in one photograph: each outlined in its own colour, named, and selected by a tap.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");
const kObjects = ["demo-town-map", "demo-newspaper", "demo-poster"];

// The stored images side by side, as a JPEG.
async function photograph(page) {
  const base64 = await page.evaluate(async (ids) => {
    const canvas = new OffscreenCanvas(500 * ids.length, 420);
    const context = canvas.getContext("2d");
    context.fillStyle = "#777";
    context.fillRect(0, 0, canvas.width, canvas.height);
    for (const [i, id] of ids.entries()) {
      const answer = await fetch(`/v1/collections/default/images/${id}/content`);
      const image = await createImageBitmap(await answer.blob());
      const scale = Math.min(460 / image.width, 380 / image.height);
      context.drawImage(image, 500 * i + 20, 20, image.width * scale, image.height * scale);
    }
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: "image/jpeg", quality: 0.9 })).arrayBuffer());
    return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  }, kObjects);
  return { name: "table.jpg", mimeType: "image/jpeg", buffer: Buffer.from(base64, "base64") };
}

// Shares of the canvas in exactly these colours.
const sharesOf = (page, colours) => page.locator("#stage-canvas").evaluate((canvas, list) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const counts = list.map(() => 0);
  const wanted = list.map((colour) => Number.parseInt(colour.slice(1), 16));
  for (let i = 0; i < data.length; i += 4) {
    const at = wanted.indexOf((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
    if (at >= 0) ++counts[at];
  }
  return counts.map((n) => n / (data.length / 4));
}, colours);

for (const [size, options] of [["wide", {}], ["phone", { width: 390, height: 844, hasTouch: true, isMobile: true }]]) {
  test(`three objects in one photograph, ${size}`, async () => {
    await house.loadDemonstration(server.address);
    const page = await house.openPage(server.address, options);
    await page.locator("#search-file").setInputFiles(await photograph(page));
    await house.waitForText(page, "#search-status", /^3 objects found: /);
    const verdict = await house.text(page, "#search-status");
    for (const name of ["town map", "newspaper", "poster"]) assert.ok(verdict.includes(name), verdict);
    const tags = page.locator("#stage-tags .tag");
    await house.eventually(async () => assert.equal(await tags.count(), 3));
    const { kColours } = await page.evaluate(() => import("/assets/stage.js").then(({ kColours }) => ({ kColours })));
    const shares = await sharesOf(page, kColours.slice(0, 3));
    assert.ok(shares.every((share) => share > 0.0005), `three colours: ${shares}`);
    await house.eventually(async () => assert.match(await house.text(page, "#stage-note"), /^Outlined: .*; .*; /));
    await house.shoot(page, `several-${size}`);
    await house.checkAccessibility(page, `several, ${size}`);
    await house.checkWidth(page, `several, ${size}`);

    // The name selects its row, by mouse, finger or keyboard.
    await page.getByRole("button", { name: "poster", exact: true }).click();
    await house.waitForText(page, "#compare-title", /Compare: poster/);
    const chosen = () => page.locator('.hit-choose[aria-pressed="true"] .name').innerText();
    assert.match(await chosen(), /poster/);
    await page.getByRole("button", { name: "newspaper", exact: true }).focus();
    await page.keyboard.press("Enter");
    await house.waitForText(page, "#compare-title", /Compare: newspaper/);
    assert.equal(await page.evaluate(() => document.activeElement.className + document.activeElement.textContent),
                 "tagnewspaper", "the keyboard stays where it was");

    // So does the place itself: each lies in its third of the photograph.
    for (const [i, name] of ["town map", "newspaper", "poster"].entries()) {
      await page.locator("#stage").scrollIntoViewIfNeeded();  // the row that was chosen came into view
      const frame = await page.locator("#stage-canvas").boundingBox();
      const at = [frame.x + ((i + 0.5) / 3) * frame.width, frame.y + 0.55 * frame.height];
      await (options.hasTouch ? page.touchscreen.tap(...at) : page.mouse.click(...at));
      await house.waitForText(page, "#compare-title", new RegExp(`Compare: ${name}`));
      assert.match(await chosen(), new RegExp(name));
    }
    await house.eventually(async () => assert.equal(await page.locator("#region").isVisible(), false, "a tap draws no rectangle"));
    await house.closePage(page);
  });
}

test("a point is inside an outline or not", async () => {
  const page = await house.openPage(server.address);
  const inside = (...points) => page.evaluate(async (list) => {
    const { isInside } = await import("/assets/stage.js");
    return list.map((point) => isInside(point, [[0, 0], [10, 0], [10, 10], [5, 3], [0, 10]]));
  }, points);
  assert.deepEqual(await inside([1, 1], [5, 2], [5, 8], [9, 8], [-1, 5], [11, 5]),
                   [true, true, false, true, false, false]);
  await house.closePage(page);
});
