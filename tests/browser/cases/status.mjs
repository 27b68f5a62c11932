// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How the server is doing, and how its metrics are read.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");

test("what the server holds and does is shown, and follows it", async () => {
  await house.loadDemonstration(server.address);
  const page = await house.openPage(server.address);
  await page.getByRole("link", { name: "Status of the server" }).click();
  await house.waitForText(page, "#status-ready", /^Ready$/);
  await house.waitForText(page, "#status-facts", /Pictures\s+6\s+Objects\s+6/);
  const facts = await house.text(page, "#status-facts");
  for (const pattern of [/Database\s+[\d.]+ [kM]B\s+[\d.,]+ [GMk]B free/, /Memory\s+\d+ MB/, /Requests\s+[\d.]+ a second/, /Waiting\s+0/, /Busy cores\s+\d/]) {
    assert.match(facts, pattern);
  }
  await house.waitForText(page, "#status-collections", /default\s+6\s+6/);
  await house.waitForText(page, "#status-jobs", /Loading demonstration objects\s*done/);
  const before = /([\d,]+) in all/.exec(facts)[1];
  await page.waitForFunction((was) => !document.querySelector("#status-facts").innerText.includes(`${was} in all`), before);
  await page.waitForFunction(() => document.querySelector(".curve polyline").getAttribute("points").split(" ").length > 2);
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
    const { parseMetrics, quantile, total } = await import("/assets/metrics.js");
    const text = `# HELP a_total Things\n# TYPE a_total counter\na_total{route="x",status="200"} 3\na_total{route="y",status="500"} 4\nodd{s="a \\"b\\" \\\\n\\nc"} 1e3\nbare 2.5 1700000000\n` +
      'h_bucket{le="0.1"} 10\nh_bucket{le="1"} 30\nh_bucket{le="+Inf"} 40\nh_sum 9\nh_count 40\n';
    const samples = parseMetrics(text);
    return [total(samples, "a_total"), total(samples, "a_total", { status: /^5/ }), total(samples, "none"), samples[2].labels.s,
            total(samples, "bare"), quantile(samples, "h", {}, 0.25), quantile(samples, "h", {}, 0.5), quantile(samples, "h", {}, 0.99), quantile(samples, "none", {}, 0.5)];
  });
  assert.deepEqual(read.slice(0, 6), [7, 4, null, 'a "b" \\n\nc', 2.5, 0.1]);
  assert.ok(Math.abs(read[6] - 0.55) < 1e-9, String(read[6]));
  assert.deepEqual(read.slice(7), [1, null]);
  await house.closePage(page);
});
