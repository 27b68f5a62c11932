// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What fails because the server does not answer can be tried again in place; what is refused cannot.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");
// [the address, where the page says what is wrong, a sign of the contents, what it asks for]
const kViews = {
  objects: ["#/objects", "#objects-status", "#objects-list .card img", "**/objects?*"],
  images: ["#/images", "#images-status", "#images-list .card img", "**/images?*"],
  object: ["#/object?name=poster", "#object-status", "#object-list .card img", "**/images?*"],
  image: ["#/image?id=demo-poster", "#image-status", "#image-frame img", "**/images/demo-poster"],
  collection: ["#/collection", "#collection-status", "#collection-facts div", "**/vocabularies"],
  keys: ["#/keys", "#keys-status", "#keys-none", "**/v1/keys"],
  search: ["#/search?image=demo-poster", "#search-status", "#results .hit, #results-empty", "**/search"],
};

for (const [view, [hash, status, sign, asked]] of Object.entries(kViews)) {
  test(`try again: ${view}`, async () => {
    await house.loadDemonstration(server.address);
    const page = await house.openPage(`${server.address}/docs`);
    await page.route(asked, (route) => route.abort());
    await page.goto(`${server.address}/${hash}`);
    await house.waitForText(page, status, /The server cannot be reached.* Try again$/);
    assert.equal(await page.locator(sign).filter({ visible: true }).count(), 0);
    await house.checkAccessibility(page, `${view}, to be tried again`);
    await house.shoot(page, `again-${view}`);
    await page.unroute(asked);
    await page.locator(status).getByRole("button", { name: "Try again" }).click();
    await page.locator(sign).filter({ visible: true }).first().waitFor();
    assert.doesNotMatch(await page.locator(status).textContent(), /Try again/);
    await house.closePage(page);
  });
}

test("an image that does not exist is not tried again", async () => {
  const page = await house.openPage(`${server.address}/#/image?id=none`);
  await house.waitForText(page, "#image-status", /\S/);
  assert.equal(await page.getByRole("button", { name: "Try again" }).count(), 0);
  await house.closePage(page);
});
