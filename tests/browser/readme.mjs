// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Makes the image on README's first screen, server/web/readme-query.jpg: a demonstration object found
// crumpled, by DEAL. Run as: bash tests/browser/run.sh build/release readme.mjs
import assert from "node:assert/strict";
import { statSync } from "node:fs";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import * as house from "./house.mjs";

const image = fileURLToPath(new URL("../../server/web/readme-query.jpg", import.meta.url));
const kLargest = 200_000;  // bytes

test("the image of a query", async () => {
  const server = await house.server("readme", "--descriptor", "deal");
  await house.loadDemonstration(server.address);
  const page = await house.openPage(server.address, { width: 1040, height: 900 });
  await page.getByRole("button", { name: "crumpled photo of town map" }).click();
  assert.match((await house.hitNames(page))[0], /town map/);
  await page.waitForFunction(() => !document.querySelector("#blend-figure").hidden);
  await page.mouse.move(0, 0);
  await page.locator("#workspace").screenshot({ path: image, type: "jpeg", quality: 72 });
  assert.ok(statSync(image).size < kLargest, `${statSync(image).size} bytes`);
  await house.closePage(page);
});
