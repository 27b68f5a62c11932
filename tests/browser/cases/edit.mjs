// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names and labels, changed in place.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";

const server = await house.server("edit", "--auto-train", "false");
const base = `${server.address}/v1/collections/default`;

const read = async (path) => (await fetch(base + path)).json();
const status = async (path) => (await fetch(base + path)).status;

async function put(id, object, metadata, seed) {
  const query = new URLSearchParams({ object, metadata: JSON.stringify(metadata) });
  const answer = await fetch(`${base}/images/${id}?${query}`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(seed) });
  assert.ok(answer.ok, await answer.text());
}

async function prepare() {
  for (const { object } of (await read("/objects?limit=100")).objects) {
    await fetch(`${base}/objects/${encodeURIComponent(object)}`, { method: "DELETE" });
  }
  await put("a", "mug", { shelf: 4, code: "007", colour: "red", deep: { x: 1 } }, 200);
  await put("b", "mug", {}, 201);
  await put("c", "cup", {}, 202);
}

const card = (page, view, name) => page.locator(`#${view}-list .card`, { hasText: name });

test("an object is renamed in place, with all its images", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Edit mug", exact: true }).click();
  await house.checkAccessibility(page, "renaming");
  await house.shoot(page, "renaming");
  await page.getByLabel("Name", { exact: true }).fill("tea mug");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#objects-list", /tea mug/);
  await house.eventually(async () => assert.match(await card(page, "objects", "tea mug").innerText(), /2 images/));
  assert.equal(await status("/objects/mug"), 404);
  await page.waitForFunction(() => document.activeElement.textContent.includes("tea mug"));

  // Escape closes the form, and nothing has changed.
  await page.getByRole("button", { name: "Edit cup", exact: true }).click();
  await page.keyboard.press("Escape");
  await house.eventually(async () => assert.equal(await page.locator("form.edit").count(), 0));
  assert.match(await page.evaluate(() => document.activeElement.ariaLabel), /^Edit cup/);

  // A name that is taken: nothing happens unless somebody says so.
  await page.getByRole("button", { name: "Edit cup", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("tea mug");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /named tea mug already exists/);
  assert.equal((await read("/objects/cup")).images, 1);
  await house.checkAccessibility(page, "a taken name");
  await page.getByRole("button", { name: "Merge" }).click();
  await page.waitForFunction(() => document.querySelectorAll("#objects-list .card").length === 1);
  assert.equal((await read("/objects/tea%20mug")).images, 3);
  await house.closePage(page);
});

test("a rename can be undone: of an object, also on its page, of an image, and of a collection", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  const undo = async () => {
    await page.locator("#notices").getByRole("button", { name: "Undo" }).click();
    await house.eventually(async () => assert.equal(await page.locator(".notice").count(), 0));
  };
  await page.getByRole("button", { name: "Edit mug", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("tea mug");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#notices", /Renamed to tea mug/);
  await house.checkAccessibility(page, "a rename with undo");
  await house.shoot(page, "renamed");
  await undo();
  await card(page, "objects", /^mug/).waitFor();
  assert.equal((await read("/objects/mug")).images, 2);

  await page.goto(`${server.address}/#/object?name=mug`);
  await page.getByRole("button", { name: "Edit mug", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("pot");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#object-title", /pot/);
  await undo();
  await house.waitForText(page, "#object-title", /mug/);
  assert.match(page.url(), /name=mug$/);

  await page.goto(`${server.address}/#/images`);
  await page.getByRole("button", { name: "Edit the image a of mug" }).click();
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("cup");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#notices", /Renamed to cup/);
  await undo();
  await house.eventually(async () => assert.equal((await read("/images/a")).object, "mug"));

  await page.goto(`${server.address}/#/collection`);
  await page.getByLabel("Name of this collection").fill("Summer");
  await page.getByRole("button", { name: "Rename" }).click();
  await house.waitForText(page, "#collection-title", /Summer/);
  await undo();
  await house.waitForText(page, "#collection-title", /default/);
  await house.closePage(page);
});

test("what takes the name of something that is being deleted is not deleted with it", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  const gone = () => page.waitForFunction(() => !document.querySelector("#notices progress"));
  await page.getByRole("button", { name: "Delete mug with its images" }).click();
  await page.getByRole("button", { name: "Edit cup", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("mug");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#objects-list", /mug/);
  await gone();
  assert.deepEqual((await read("/images?limit=9")).images.map(({ id, object }) => [id, object]), [["c", "mug"]]);

  // An image that is moved there.
  await put("d", "pot", {}, 203);
  await page.reload();
  await page.getByRole("button", { name: "Delete mug with its images" }).click();
  await page.locator("#objects-list a", { hasText: "pot" }).click();
  await page.getByRole("button", { name: "Edit the image d of pot" }).click();
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("mug");
  await page.getByRole("button", { name: "Save" }).click();
  await page.waitForFunction(() => !document.querySelector("form.edit"));
  await gone();
  assert.deepEqual((await read("/images?limit=9")).images.map(({ id, object }) => [id, object]), [["d", "mug"]]);

  // Images that are added to it: another one, and the very one that is being deleted.
  const add = async (seed) => {
    await page.goto(`${server.address}/#/add`);
    await page.locator("#add-files").setInputFiles([{ name: "mug.png", mimeType: "image/png", buffer: blobs(seed) }]);
    await page.getByRole("button", { name: "Add 1 image" }).click();
    await house.waitForText(page, "#add-status", /Finished: \d images? added\.$/);
    await gone();
    return (await read("/objects/mug")).images;
  };
  await page.goto(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Delete mug with its images" }).click();
  assert.equal(await add(204), 1);
  assert.equal(await status("/images/d"), 404, "it was to be deleted");
  await page.goto(`${server.address}/#/images`);
  await page.getByRole("button", { name: /^Delete the image/ }).click();
  assert.equal(await add(204), 1);
  await house.closePage(page);
});

test("an offer holds for the name that it was made for", async () => {
  await prepare();
  await put("d", "pot", {}, 203);
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.getByRole("button", { name: "Edit cup", exact: true }).click();
  const offer = page.getByRole("button", { name: "Merge" });
  const field = page.getByLabel("Name", { exact: true });
  await field.fill("mug");
  await page.keyboard.press("Enter");
  await offer.waitFor();
  await field.fill("pot");
  await house.eventually(async () => assert.equal(await offer.count(), 0));
  await page.keyboard.press("Enter");
  await offer.waitFor();
  await field.evaluate((input) => { input.value = "mug"; });  // as nobody types
  await offer.click();
  await house.waitForText(page, "#notices", /Merged cup into pot/);
  assert.deepEqual([(await read("/objects/mug")).images, (await read("/objects/pot")).images], [2, 2]);
  await house.closePage(page);
});

test("an image moves to another object and gets other labels; what was not touched stays as it was", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  await page.getByRole("button", { name: "Edit the image a of mug" }).click();
  const labels = page.getByLabel("Labels, one per line");
  await house.eventually(async () => assert.equal(await labels.inputValue(), "code=007\ncolour=red\nshelf=4"));
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("cup");
  await labels.fill("code=007\nshelf=5\nnew=true, and more");
  await house.checkAccessibility(page, "editing");
  await house.shoot(page, "editing");
  await page.getByRole("button", { name: "Save" }).click();
  const changed = page.locator("#images-list .card", { has: page.getByRole("button", { name: "Edit the image a of cup" }) });
  await changed.waitFor();
  await house.eventually(async () => assert.match(await changed.innerText(), /shelf: 5/));
  assert.match(await page.evaluate(() => document.activeElement.ariaLabel), /Edit the image a of cup/);
  const now = await read("/images/a");
  assert.equal(now.object, "cup");
  assert.deepEqual(now.metadata, { shelf: 5, code: "007", deep: { x: 1 }, new: "true, and more" });
  assert.equal((await read("/objects/cup")).images, 2);

  await page.getByRole("button", { name: "Edit the image b of mug" }).click();
  await labels.fill("no label");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /name=value/);
  await house.closePage(page);
});

test("two clicks open one form, also behind a proxy that makes ETags weak", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  let reads = 0;
  await page.route("**/images/a", async (route) => {
    if (route.request().method() !== "GET") return route.continue();
    ++reads;
    const answer = await route.fetch();
    return route.fulfill({ response: answer, headers: { ...answer.headers(), etag: `W/${answer.headers().etag}` } });
  });
  await page.getByRole("button", { name: "Edit the image a of mug" }).evaluate((button) => {
    button.click();
    button.click();
  });
  await page.locator("form.edit").first().waitFor();
  await page.waitForLoadState("networkidle");
  await house.eventually(async () => assert.deepEqual([reads, await page.locator("form.edit").count()], [2, 1]));
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("beaker");
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "#images-list", /beaker/);
  assert.equal((await read("/images/a")).object, "beaker");
  await house.closePage(page);
});

test("an image that moves into an object on its way out does not come back", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  await page.getByRole("button", { name: "Edit the image c of cup" }).click();
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("mug");
  await page.evaluate(async () => {  // deleted while the answer was on its way
    const { deleteLater } = await import("/assets/undo.js");
    const { objectPath } = await import("/assets/api.js");
    const original = fetch;
    globalThis.fetch = async (path, options) => {
      const answer = await original(path, options);
      if (options?.method === "PATCH") deleteLater({ paths: [objectPath("mug")], text: "mug", restore() {} });
      return answer;
    };
  });
  await page.getByRole("button", { name: "Save" }).click();
  await page.waitForFunction(() => document.activeElement.id === "images-title");
  await house.eventually(async () => assert.equal(await card(page, "images", "c").locator("form").count(), 0));
  await house.closePage(page);
});

test("what somebody else has changed meanwhile is not overwritten", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/images`);
  await page.getByRole("button", { name: "Edit the image a of mug" }).click();
  await page.locator("form.edit").getByLabel("Object", { exact: true }).fill("mine");
  await put("a", "theirs", {}, 200);
  await page.getByRole("button", { name: "Save" }).click();
  await house.waitForText(page, "form.edit .error", /Someone else changed this image/);
  assert.equal((await read("/images/a")).object, "theirs");
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: "Edit the image a of mug" }).click();
  await house.eventually(async () => assert.equal(await page.locator("form.edit").getByLabel("Object", { exact: true }).inputValue(), "theirs"));
  await house.closePage(page);
});

test("an image that is there already by another name can be renamed where it is added", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/add`);
  const add = async () => {
    await page.locator("#add-files").setInputFiles([{ name: "again.png", mimeType: "image/png", buffer: blobs(200) }]);
    await page.getByLabel("Object in again.png").last().fill("beaker");
    await page.getByRole("button", { name: "Add 1 image" }).click();
    await house.waitForText(page, "#add-list li:last-child .error", /already stored, as mug/);
  };
  await add();
  await page.evaluate(async () => (await import("/assets/api.js")).setCollection("elsewhere"));  // chosen meanwhile
  await house.checkAccessibility(page, "an offer to rename");
  await house.shoot(page, "rename-offer");
  await page.getByRole("button", { name: "Rename to beaker" }).click();
  await house.waitForText(page, "#add-list li:last-child", /renamed to beaker/);
  assert.equal((await read("/images/a")).object, "beaker");
  await house.eventually(async () => assert.match(await house.text(page, "#add-summary"), /0 of 1 image added, 1 already stored/));
  await house.closePage(page);
});

test("labels are read and written as people type them", async () => {
  const page = await house.openPage(server.address);
  const patch = (metadata, lines) => page.evaluate(async ([before, text]) => {
    const { labelsPatch } = await import("/assets/labels.js");
    try {
      return labelsPatch(before, text);
    } catch (error) {
      return error.message;
    }
  }, [metadata, lines]);
  const before = { n: 7, s: "7", t: true, list: [1], "a=b": 1, two: "x\ny" };
  assert.equal(await patch(before, "n=7\ns=7\nt=true"), null);
  assert.deepEqual(await patch(before, "n=8\n  t = false \nz="), { n: 8, s: null, t: false, z: "" });
  assert.match(await patch(before, "=x"), /not a label/);
  assert.match(await patch(before, "n=7\ns=7\nt=true\nlist=2"), /"list" cannot be edited here/);
  assert.equal(await patch({ n: 7, returned: "x\ry" }, "n=7"), null, "a text field would change its end of line");
  await house.closePage(page);
});
