// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The first visit: an empty collection, the demonstration, the first answer; what the page weighs.
import assert from "node:assert/strict";
import { test } from "node:test";
import { canvasShares, correlation } from "../canvas.mjs";
import * as house from "../house.mjs";

const kLargestPage = 200_000;  // bytes

const server = await house.server("first visit");  // nobody else loads anything here

test("an empty collection teaches what to do; the demonstration is found un-crumpled", async () => {
  const page = await house.openPage(server.address);
  await page.locator("#welcome").waitFor();
  await house.eventually(async () => assert.match(await house.text(page, "#welcome"), /This collection is empty/));
  await house.eventually(async () => assert.equal(await page.locator("#examples").isVisible(), false));
  await house.checkAccessibility(page, "first visit");
  await house.shoot(page, "first-visit");

  await page.getByRole("button", { name: "Load demonstration objects" }).click();
  const example = page.getByRole("button", { name: "crumpled photo of town map" });
  await example.waitFor();
  await house.eventually(async () => assert.equal(await page.locator("#welcome").isVisible(), false));
  await house.shoot(page, "demonstration-loaded");

  await example.click();
  assert.match((await house.hitNames(page))[0], /^1\. town map$/);
  await house.eventually(async () => assert.match(await house.text(page, "#results .hit:first-child"), /Found[^]*\d matched keypoints/));
  await page.waitForFunction(() => !document.querySelector("#blend-figure").hidden);
  await house.eventually(async () => assert.ok((await canvasShares(page, "#stage-canvas")).outline > 0.001, "outline on the query"));
  await house.eventually(async () => assert.ok((await canvasShares(page, "#reference-canvas")).outline > 0.001, "outline on the hit"));
  await house.eventually(async () => assert.ok((await canvasShares(page, "#flat-canvas")).opaque > 0.3, "something is un-crumpled"));
  await house.shoot(page, "found");
  await house.eventually(async () => {
    const alike = await correlation(page, "#flat-canvas", "#reference-canvas");
    const chance = await correlation(page, "#flat-canvas", "#reference-canvas", 5);
    assert.ok(alike > 0.08 && alike > 2 * Math.abs(chance),
              `the un-crumpled image is the object: correlation ${alike}, shifted ${chance}`);
  });
  await house.checkAccessibility(page, "found");

  await page.locator("#blend").fill("100");
  await house.eventually(async () => assert.ok((await correlation(page, "#blend-canvas", "#flat-canvas")) > 0.999, "all yours"));
  await page.locator("#blend").fill("0");
  await house.eventually(async () => assert.ok((await correlation(page, "#blend-canvas", "#flat-canvas")) < 0.99, "all theirs"));
  await house.closePage(page);
});

for (const [size, options] of [["wide", {}], ["phone", { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" }]]) {
  test(`where nothing is there yet, the lists lead to what is to be done, ${size}`, async () => {
    const empty = await house.server("empty");
    const page = await house.openPage(`${empty.address}/#/objects`, options);
    for (const view of ["objects", "images"]) {
      await page.goto(`${empty.address}/#/${view}`);
      await house.waitForText(page, `#${view}-status`, new RegExp(`^There are no ${view} yet`));
      await house.eventually(async () => assert.equal(await page.locator(`#${view}-bar`).isVisible(), false));
      await house.checkAccessibility(page, `${view}, empty`);
      await house.checkOverlaps(page, `${view}, empty`);
      await house.shoot(page, `${view}-empty-${size}`);
    }
    await page.getByRole("link", { name: "Add images" }).click();
    await page.locator("#add-drop").waitFor();
    await page.goto(`${empty.address}/#/object?name=nobody`);
    await house.waitForText(page, "#object-status.error", /There is no object named nobody/);
    await house.eventually(async () => assert.equal(await page.locator("#object-bar").isVisible(), false));
    await page.goto(`${empty.address}/#/images?q=nobody`);
    await house.waitForText(page, "#images-status", /No name or file contains "nobody"/);
    await page.getByRole("searchbox", { name: "Find images" }).waitFor();
    await house.closePage(page);
  });
}

test("every example finds its object", async () => {
  const page = await house.openPage(server.address);
  for (const name of ["tea packet", "newspaper", "flower cloth", "poster", "team flag"]) {
    await page.getByRole("button", { name: `crumpled photo of ${name}` }).click();
    await house.waitForText(page, "#results .hit:first-child .name", new RegExp(`^1\\. ${name}$`));
  }
  await house.closePage(page);
});

test("the page is small, and a second visit transfers nothing again", async () => {
  const page = await house.openPage("about:blank");
  const bodies = [];
  page.on("response", (response) => {
    if (!/\/(v1|assets\/demo)\//.test(response.url())) bodies.push(response.body());
  });
  page.faults.length = 0;
  await page.goto(server.address);
  await page.locator("#examples-list button").first().waitFor();  // every module has run
  const bytes = (await Promise.all(bodies)).reduce((sum, body) => sum + body.length, 0);
  assert.ok(bodies.length > 10 && bytes > 20_000, `${bodies.length} files, ${bytes} bytes`);
  assert.ok(bytes < kLargestPage, `${bytes} bytes`);
  for (const path of ["/", "/assets/app.js", "/assets/base.css"]) {
    const first = await fetch(server.address + path);
    const headers = { "If-None-Match": first.headers.get("ETag") };
    assert.equal((await fetch(server.address + path, { headers })).status, 304, path);
  }
  await page.context().close();
});
