// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Searching inside a rectangle: with a mouse, with a finger, by numbers.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");
let image;

async function prepare() {
  const objects = await house.loadDemonstration(server.address);
  image = { name: "q.jpg", mimeType: "image/jpeg",
              buffer: await house.bytesOf(server.address, objects[0].crumpled) };
}

// The page with an answer. askedRegions(page) tells what its searches were limited to.
async function answered(options) {
  const page = await house.openPage(server.address, options);
  await page.evaluate(() => {
    globalThis.regions = [];
    const send = globalThis.fetch;
    globalThis.fetch = (path, how) => {
      if (how?.body instanceof FormData) globalThis.regions.push(how.body.get("region"));
      return send(path, how);
    };
  });
  await page.locator("#search-file").setInputFiles(image);
  await house.hitNames(page);
  return page;
}

const askedRegions = async (page) =>
  (await page.evaluate(() => globalThis.regions)).map((text) => text && text.split(",").map(Number));
const lastRegion = async (page) => (await askedRegions(page)).at(-1);

function assertNear(actual, wanted) {
  const near = actual?.every((value, i) => Math.abs(value - wanted[i]) <= 4);
  assert.ok(near, `${actual} is not about ${wanted}`);
}

test("a rectangle drawn with the mouse is searched in, moved, sized and removed", async () => {
  await prepare();
  const page = await answered();
  const frame = await page.locator("#stage-canvas").boundingBox();
  const at = (x, y) => [frame.x + x * frame.width, frame.y + y * frame.height];
  const drag = async (from, to) => {
    await page.mouse.move(...at(...from));
    await page.mouse.down();
    await page.mouse.move(...at((from[0] + to[0]) / 2, (from[1] + to[1]) / 2));
    await page.mouse.move(...at(...to));
    await page.mouse.up();
  };
  await drag([0.25, 0.25], [0.75, 0.75]);
  await house.waitForText(page, "#search-status", /in this part: town map/);
  assertNear(await lastRegion(page), [200, 150, 400, 300]);
  await house.shoot(page, "region");
  await drag([0.5, 0.5], [0.6, 0.5]);
  await page.waitForFunction(() => document.querySelector("#region-x").value > 270);
  await house.hitNames(page);
  assertNear(await lastRegion(page), [280, 150, 400, 300]);
  await page.locator("#region-width").fill("320");
  await page.locator("#region-width").press("Tab");
  await page.getByRole("button", { name: "Search this part" }).click();
  await house.waitForText(page, "#search-status", /in this part/);
  assertNear(await lastRegion(page), [280, 150, 320, 300]);
  await house.checkAccessibility(page, "region");
  await page.getByRole("button", { name: "Whole photo" }).click();
  await house.waitForText(page, "#search-status", /^Found: /);
  assert.equal(await lastRegion(page), null);
  await house.closePage(page);
});

test("a finger scrolls, and draws when asked to", async () => {
  await prepare();
  const page = await answered({ width: 390, height: 844, hasTouch: true, isMobile: true });
  const swipe = (x0, y0, x1, y1) => page.locator("#stage").evaluate((stage, [fx, fy, tx, ty]) => {
    const frame = stage.getBoundingClientRect();
    const send = (type, x, y) => stage.dispatchEvent(new PointerEvent(type, {
      pointerId: 1, pointerType: "touch", isPrimary: true, bubbles: true, cancelable: true, button: 0,
      clientX: frame.left + x * frame.width, clientY: frame.top + y * frame.height }));
    stage.setPointerCapture = () => {};  // there is no real finger
    send("pointerdown", fx, fy);
    send("pointermove", tx, ty);
    send("pointerup", tx, ty);
  }, [x0, y0, x1, y1]);
  const searches = (await askedRegions(page)).length;
  await swipe(0.2, 0.2, 0.8, 0.8);
  await house.eventually(async () => assert.equal(await page.locator("#region").isVisible(), false));
  await page.locator("#region-start").tap();
  await swipe(0.2, 0.2, 0.8, 0.8);
  await house.waitForText(page, "#search-status", /in this part/);
  assert.equal((await askedRegions(page)).length, searches + 1);
  assertNear(await lastRegion(page), [160, 120, 480, 360]);
  await house.closePage(page);
});
