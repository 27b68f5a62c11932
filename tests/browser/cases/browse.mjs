// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Browsing page by page; deleting with time to undo.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../pictures.mjs";

const kPictures = 30;

const server = await house.server("browse", "--auto-train", "false");

async function addPictures() {
  for (let i = 0; i < kPictures; ++i) {
    const query = `?object=thing%20${i % 3}`;
    const answer = await fetch(`${server.address}/v1/collections/default/images${query}`, {
      method: "POST", headers: { "Content-Type": "image/png" }, body: blobs(100 + i) });
    assert.equal(answer.status, 201);
  }
}

const count = async () => (await (await fetch(`${server.address}/v1/collections/default`)).json()).images;
const cards = (page, view) => page.locator(`#${view}-list .card`);

test("pictures come page by page, and the way back", async () => {
  await addPictures();
  const page = await house.openPage(`${server.address}/#/pictures`);
  await cards(page, "pictures").first().waitFor();
  assert.equal(await cards(page, "pictures").count(), 24);
  const first = await page.locator("#pictures-list .card a").first().getAttribute("href");
  await page.getByRole("link", { name: "Next page" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#pictures-list .card").length === 6);
  await house.shoot(page, "pictures");
  await house.checkAccessibility(page, "pictures");
  await page.getByRole("link", { name: "Previous page" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#pictures-list .card").length === 24);
  assert.equal(await page.locator("#pictures-list .card a").first().getAttribute("href"), first);
  await house.closePage(page);
});

test("an object leads to its pictures, a picture to a search with it", async () => {
  const page = await house.openPage(`${server.address}/#/objects`);
  await cards(page, "objects").first().waitFor();
  assert.equal(await cards(page, "objects").count(), 3);
  assert.match(await cards(page, "objects").nth(1).innerText(), /thing 1\s+10 pictures/);
  await house.checkAccessibility(page, "objects");
  await cards(page, "objects").nth(1).getByRole("link").click();
  await house.waitForText(page, "#pictures-title", /Pictures of thing 1/);
  await page.waitForFunction(() => document.querySelectorAll("#pictures-list .card").length === 10);
  await page.locator("#pictures-list .card a").first().click();
  await page.waitForFunction(() => !document.querySelector("#view-search").hidden);
  assert.match(page.url(), /#\/search\?image=/);
  await house.closePage(page);
});

test("deleting can be undone; else it is done when the time is over", async () => {
  const page = await house.openPage(`${server.address}/#/pictures`);
  await cards(page, "pictures").first().waitFor();
  const before = await count();
  const remove = page.getByRole("button", { name: /^Delete the picture/ }).first();
  await remove.click();
  await page.waitForFunction(() => document.querySelectorAll("#pictures-list .card").length === 23);
  await house.checkAccessibility(page, "deleted");
  await house.shoot(page, "deleted");
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#pictures-list .card").length === 24);
  assert.equal(await count(), before);

  await remove.click();
  assert.equal(await count(), before, "not before the time is over");
  await page.mouse.move(5, 5);
  await page.locator("#notices .notice").waitFor({ state: "detached" });
  assert.equal(await count(), before - 1);
  await house.closePage(page);
});

test("leaving the page deletes at once; a whole object goes too", async () => {
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Delete thing 2 with its pictures" }).click();
  await house.waitForText(page, "#notices", /Deleted: thing 2/);
  await page.goto("about:blank");
  const deadline = Date.now() + 20_000;
  const left = async () =>
    (await fetch(`${server.address}/v1/collections/default/objects/thing%202`)).status;
  while (await left() !== 404) {
    assert.ok(Date.now() < deadline, "the object is still there");
    await new Promise((wake) => setTimeout(wake, 100));
  }
  await house.closePage(page);
});

test("a picture that cannot be deleted comes back with the reason", async () => {
  const page = await house.openPage(`${server.address}/#/pictures`);
  await page.route("**/images/*", (route) => (route.request().method() === "DELETE" ?
    route.fulfill({ status: 403, contentType: "application/problem+json",
                    body: JSON.stringify({ code: "forbidden", detail: "no" }) }) : route.continue()));
  await page.getByRole("button", { name: /^Delete the picture/ }).first().click();
  await page.mouse.move(5, 5);
  await house.waitForText(page, "#pictures-list", /not allowed to do this/);
  await house.closePage(page);
});
