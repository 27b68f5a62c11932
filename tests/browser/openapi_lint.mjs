// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// openapi_lint.mjs BIN: what the rules of `redocly lint` (the recommended ones, and that every tag has a description) say of the OpenAPI
// document of BIN/pliant-server. Exit status 77: the npm packages are not installed.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

let redocly;
try {
  redocly = await import("@redocly/openapi-core");
} catch (error) {
  if (error.code !== "ERR_MODULE_NOT_FOUND") throw error;
  console.log("skipped: the npm package @redocly/openapi-core is not installed (bash tests/browser/install.sh)");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pliant-openapi-"));
const server = spawn(join(process.argv[2], "pliant-server"),
                     ["--db", join(folder, "test.db"), "--descriptor", "rootsift", "--listen", "127.0.0.1:0"],
                     { stdio: ["ignore", "pipe", "inherit"] });
let failed = false;
try {
  let address = "";
  for await (const line of createInterface({ input: server.stdout })) {
    address = /listening on (\S+)/.exec(line)?.[1] ?? "";
    if (address) break;
  }
  if (!address) throw new Error("the server did not start");
  const answer = await fetch(`${address}/v1/openapi.json`);
  const source = await answer.text();
  const config = await redocly.createConfig({
    extends: ["recommended"],
    rules: { "tag-description": "error", "operation-tag-defined": "error", "operation-singular-tag": "error",
             "security-defined": "error", "no-unused-components": "error",
             // images:import stands beside images/{id}; the router takes them apart by their segments
             "no-ambiguous-paths": "off" } });
  const problems = await redocly.lintFromString({ source, absoluteRef: `${address}/v1/openapi.json`, config });
  for (const problem of problems) {
    console.log(`${problem.severity} ${problem.ruleId}: ${problem.message} ${problem.location[0]?.pointer ?? ""}`);
  }
  const operations = Object.values(JSON.parse(source).paths).flatMap((path) => Object.keys(path)).length;
  console.log(`${operations} operations, ${problems.length} problems`);
  failed = problems.length > 0 || operations < 30;
} finally {
  server.kill("SIGTERM");
  rmSync(folder, { recursive: true, force: true });
}
process.exit(failed ? 1 : 0);
