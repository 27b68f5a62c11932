// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A collection tests itself: the report, its advice, and the objects that are too similar.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");
const kSelfTest = "**/v1/collections/default/selftest";

test("a test is followed, reported, and changes the limit on request", async () => {
  await house.loadDemonstration(server.address);
  const page = await house.openPage(`${server.address}/#/collection`);
  // Few photos, and a rate that so few can keep.
  await page.route(kSelfTest, (route) => (route.request().method() === "POST" ?
    route.continue({ postData: JSON.stringify({ pictures: 6, false_alarms: 0.2 }) }) : route.continue()));
  await page.getByRole("button", { name: "Test this collection" }).click();
  await house.waitForText(page, "#selftest-status", /The test is done/);
  await house.waitForText(page, "#selftest-report", /Of 6 simulated photos, \d find their object/);
  await house.waitForText(page, "#jobs", /Testing the collection\s*done/);
  assert.match(await house.text(page, "#selftest-report"), /found from a probability of 90 %\. 50 % is enough to keep false alarms at 20 %/);
  await house.checkAccessibility(page, "self-test");
  await page.getByRole("button", { name: "Use 50 %" }).click();
  await house.waitForText(page, "#selftest-report", /from a probability of 50 %\. That fits/);
  await page.getByRole("button", { name: "Test again" }).waitFor();
  assert.equal((await (await fetch(`${server.address}/v1/collections/default`)).json()).found_from, 0.5);
  await fetch(`${server.address}/v1/collections/default`, {
    method: "PATCH", headers: { "Content-Type": "application/merge-patch+json" }, body: "{\"found_from\": null}" });
  await house.closePage(page);
});

for (const [where, size] of [["desk", {}], ["phone", { width: 390, height: 844, hasTouch: true, isMobile: true }]]) {
  test(`similar, missed and plain images are shown: ${where}`, async () => {
    await house.loadDemonstration(server.address);
    const page = await house.openPage(`${server.address}/#/search`, size);
    const { report } = await (await fetch(`${server.address}/v1/collections/default/selftest`)).json();
    const map = { object: "town map", image_id: "demo-town-map" };
    await page.route(kSelfTest, (route) => route.fulfill({ json: { report: { ...report, reaches_rate: false,
      similar: [{ ...map, other: "poster", other_image: "demo-poster", confused: 2 }],
      missed: [{ ...map, photos: 3, missed: 1 }], plain: [{ ...map, keypoints: 40 }] } } }));
    await page.goto(`${server.address}/#/collection`);
    await house.waitForText(page, "#selftest-report", /No limit keeps false alarms at 20 %/);
    await house.waitForText(page, "#selftest-report", /Too similar[^]*poster[^]*confused in 2 photos/);
    await house.waitForText(page, "#selftest-report", /Missed[^]*missed in 1 of 3 photos[^]*Plain[^]*40 keypoints/);
    await house.shoot(page, `selftest-${where}`);
    await house.checkAccessibility(page, `self-test, ${where}`);
    await house.checkWidth(page, `self-test, ${where}`);
    await house.closePage(page);
  });
}
