// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// /docs: every operation of the document, to read and to try; nothing from elsewhere.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const kPhone = { width: 390, height: 844, hasTouch: true, isMobile: true };
const server = await house.server("demonstration");

test("every operation is there, by tag, with its parameters, answers and an example", async () => {
  const page = await house.openPage(`${server.address}/docs`);
  await page.locator("#images\\.list").waitFor();
  const { paths } = await (await fetch(`${server.address}/v1/openapi.json`)).json();
  const operations = Object.values(paths).flatMap((item) => Object.values(item));
  await house.eventually(async () => assert.equal(await page.locator("details.operation:not([id^=schema-])").count(), operations.length));
  for (const { operationId, tags } of operations) {
    assert.equal(tags.length, 1, operationId);
    await page.locator(`[id="${operationId}"]`).waitFor();
  }
  await page.locator("#search > summary").click();
  for (const words of [/Find the object that an image shows/, /group_by/, /1000/, /no_vocabulary/, /took_ms/, /curl -F image=@mug\.png/]) {
    await house.waitForText(page, "#search", words);
  }
  assert.match(page.url(), /#search$/);
  await house.checkAccessibility(page, "docs");
  await house.checkWidth(page, "docs");
  await house.shoot(page, "docs");
  await page.reload();
  await page.waitForFunction(() => document.getElementById("search")?.open);
  await house.closePage(page);
});

test("what is looked for is found", async () => {
  const page = await house.openPage(`${server.address}/docs`);
  await page.locator("#images\\.list").waitFor();
  await page.locator("#docs-find").fill("thumbnail");
  await house.waitForText(page, "#docs-status", /\d+ entr(y|ies) found/);
  await house.eventually(async () => assert.equal(await page.locator("#images\\.thumbnail").isVisible(), true));
  await house.eventually(async () => assert.equal(await page.locator("#jobs\\.list").isVisible(), false));
  await page.locator("#docs-find").fill("");
  await page.locator("#jobs\\.list").waitFor();
  await house.closePage(page);
});

test("requests are sent as they are typed, and answered in full", async () => {
  await house.loadDemonstration(server.address);
  const page = await house.openPage(`${server.address}/docs#images.list`, kPhone);
  const box = page.locator("#images\\.list");
  await box.getByLabel("limit").fill("2");
  await house.eventually(async () => assert.equal(await box.getByLabel("c", { exact: true }).inputValue(), "default"));
  await box.getByRole("button", { name: "Send GET" }).click();
  await house.waitForText(page, "#images\\.list .result", /^200[^]*content-type: application\/json[^]*"images": \[/);
  await house.eventually(async () => assert.match(await box.locator(".try > pre").innerText(), /^curl 'http:[^']*\/v1\/collections\/default\/images\?limit=2'$/));
  await house.checkAccessibility(page, "docs, tried");
  await house.checkWidth(page, "docs, tried");
  await house.shoot(page, "docs-tried");
  await box.getByLabel("limit").fill("many");
  await box.getByRole("button", { name: "Send GET" }).click();
  await house.waitForText(page, "#images\\.list .result", /^400[^]*"code": "invalid_parameter"/);

  await page.goto(`${server.address}/docs#images.thumbnail`);
  const thumbnail = page.locator("#images\\.thumbnail");
  await thumbnail.getByRole("button", { name: "Send GET" }).click();
  await house.waitForText(page, "#images\\.thumbnail .try [role=status]", /id is required/);
  await thumbnail.getByLabel("id", { exact: true }).fill("demo-poster");
  await thumbnail.getByRole("button", { name: "Send GET" }).click();
  await page.waitForFunction(() => document.querySelector("#images\\.thumbnail .answer-image")?.naturalWidth > 100);

  await page.goto(`${server.address}/docs#search`);
  const search = page.locator("#search");
  await search.getByLabel("Or an image").setInputFiles([{ name: "q.png", mimeType: "image/png", buffer: blobs(3) }]);
  await search.getByRole("button", { name: "Send POST" }).click();
  await house.waitForText(page, "#search .result", /^200[^]*"hits"/);
  await search.getByLabel("Or an image").setInputFiles([]);
  await search.getByLabel(/^Body/).fill('{"image_id": ');
  await search.getByRole("button", { name: "Send POST" }).click();
  await house.waitForText(page, "#search .try [role=status]", /not valid JSON/);
  await search.getByLabel(/^Body/).fill('{"image_id": "demo-poster", "exclude_self": false, "limit": 1}');
  await search.getByRole("button", { name: "Send POST" }).click();
  await house.waitForText(page, "#search .result", /^200[^]*"demo-poster"/);
  await house.closePage(page);
});

for (const colorScheme of ["light", "dark"]) {
  test(`the page as it is seen, ${colorScheme}`, async () => {
    for (const [size, options] of Object.entries({ wide: {}, phone: kPhone })) {
      const page = await house.openPage(`${server.address}/docs`, { ...options, colorScheme });
      await page.locator("#images\\.list").waitFor();
      await house.checkAccessibility(page, `docs ${size} ${colorScheme}`);
      await house.checkWidth(page, `docs ${size}`);
      await house.checkOverlaps(page, `docs ${size}`);
      await house.shoot(page, `docs-${size}-${colorScheme}`);
      await house.closePage(page);
    }
  });
}
