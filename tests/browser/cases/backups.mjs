// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups on the page: made, downloaded with a key and without, deleted.
import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import * as house from "../house.mjs";

const folder = mkdtempSync(join(tmpdir(), "pliant-backups-"));
after(() => rmSync(folder, { recursive: true, force: true }));

const phone = { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" };

// What the page's one backup is called; the file that is downloaded is the server's.
async function downloadOne(page, address, headers = {}) {
  const [file] = await Promise.all([page.waitForEvent("download"),
                                    page.locator("#backups li").first().getByText("Download").click()]);
  const name = file.suggestedFilename();
  const answer = await fetch(`${address}/v1/backups/${name}/content`, { headers });
  assert.equal(answer.status, 200);
  assert.deepEqual(readFileSync(await file.path()), Buffer.from(await answer.arrayBuffer()));
  assert.equal(readFileSync(await file.path()).subarray(0, 15).toString(), "SQLite format 3");
  return name;
}

test("a backup is made, downloaded and, when asked twice, deleted", async () => {
  const server = await house.startServer("--auto-train", "false", "--backup-dir", folder);
  const page = await house.openPage(`${server.address}/#/status`);
  await house.waitForText(page, "#backups", /No backups yet/);
  await page.getByRole("button", { name: "Create a backup" }).click();
  await house.waitForText(page, "#backups-said", /^The backup (has started|is complete)\./);
  await house.waitForText(page, "#status-jobs", /Creating a backup\s*done/);
  await house.waitForText(page, "#backups", /pliant-\S+\.db\s+[\d.]+ [kM]B, \w+ \d+, \d+/);
  await house.waitForText(page, "#backups-said", /^The backup is complete\.$/);
  const name = await downloadOne(page, server.address);
  await house.checkAccessibility(page, "backups");
  await house.checkOverlaps(page, "backups");
  await house.shoot(page, "backups");

  await page.getByRole("button", { name: `Delete the backup ${name}` }).click();
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Keep");
  await page.waitForResponse(/\/v1\/backups$/);  // the list is asked for again meanwhile
  await page.getByRole("button", { name: "Keep" }).click();
  assert.equal((await fetch(`${server.address}/v1/backups/${name}`)).status, 200);
  await page.getByRole("button", { name: `Delete the backup ${name}` }).click();
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await house.waitForText(page, "#backups-said", /deleted/);
  await house.waitForText(page, "#backups", /No backups yet/);
  assert.equal((await fetch(`${server.address}/v1/backups/${name}`)).status, 404);
  await house.closePage(page);
  await server.stop();
});

test("with a key, the page fetches the file; who may not do everything sees no backups", async () => {
  const server = await house.startServer("--auto-train", "false", "--backup-dir", folder);
  const keys = { admin: server.createKey("admin"), write: server.createKey("write") };
  const headers = { Authorization: `Bearer ${keys.admin}` };
  const page = await house.openPage(`${server.address}/#/status`, phone);
  await page.locator("#key-input").fill(keys.admin);
  await page.getByRole("button", { name: "Use key" }).click();
  await page.getByRole("button", { name: "Create a backup" }).click();
  await house.waitForText(page, "#backups", /pliant-\S+\.db/);
  const name = await downloadOne(page, server.address, headers);
  await house.waitForText(page, "#backups", /Downloaded/);
  await house.checkWidth(page, "backups, phone");
  await house.checkOverlaps(page, "backups, phone");
  await house.checkAccessibility(page, "backups, phone");
  await house.shoot(page, "backups-phone");
  // Deleted by somebody else, while the page still lists it.
  const listed = await (await fetch(`${server.address}/v1/backups`, { headers })).text();
  await page.route("**/v1/backups", (route) => route.fulfill({ body: listed, contentType: "application/json" }));
  assert.equal((await fetch(`${server.address}/v1/backups/${name}`, { method: "DELETE", headers })).status, 204);
  await page.getByRole("link", { name: `Download the backup ${name}` }).click();
  await house.waitForText(page, "#backups .error", /This backup no longer exists/);
  await page.unroute("**/v1/backups");
  await house.waitForText(page, "#backups", /No backups yet/);

  await page.getByRole("button", { name: "Key", exact: true }).click();
  await page.locator("#key-input").fill(keys.write);
  await page.getByRole("button", { name: "Use key" }).click();
  await page.locator("#backup-make").waitFor({ state: "hidden" });
  assert.equal(await page.getByRole("heading", { name: "Backups" }).isVisible(), false);
  await house.closePage(page);
  await server.stop();
});

test("where the operator has named no folder, that is said", async () => {
  const server = await house.server("demonstration");
  const page = await house.openPage(`${server.address}/#/status`);
  await house.waitForText(page, "#backups-off", /Backups are off/);
  assert.equal(await page.getByRole("button", { name: "Create a backup" }).isVisible(), false);
  await house.closePage(page);
});
