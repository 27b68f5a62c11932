// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keys made and revoked on the page.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { test } from "node:test";
import * as house from "../house.mjs";

const statusWith = async (address, key) =>
  (await fetch(`${address}/v1/collections`, { headers: key ? { Authorization: `Bearer ${key}` } : {} })).status;

// What OpenCV reads in a screenshot. Debian's has no decoder for its own QRCodeDetector, but one for WeChat's.
const scanned = (screenshot) => execFileSync("/usr/bin/python3", ["-c",
  "import cv2, numpy, sys; print(*cv2.wechat_qrcode_WeChatQRCode().detectAndDecode(cv2.imdecode(numpy.frombuffer(sys.stdin.buffer.read(), numpy.uint8), 1))[0])"],
  { input: screenshot, encoding: "utf8" }).trim();

test("the first key closes the server, and the page goes on with it; others are made, used and revoked", async () => {
  const own = await house.startServer("--auto-train", "false");
  const page = await house.openPage(own.address);
  await page.getByRole("link", { name: "Keys", exact: true }).click();
  await house.waitForText(page, "#keys-none", /has no keys/);
  await house.eventually(async () => assert.equal(await page.locator("#keys-scope").inputValue(), "admin"));
  assert.equal(await page.locator('#keys-scope option[value="read"]').evaluate((one) => one.disabled), true);
  await house.checkAccessibility(page, "no keys");
  await page.getByRole("button", { name: "Create key" }).click();
  await house.waitForText(page, "#keys-status.error", /Enter a name/);
  await page.route("**/v1/qr", (route) => route.abort());
  await page.locator("#keys-name").fill("me");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#keys-new", /Copy this key now[^]*The server now requires a key/);
  const admin = await page.getByLabel("The new key").inputValue();
  assert.match(admin, /^plk_[0-9a-f]{8}_/);
  assert.deepEqual([await statusWith(own.address, ""), await statusWith(own.address, admin)], [401, 200]);
  await house.waitForText(page, "#keys-list", /me\s+admin[^]*this tab/);
  await house.waitForText(page, "#keys-new .error", /cannot be reached/);
  await page.unroute("**/v1/qr");
  await house.shoot(page, "key-made");
  await house.checkAccessibility(page, "a key is made");
  await house.checkOverlaps(page, "a key is made");

  await page.locator("#keys-name").fill("front desk");
  await page.locator("#keys-scope").selectOption("read");
  await page.getByRole("button", { name: "Create key" }).click();
  await page.waitForFunction((first) => document.querySelector("#keys-new input").value !== first, admin);
  const read = await page.getByLabel("The new key").inputValue();
  assert.equal(await statusWith(own.address, read), 200);
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.getByRole("button", { name: "Copy", exact: true }).click();
  await house.waitForText(page, "#keys-new", /Copied/);
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()), read);
  await page.getByRole("button", { name: "Copy a link with the key" }).click();
  await house.eventually(async () => assert.match(await page.evaluate(() => navigator.clipboard.readText()), /#\/search\?key=plk_/));
  await house.waitForText(page, "#keys-loopback", /this computer only/);
  const shared = await page.evaluate(() => navigator.clipboard.readText());
  const code = page.getByAltText("QR code of the link with the key");
  for (const [colorScheme, width] of [["light", 1200], ["dark", 1200], ["light", 390], ["dark", 390]]) {
    await page.emulateMedia({ colorScheme });
    await page.setViewportSize({ width, height: 900 });
    await code.scrollIntoViewIfNeeded();
    await page.waitForFunction(() => document.querySelector(".key-code").naturalWidth > 0);
    assert.equal(scanned(await page.screenshot()), shared, `${colorScheme} ${width}`);
    await house.checkWidth(page, "a key's code");
    await house.shoot(page, `key-code-${colorScheme}-${width}`);
  }
  await house.checkAccessibility(page, "a key's code");
  await page.setViewportSize({ width: 1200, height: 900 });

  // A colleague opens the link: the key works, and is in no address.
  const colleague = await house.openPage(shared);
  await colleague.waitForFunction(() => document.documentElement.dataset.scope === "read");
  assert.equal(new URL(colleague.url()).hash, "#/search");
  await colleague.locator("#key-button").waitFor();
  await house.closePage(colleague);

  await page.getByRole("link", { name: "Collection", exact: true }).click();
  await page.locator("#view-keys").waitFor({ state: "hidden" });
  await page.goBack();
  await house.waitForText(page, "#keys-list", /front desk/);
  assert.equal((await page.content()).includes(read), false, "it is shown only once");

  await page.getByRole("button", { name: "Revoke the key front desk" }).click();
  await page.getByRole("button", { name: "Keep" }).click();
  assert.equal(await statusWith(own.address, read), 200);
  await page.getByRole("button", { name: "Revoke the key front desk" }).click();
  await page.getByRole("button", { name: "Revoke", exact: true }).click();
  await house.waitForText(page, "#keys-status", /front desk" revoked/);
  assert.equal(await statusWith(own.address, read), 401);
  await page.getByRole("button", { name: "Revoke the key me" }).click();
  await page.getByRole("button", { name: "Revoke", exact: true }).click();
  await house.waitForText(page, "#keys-status.error", /last admin key/);
  await house.closePage(page);

  const phone = await house.openPage(`${own.address}/#/keys`, { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" });
  await phone.locator("#key-input").fill(admin);
  await phone.getByRole("button", { name: "Use key" }).click();
  await house.waitForText(phone, "#keys-list", /front desk/);
  await house.checkWidth(phone, "keys, phone");
  await house.checkOverlaps(phone, "keys, phone");
  await house.checkAccessibility(phone, "keys, phone");
  await house.shoot(phone, "keys-phone");
  await house.closePage(phone);
  await own.stop();
});
