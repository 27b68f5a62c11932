// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The state of the server, and how its metrics are read.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");

test("what the server holds and does is shown, and follows it", async () => {
  await house.loadDemonstration(server.address);
  const page = await house.openPage(server.address);
  await page.getByRole("link", { name: "Server status" }).click();
  await house.waitForText(page, "#status-ready", /^Ready$/);
  await house.waitForText(page, "#status-facts", /Images\s+6\s+Objects\s+6/);
  const facts = await house.text(page, "#status-facts");
  for (const pattern of [/Database\s+[\d.]+ [kM]B\s+[\d.,]+ [GMk]B of disk space free/, /Memory\s+\d+ MB/, /Requests\s+[\d.]+ per second/, /Waiting\s+0/, /Busy cores\s+\d/]) {
    assert.match(facts, pattern);
  }
  await house.waitForText(page, "#status-jobs", /Loading demonstration objects\s*done/);
  const before = /([\d,]+) in total/.exec(facts)[1];
  await page.waitForFunction((was) => !document.querySelector("#status-facts").innerText.includes(`${was} in total`), before);
  await house.checkAccessibility(page, "status");
  await house.shoot(page, "status");
  await house.closePage(page);
});

test("a server that is not ready, or gone, is said to be so", async () => {
  const page = await house.openPage("about:blank");
  page.faults.length = 0;
  await page.route("**/readyz", (route) => route.fulfill({
    status: 503, contentType: "application/problem+json", body: JSON.stringify({ code: "starting", progress: 0.42 }) }));
  await page.goto(`${server.address}/#/status`);
  await house.waitForText(page, "#status-ready", /Starting: 42 %/);
  await page.unroute("**/readyz");
  await house.waitForText(page, "#status-ready", /^Ready$/);
  await page.route("**/readyz", (route) => route.abort());
  await house.waitForText(page, "#status-status.error", /cannot be reached/);
  await page.context().close();
});

test("metrics are read as Prometheus writes them", async () => {
  const page = await house.openPage(server.address);
  const read = await page.evaluate(async () => {
    const { parseMetrics, total } = await import("/assets/status.js");
    const text = `# HELP a_total Things\n# TYPE a_total counter\na_total{route="x",status="200"} 3\na_total{route="y",status="500"} 4\nodd{s="a \\"b\\" \\\\n\\nc"} 1e3\nbare 2.5 1700000000\nmost +Inf\n`;
    const samples = parseMetrics(text);
    return [total(samples, "a_total"), total(samples, "a_total", { status: /^5/ }), total(samples, "none"), samples[2].labels.s,
            total(samples, "bare"), total(samples, "most") === Infinity];
  });
  assert.deepEqual(read, [7, 4, null, 'a "b" \\n\nc', 2.5, true]);
  await house.closePage(page);
});
