// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whole walks, as somebody takes them who has never seen the page: at a desk and on a telephone, in light and dark, and
// by keyboard alone.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";
import { photograph, thing } from "../images.mjs";

const kSizes = { desk: { width: 1280, height: 800 }, phone: { width: 390, height: 844, hasTouch: true, isMobile: true } };
const file = (name, buffer) => ({ name, mimeType: "image/png", buffer });
const nameOf = (i) => `thing ${String(i + 1).padStart(2, "0")}`;
const files = (n) => Array.from({ length: n }, (_, i) => file(`${nameOf(i)}.png`, thing(i + 1)));
const photo = (...parts) => [file("image.png", photograph(parts))];

async function firstVisit(where, options) {
  const own = await house.startServer();
  const page = await house.openPage(own.address, options);
  await page.locator("#welcome").waitFor();
  await house.shoot(page, `walk-welcome-${where}`);
  await page.getByRole("link", { name: "Add images" }).click();
  await page.locator("#add-files").setInputFiles(files(24));
  await house.checkOverlaps(page, `24 files, ${where}`);
  await house.checkWidth(page, `24 files, ${where}`);
  await house.shoot(page, `walk-files-${where}`);
  await page.getByRole("button", { name: "Add 24 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 24 images added\./);
  await house.checkOverlaps(page, `24 added, ${where}`);
  await page.getByRole("link", { name: "Search with a photo" }).click();  // what comes next
  await house.waitForText(page, "#search-status", /24 images of 24 objects in this collection/);

  await page.getByRole("link", { name: "Browse" }).click();
  await page.getByRole("button", { name: "Edit thing 03", exact: true }).click();
  await page.getByLabel("Name", { exact: true }).fill("green tin");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#objects-list", /green tin/);
  await house.shoot(page, `walk-renamed-${where}`);

  const ask = async (image, pattern) => {
    await page.getByRole("link", { name: "Search", exact: true }).click();
    await page.locator(options.hasTouch ? "#search-camera" : "#search-file").setInputFiles(image);
    await house.waitForText(page, "#search-status", pattern);
  };
  await ask(photo({ seed: 3, x: 330, y: 250, scale: 1.1, angle: 17 }), /^Found: green tin\./);
  for (const part of ["#search-status .verdict", "#stage", "#results .hit"]) {
    await house.eventually(async () => {
      const box = await page.locator(part).first().boundingBox();
      assert.ok(box.y >= 0 && box.y + box.height <= options.height, `${part}: ${box.y} to ${box.y + box.height}`);
    });
  }
  await house.checkOverlaps(page, `found, ${where}`);
  await house.shoot(page, `walk-found-${where}`);

  await ask(photo({ seed: 99, x: 330, y: 250, scale: 1.1, angle: 17 }), /^Not found\./);
  await house.eventually(async () => assert.equal(await page.locator(".tag").count(), 0));
  await house.shoot(page, `walk-absent-${where}`);

  await ask(photo({ seed: 1, x: 165, y: 120, scale: 0.9, angle: 8 }, { seed: 2, x: 480, y: 125, scale: 0.9, angle: -12 },
                  { seed: 5, x: 160, y: 360, scale: 0.9, angle: -5 }, { seed: 6, x: 480, y: 355, scale: 0.9, angle: 10 }),
            /^4 objects found: /);
  const verdict = await house.text(page, "#search-status .verdict");
  for (const i of [0, 1, 4, 5]) assert.ok(verdict.includes(nameOf(i)), verdict);
  await house.eventually(async () => assert.equal(await page.locator(".tag").count(), 4));
  const middles = await page.locator(".tag").evaluateAll((list) => list.map((one) => one.getBoundingClientRect()));
  for (const [i, a] of middles.entries()) {
    for (const b of middles.slice(i + 1)) {
      assert.ok(a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top, "no name lies on another");
    }
  }
  await house.checkAccessibility(page, `four objects, ${where}`);
  await house.shoot(page, `walk-four-${where}`);
  await house.closePage(page);
  await own.stop();
}

for (const [size, box] of Object.entries(kSizes)) {
  for (const colorScheme of ["light", "dark"]) {
    test(`a first visit, ${size}, ${colorScheme}: 24 files without typing, one renamed, then asked with photographs`,
         () => firstVisit(`${size}-${colorScheme}`, { ...box, colorScheme }));
  }
}

test("by keyboard alone: added, looked at, deleted, brought back, found", async () => {
  const own = await house.startServer();
  const page = await house.openPage(own.address);
  await page.locator("#welcome").waitFor();
  const focused = () => page.evaluate(() => {
    const { id, innerText, ariaLabel, labels } = document.activeElement;
    if (document.activeElement === document.body) return "";
    return `${id} ${ariaLabel ?? (innerText?.trim() || labels?.[0]?.innerText || "")}`;
  });
  const tabTo = async (pattern, key = "Tab") => {
    for (let i = 0; i < 60; ++i) {
      if (pattern.test(await focused())) return;
      await page.keyboard.press(key);
    }
    assert.fail(`${key} does not lead to ${pattern}, but to ${await focused()}`);
  };
  await tabTo(/Add images/);
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.activeElement.id === "add-title");
  await tabTo(/^add-files /);
  await page.locator("#add-files").setInputFiles(files(4));  // as the system's dialog would, after Enter
  await tabTo(/Add 4 images/);
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#add-status", /Finished: 4 images added\./);
  await tabTo(/Browse/, "Shift+Tab");
  await page.keyboard.press("Enter");
  await page.locator("#objects-list .card").nth(3).waitFor();
  await tabTo(/^ *thing 02/);
  await page.keyboard.press("Enter");
  await page.locator("#object-list .card").first().waitFor();
  await tabTo(/^ *thing 02, ?thing 02\.png|^ *thing 02/);
  await tabTo(/^ *Edit the image/);
  await tabTo(/^ *thing 02/, "Shift+Tab");
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#image-title", /thing 02/);
  await tabTo(/Delete the image thing 02/);
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#notices", /Deleted: thing 02/);
  await tabTo(/^ *Undo/);
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#image-title", /thing 02/);
  await tabTo(/^ *Find similar/);
  await page.keyboard.press("Enter");
  await house.waitForText(page, "#search-status", /No other similar object found|Perhaps/);
  await page.goBack();
  await house.waitForText(page, "#image-title", /thing 02/);
  await tabTo(/^ *Search$/, "Shift+Tab");
  await page.keyboard.press("Enter");
  await tabTo(/^search-file /);
  await page.locator("#search-file").setInputFiles(photo({ seed: 4, x: 330, y: 250, scale: 1.1, angle: -20 }));
  await house.waitForText(page, "#search-status", /^Found: thing 04\./);
  await house.closePage(page);
  await own.stop();
});
