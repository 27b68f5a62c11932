// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every view in light and dark, on a screen and on a phone: nothing sticks out, nothing lies on something else, axe
// finds nothing.
import { test } from "node:test";
import * as house from "../house.mjs";

const kSizes = { wide: { width: 1200, height: 900 }, phone: { width: 390, height: 844, hasTouch: true, isMobile: true } };
const kViews = {
  search: ["#/search", "#examples-list img"],
  found: ["#/search", "#blend-figure canvas"],
  add: ["#/add", "#add-drop"],
  objects: ["#/objects", "#objects-list .card img"],
  images: ["#/images", "#images-list .card img"],
  object: ["#/object?name=poster", "#object-list .card img"],
  image: ["#/image?id=demo-poster", "#image-frame img"],
  status: ["#/status", "#status-facts div"],
  collection: ["#/collection", "#collection-facts div"],
};

const server = await house.server("demonstration");

for (const [size, options] of Object.entries(kSizes)) {
  for (const colorScheme of ["light", "dark"]) {
    test(`${size}, ${colorScheme}`, async () => {
      await house.loadDemonstration(server.address);
      const page = await house.openPage(server.address, { ...options, colorScheme });
      for (const [name, [hash, sign]] of Object.entries(kViews)) {
        await page.goto(`${server.address}/${hash}`);
        if (name === "found") await page.getByRole("button", { name: "crumpled photo of town map" }).click();
        await page.locator(sign).first().waitFor();
        await page.waitForLoadState("networkidle");
        const where = `${name}-${size}-${colorScheme}`;
        await house.shoot(page, where);
        await house.checkWidth(page, where);
        await house.checkOverlaps(page, where);
        await house.checkAccessibility(page, where);
      }
      await house.closePage(page);
    });
  }
}
