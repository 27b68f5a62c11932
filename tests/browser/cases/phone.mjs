// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// In the hand: the camera first, the answer on the first screen, and one slider to compare.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");
const kPhone = { width: 390, height: 844, hasTouch: true, isMobile: true };

test("the camera comes first; the answer is on the first screen", async () => {
  const objects = await house.loadDemonstration(server.address);
  const page = await house.openPage(server.address, kPhone);
  const camera = page.getByText("Take a photo").first();
  const shown = await camera.boundingBox();
  assert.ok(shown.y >= 0 && shown.y + shown.height <= kPhone.height, "the camera is on the first screen");
  const choose = page.getByText("Choose a photo");
  assert.ok((await camera.boundingBox()).y <= (await choose.boundingBox()).y, "above or beside");
  const colour = (label) => label.evaluate((one) => getComputedStyle(one).backgroundColor);
  assert.notEqual(await colour(camera), await colour(choose), "the camera is the one that stands out");
  await house.eventually(async () => assert.equal(await page.locator("#search-camera").getAttribute("capture"), "environment"));
  await house.eventually(async () => assert.equal(await page.locator(".drop-text").first().isVisible(), false, "nothing can be dropped here"));

  const poster = objects.find(({ object }) => object === "poster");
  await page.evaluate(() => scrollTo(0, 300));
  await page.locator("#search-camera").setInputFiles({
    name: "image.jpg", mimeType: "image/jpeg", buffer: await house.bytesOf(server.address, poster.crumpled) });
  await house.waitForText(page, "#search-status", /^Found: poster/);
  const onScreen = async (selector) => {
    const box = await page.locator(selector).first().boundingBox();
    assert.ok(box.y >= 0 && box.y + box.height <= kPhone.height, `${selector}: ${box.y} to ${box.y + box.height}`);
  };
  for (const part of ["#search-status .verdict", "#stage", "#results .hit"]) await onScreen(part);

  // One slider takes the place of three images.
  await page.locator("#blend").waitFor();
  await house.eventually(async () => assert.equal(await page.locator("#trio figure:visible").count(), 1));
  await page.locator("#compare").scrollIntoViewIfNeeded();
  await house.shoot(page, "phone-found");
  await house.closePage(page);
});
