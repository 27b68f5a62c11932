// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server that wants a key: the page asks for it, keeps it in the tab, and says what a key may not do.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const server = await house.server("demonstration");
const kKey = "pliant_secret";

// Answers every request for data as a server with keys would, going by the key that comes with it.
function guard(page, allowed) {
  return page.route("**/v1/**", async (route) => {
    const shown = await route.request().headerValue("Authorization");
    const refuse = (status, code, headers = {}) => route.fulfill({
      status, headers, contentType: "application/problem+json",
      body: JSON.stringify({ status, code, detail: "refused" }) });
    if (shown !== `Bearer ${kKey}`) return refuse(401, "unauthorized");
    if (allowed(route.request().method())) return route.continue();
    return refuse(403, "forbidden");
  });
}

test("the page asks for a key, uses it for everything, and forgets it when told", async () => {
  await house.loadDemonstration(server.address);
  const page = await house.openPage("about:blank");
  await guard(page, (method) => method !== "DELETE");
  page.faults.length = 0;
  await page.goto(server.address);
  await page.locator("#key-dialog").waitFor();
  await house.checkAccessibility(page, "key dialog");
  await house.shoot(page, "key");
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: "Key", exact: true }).click();  // there is a way back
  await page.locator("#key-input").fill("wrong");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#key-problem.error", /does not work: it is mistyped or revoked/);
  await house.checkAccessibility(page, "a wrong key");
  await house.shoot(page, "key-wrong");
  await page.locator("#key-input").fill(kKey);
  await page.getByRole("button", { name: "Use key" }).click();
  await page.getByRole("button", { name: "crumpled photo of town map" }).click();
  assert.match((await house.hitNames(page))[0], /town map/);
  await page.waitForFunction(() => document.querySelector("#results img").naturalWidth > 0);

  await page.goto(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Delete poster with its images" }).click();
  await page.mouse.move(5, 5);
  await house.waitForText(page, "#objects-list", /does not allow this/);

  await page.getByRole("button", { name: "Key", exact: true }).click();
  await page.getByRole("button", { name: "Forget key" }).click();
  assert.equal(await page.evaluate(() => sessionStorage.length + localStorage.length), 0);
  await page.context().close();
});

test("a key is kept on this device only for people who ask for that", async () => {
  const own = await house.startServer();
  const key = own.createKey("write");
  const page = await house.openPage(own.address);
  const enter = async (remember) => {
    await page.locator("#key-dialog").waitFor();
    await page.locator("#key-input").fill(key);
    await page.getByLabel("Remember the key on this device").setChecked(remember);
    await page.getByRole("button", { name: "Use key" }).click();
    await page.locator("#key-dialog").waitFor({ state: "hidden" });
    const other = await page.context().newPage();  // a tab of the same browser
    await other.goto(own.address);
    await other.waitForLoadState("networkidle");
    const asked = await other.locator("#key-dialog").isVisible();
    await other.close();
    return asked;
  };
  assert.equal(await enter(false), true);
  await page.getByRole("button", { name: "Key", exact: true }).click();
  assert.equal(await enter(true), false);
  await page.getByRole("button", { name: "Key", exact: true }).click();
  assert.equal(await page.getByLabel("Remember the key on this device").isChecked(), true);
  await house.shoot(page, "key-remembered");
  await page.getByRole("button", { name: "Forget key" }).click();
  assert.equal(await page.evaluate(() => sessionStorage.length + localStorage.length), 0);
  await page.context().close();
  await own.stop();
});

test("who may only read is offered nothing else; another key changes that at once", async () => {
  const own = await house.startServer();
  await fetch(`${own.address}/v1/collections/default/images/one?object=thing`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(900) });
  const [reader, writer, admin] = ["read", "write", "admin"].map((scope) => own.createKey(scope));
  const page = await house.openPage(`${own.address}/#/images`);
  const enter = async (key) => {
    // The page may open it by itself just then.
    await page.evaluate(() => document.getElementById("key-dialog").open || document.getElementById("key-button").click());
    await page.locator("#key-input").fill(key);
    await page.getByRole("button", { name: "Use key" }).click();
    await page.locator("#key-dialog").waitFor({ state: "hidden" });
  };
  await enter(reader);
  await house.waitForText(page, "#images-list", /thing/);
  const offered = () => page.evaluate(() => [...document.querySelectorAll("a, button, form")]
    .filter((one) => one.checkVisibility()).map((one) => one.ariaLabel || one.innerText.trim()).join("; "));
  const kChanges = /Add|Delete|Edit|Rename|Select several|Train|Create/;
  await page.waitForFunction(() => document.documentElement.dataset.scope === "read");
  for (const view of ["images", "objects", "object?name=thing", "image?id=one", "collection", "search"]) {
    await page.goto(`${own.address}/#/${view}`);
    await page.waitForLoadState("networkidle");
    assert.doesNotMatch(await offered(), kChanges, view);
  }
  await house.shoot(page, "read-only");
  await page.goto(`${own.address}/#/add`);
  await house.waitForText(page, "#view-add", /can search but not add/);
  await house.checkAccessibility(page, "read only");

  await page.goto(`${own.address}/#/objects`);
  await enter(writer);
  await page.getByRole("button", { name: "Delete thing with its images" }).waitFor();
  await page.getByRole("link", { name: "Add", exact: true }).waitFor();
  await page.goto(`${own.address}/#/collection`);
  await house.waitForText(page, "#collection-facts", /Images\s+1/);
  await house.eventually(async () => assert.equal(await page.locator("#collection-form").isVisible(), false, "only for admins"));
  await enter(admin);
  await page.locator("#collection-form").waitFor();
  await house.closePage(page);
  await own.stop();
});

// Photographs that were searched with are their owner's.
test("a kept photograph goes with its day, its tab and its key", async () => {
  const page = await house.openPage(server.address);
  const kept = (...given) => page.evaluate(async ([step, key]) => {
    const { forgetQueries, keepQuery, keptQuery, purgeQueries } = await import("/assets/kept.js");
    const clock = Date.now;
    if (step === "keep") return keepQuery(new File(["x"], "x.png"));
    if (step === "use key") sessionStorage.setItem("pliant-key", "one");
    if (step === "other tab") sessionStorage.removeItem("pliant-tab");
    if (step === "next day") Date.now = () => clock() + 25 * 3600 * 1000;
    if (step === "purge") {
      Date.now = () => clock() + 25 * 3600 * 1000;
      await purgeQueries();
    }
    if (step === "forget") await forgetQueries();
    const file = await keptQuery(key);
    Date.now = clock;
    return file?.name ?? null;
  }, given);
  let key = await kept("keep");
  assert.deepEqual([await kept("", key), await kept("next day", key), await kept("", key), await kept("other tab", key),
                    await kept("purge", key), await kept("", key)],
                   ["x.png", null, "x.png", "x.png", null, null]);
  await kept("use key", key);
  key = await kept("keep");
  assert.deepEqual([await kept("", key), await kept("other tab", key)], ["x.png", null]);
  key = await kept("keep");
  assert.deepEqual([await kept("", key), await kept("forget", key)], ["x.png", null]);

  key = await kept("keep");
  await page.reload();
  const enter = async (secret) => {
    await page.getByRole("button", { name: "Key", exact: true }).click();
    await page.locator("#key-input").fill(secret);
    await page.getByRole("button", { name: "Use key" }).click();
  };
  await enter("one");
  assert.equal(await kept("", key), "x.png", "the same key");
  await enter("two");
  await page.waitForFunction(() => sessionStorage.getItem("pliant-tab") === null);
  assert.equal(await page.evaluate(() => new Promise((done) => {
    const opening = indexedDB.open("pliant");
    opening.onsuccess = () => {
      const all = opening.result.transaction("queries").objectStore("queries").count();
      all.onsuccess = () => done(all.result);
    };
  })), 0);
  await page.context().close();
});

test("too many requests are said in words when waiting would take long", async () => {
  const page = await house.openPage(server.address);
  await page.route("**/search", (route) => route.fulfill({
    status: 429, headers: { "Retry-After": "60" }, contentType: "application/problem+json",
    body: JSON.stringify({ status: 429, code: "rate_limited", detail: "slow down" }) }));
  await page.getByRole("button", { name: "crumpled photo of poster" }).click();
  await house.waitForText(page, "#search-status.error", /Too many requests.*again in 60 s/);
  await house.closePage(page);
});
