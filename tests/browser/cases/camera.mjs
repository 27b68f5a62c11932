// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The live camera, with Chromium's own that plays a film: crumpled images of two demonstration objects by turns.
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import * as house from "../house.mjs";

const kFramesEach = 300;  // of one object, before the other comes; Chromium plays about 30 a second
const server = await house.server("demonstration");

async function film(...names) {
  const folder = mkdtempSync(join(tmpdir(), "pliant-film-"));
  after(() => rmSync(folder, { recursive: true, force: true }));
  const file = join(folder, "film.mjpeg");
  const parts = [];
  const objects = await house.loadDemonstration(server.address);  // not before: others begin with nothing
  for (const name of names) {
    const image = await house.bytesOf(server.address, objects.find(({ object }) => object === name).crumpled);
    for (let i = 0; i < kFramesEach; ++i) parts.push(image);
  }
  writeFileSync(file, Buffer.concat(parts));
  return ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream", `--use-file-for-fake-video-capture=${file}`];
}

const outlined = (page) => page.waitForFunction(() => {
  const canvas = document.querySelector("#camera-overlay");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let seen = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200 && data[i] > 200 && data[i + 1] > 180 && data[i + 2] < 120) ++seen;
  return seen > 200;
});

test("what is before the camera is found, outlined and followed, and the next thing after it", async () => {
  const page = await house.openPage(server.address, { flags: await film("town map", "poster"), width: 390, height: 844, hasTouch: true, isMobile: true });
  const asked = [];
  page.on("request", (request) => { if (request.method() === "POST") asked.push(new URL(request.url()).pathname); });
  await page.getByRole("link", { name: "Live camera" }).click();
  await house.waitForText(page, "#camera-status", /^(Found|Following): (town map|poster)\.$/);
  const first = /: (town map|poster)\./.exec(await house.text(page, "#camera-status"))[1];
  await outlined(page);
  await house.waitForText(page, "#camera-status", /^Following/);
  await house.waitForText(page, "#camera-found", new RegExp(first));
  await house.checkWidth(page, "camera");
  await house.checkOverlaps(page, "camera");
  await house.checkAccessibility(page, "camera");
  await house.shoot(page, "camera");
  assert.ok(asked.some((path) => path.endsWith("/locate")), "an object that was found is located in the next frames");
  const other = first === "poster" ? "town map" : "poster";
  await house.waitForText(page, "#camera-status", new RegExp(`^(Found|Following): ${other}\\.$`));

  // Who leaves turns the camera off; nothing is asked for any more.
  const track = await page.evaluateHandle(() => document.querySelector("#camera-video").srcObject.getTracks()[0]);
  await page.getByRole("link", { name: "Browse" }).click();
  await page.waitForFunction((one) => one.readyState === "ended", track);
  await page.waitForLoadState("networkidle");
  const before = asked.length;
  await page.waitForTimeout(1500);
  assert.equal(asked.length, before);
  await page.goBack();
  await house.waitForText(page, "#camera-status", /^(Found|Following)/);
  await page.getByRole("button", { name: "Stop the camera" }).click();
  await house.eventually(async () => assert.equal(await page.locator("#camera-frame").isVisible(), false));
  await page.getByRole("button", { name: "Start the camera" }).click();
  await house.waitForText(page, "#camera-status", /^(Found|Following)/);
  await house.closePage(page);
});

test("without a camera it is said why", async () => {
  const page = await house.openPage(server.address);
  const failing = async (name) => {
    await page.goto(`${server.address}/#/search`);
    await page.evaluate((one) => {
      navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException("no", one));
    }, name);
    await page.goto(`${server.address}/#/camera`);
  };
  await failing("NotAllowedError");
  await house.waitForText(page, "#camera-status.error", /does not allow this page to use the camera/);
  await house.checkAccessibility(page, "no camera");
  await failing("NotFoundError");
  await house.waitForText(page, "#camera-status.error", /has no camera/);
  await page.goto(`${server.address}/#/search`);
  await page.evaluate(() => Object.defineProperty(navigator, "mediaDevices", { value: undefined }));
  await page.goto(`${server.address}/#/camera`);
  await house.waitForText(page, "#camera-status.error", /only on pages over https/);
  await house.shoot(page, "camera-none");
  await house.closePage(page);
});
