// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page below a path, behind nginx as server/PROXY.md sets it up: nothing asks above the path.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import * as house from "../house.mjs";

const kNginx = "/usr/sbin/nginx";
const skip = existsSync(kNginx) ? false : "nginx is not installed (apt-get install nginx)";

const freePort = () => new Promise((done) => {
  const one = createServer().listen(0, "127.0.0.1", () => { const { port } = one.address(); one.close(() => done(port)); });
});

// nginx before a server: what ends it.
async function startNginx(address, port) {
  const folder = mkdtempSync(join(tmpdir(), "pliant-nginx-"));
  const page = readFileSync(new URL("../../../server/PROXY.md", import.meta.url), "utf8");
  const place = /^ +location \/pliant\/ \{[^}]*\}/m.exec(page)[0].replace("http://127.0.0.1:8080", address);
  const temporary = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"].map((kind) => `${kind}_temp_path ${folder}/${kind};`);
  writeFileSync(join(folder, "nginx.conf"), `daemon off; master_process off; pid ${folder}/pid; error_log stderr; events {}
http { access_log off; ${temporary.join(" ")} server { listen 127.0.0.1:${port};\n${place} } }`);
  const program = spawn(kNginx, ["-e", "stderr", "-p", folder, "-c", join(folder, "nginx.conf")]);
  let said = "";
  program.stderr.on("data", (text) => { said += text; });
  const ended = new Promise((end) => program.once("exit", end));
  after(async () => {
    program.kill("SIGTERM");
    await ended;
    rmSync(folder, { recursive: true, force: true });
  });
  await house.eventually(async () => {
    assert.equal(program.exitCode, null, said);
    assert.equal((await fetch(`http://127.0.0.1:${port}/pliant/livez`)).status, 200);
  });
}

test("the page works below a path", { skip }, async () => {
  const own = await house.startServer("--trusted-proxies", "127.0.0.1");  // nginx names the path
  const port = await freePort();
  await startNginx(own.address, port);
  const site = `http://127.0.0.1:${port}`;
  const above = [];
  const page = await house.openPage(`${site}/pliant`);
  page.on("response", (response) => {
    const { pathname, protocol } = new URL(response.url());
    if (protocol === "http:" && (!pathname.startsWith("/pliant/") || response.status() >= 400)) above.push(`${response.status()} ${pathname}`);
  });
  assert.equal(page.url().replace(/#.*/, ""), `${site}/pliant/`);
  await page.locator("#demo-load").click();
  await page.locator("#examples-list button").first().waitFor();
  await page.waitForFunction(() => [...document.querySelectorAll("#examples-list img")].every((one) => one.naturalWidth > 10));
  await page.locator("#examples-list button").first().click();
  assert.ok((await house.hitNames(page)).length > 0);
  await page.getByRole("link", { name: "Browse" }).click();
  await page.waitForFunction(() => document.querySelector("#objects-list img")?.naturalWidth > 10);
  await house.shoot(page, "proxy-objects");
  await page.goto(`${site}/pliant/#/image?id=demo-poster`);
  await page.waitForFunction(() => [...document.querySelectorAll("#view-image img")].some((one) => one.naturalWidth > 10));
  await page.getByRole("link", { name: "Collection" }).click();
  await page.locator("summary", { hasText: "Advanced" }).click();
  await house.waitForText(page, "#recommendation", /The vocabulary fits/);
  await page.getByRole("link", { name: "Server status" }).click();
  await page.locator("#view-status").waitFor();
  await page.getByRole("link", { name: "HTTP API" }).click();
  const list = page.locator("#images\\.list");
  await list.locator("summary").first().click();
  await list.getByRole("button", { name: "Send GET" }).click();
  await house.waitForText(page, "#images\\.list .result", /^200[^]*"demo-poster"/);
  assert.match(await list.locator(".try > pre").innerText(), /\/pliant\/v1\/collections\/default\/images/);
  await page.locator("a.brand").click();
  await page.waitForURL(`${site}/pliant/**`);
  await page.locator("#examples-list button").first().waitFor();
  assert.deepEqual(above, []);
  await house.closePage(page);
  await own.stop();
});
