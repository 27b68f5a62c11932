// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page in another language. Its table puts each sentence in brackets: what people see or hear without brackets is
// data, or a sentence that nobody can translate.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import * as house from "../house.mjs";
import { blobs } from "../images.mjs";
import { sentences } from "../texts.mjs";

const server = await house.server("texts");

// Data of this test, units, and words of other programs.
const kData = /\b(mug|cup|MUG|winter|png|file|x|Pliant|rootsift|default|plk_\w+|admin|read|write|s|ms|kB|MB|GB|B)\b|[a-z0-9]*\d[a-z0-9]*|Nov|Dez|Uhr/giu;

const bracketed = (value) => (typeof value === "object" ? Object.fromEntries(Object.entries(value).map(([form, text]) => [form, `⟦${text}⟧`])) : `⟦${value}⟧`);
const table = Object.fromEntries(Object.entries(sentences()).map(([key, value]) => [key, bracketed(value)]));

async function openTranslated(hash) {
  const page = await house.openPage(`${server.address}/livez`, { locale: "de-DE" });
  await page.route(/\/assets\/texts-de\.json$/, (route) => route.fulfill({ json: table }));
  await page.route(/\/$/, async (route) => {
    const page = readFileSync(new URL("../../../server/web/index.html", import.meta.url), "utf8");
    return route.fulfill({ response: await route.fetch(), body: page.replace('data-languages="en"', 'data-languages="en de"') });
  });
  await page.goto(`${server.address}/${hash}`);
  return page;
}

// Texts and attributes of elements that are shown.
const shownTexts = () => {
  const texts = [document.title];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_ELEMENT);
  for (let one = walker.currentNode; one; one = walker.nextNode()) {
    if (one.closest("script, noscript, code, #camera-body") || !(one.checkVisibility?.() ?? true)) continue;
    for (const child of one.childNodes) if (child.nodeType === 3) texts.push(child.data);
    for (const name of ["aria-label", "aria-roledescription", "placeholder", "title", "alt"]) texts.push(one.getAttribute(name) ?? "");
  }
  return texts;
};

async function check(page, where) {
  await house.eventually(async () => {
    const bare = [];
    for (const text of await page.evaluate(shownTexts)) {
      let rest = text;
      for (let before = null; before !== rest;) [before, rest] = [rest, rest.replace(/⟦[^⟦⟧]*⟧/g, "")];
      if (/\p{L}/u.test(rest.replace(kData, ""))) bare.push(text);
    }
    assert.deepEqual(bare, [], where);
  });
}

async function put(id, object, collection = "default") {
  const query = new URLSearchParams({ object, metadata: '{"x": 1}' });
  const answer = await fetch(`${server.address}/v1/collections/${collection}/images/${id}?${query}`, {
    method: "PUT", headers: { "Content-Type": "image/png" }, body: blobs(id.charCodeAt(0)) });
  assert.ok(answer.ok, await answer.text());
}

test("every sentence of the page comes from the table of its language", async () => {
  const page = await openTranslated("#/search");
  await page.locator("#welcome").waitFor();
  assert.equal(await page.evaluate(() => document.documentElement.lang), "de");
  await check(page, "an empty collection");
  await fetch(`${server.address}/v1/collections/winter`, { method: "PUT" });
  await put("c1", "mug");
  await put("a1", "cup");

  await page.goto(`${server.address}/#/add`);
  await page.locator("#add-files").setInputFiles([{ name: "11.png", mimeType: "image/png", buffer: blobs(7) },
                                                  { name: "22.png", mimeType: "image/png", buffer: Buffer.from("none") }]);
  await check(page, "images to add");
  await page.locator("#add-start").click();
  await house.waitForText(page, "#add-status", /⟦Finished/);
  await check(page, "added images");

  for (const view of ["objects", "images"]) {
    await page.goto(`${server.address}/#/${view}`);
    await page.locator(`#${view}-list .card`).first().waitFor();
    await check(page, view);
    await page.locator(`#${view}-list .card button`).first().click();
    await page.locator("form.edit").waitFor();
    await check(page, `${view}, a form`);
    await page.keyboard.press("Escape");
    await page.locator(`#${view}-bar > button`).click();
    await page.locator(".pick:visible").first().check();
    for (const button of await page.locator(`#view-${view} .selection .row > button`).all()) {
      if (!/…/.test(await button.innerText())) continue;
      await button.click();
      await page.locator(`#view-${view} .selection form`).waitFor();
      await check(page, `${view}, ${await button.innerText()}`);
    }
  }
  await page.goto(`${server.address}/#/object?name=mug`);
  await page.locator("#object-edit, #object-actions a").first().waitFor();
  await check(page, "an object");
  await page.locator("#object-actions button").first().click();
  await page.locator("#object-edit input").fill("MUG");
  await page.keyboard.press("Enter");
  await page.locator(".notice").waitFor();
  await check(page, "a notice");
  await page.goto(`${server.address}/#/image?id=c1`);
  await page.locator("#image-facts div").first().waitFor();
  await check(page, "an image");
  await page.goto(`${server.address}/#/search?image=c1`);
  await page.locator("#results .hit, #weaker-toggle").first().waitFor();
  await check(page, "an answer");
  for (const view of ["collection", "status", "keys"]) {
    await page.goto(`${server.address}/#/${view}`);
    await page.locator(`#view-${view} h1`).waitFor();
    await page.waitForLoadState("networkidle");
    for (const details of await page.locator(`#view-${view} summary`).all()) await details.click();
    await check(page, view);
  }
  await house.shoot(page, "translated");
  await house.closePage(page);
});

test("the sentences are English for everyone whose language is missing", async () => {
  const page = await house.openPage(`${server.address}/#/search`, { locale: "fr-FR" });
  assert.equal(await page.locator("#search-title").innerText(), "Which object is this?");
  assert.equal(await page.evaluate(() => document.documentElement.lang), "en");
  await house.closePage(page);
});

test("a translation has the forms of numbers, and its own order of values", async () => {
  const page = await openTranslated("#/search");
  await page.route(/\/assets\/texts-de\.json$/, (route) => route.fulfill({ json: {
    "{} images": { one: "{} Bild", other: "{} Bilder" }, "Delete the image {} of {}": "{2}: Bild {1} löschen" } }));
  await page.reload();
  const said = await page.evaluate(async () => {
    const { plural, t } = await import("/assets/texts.js");
    return [plural(1, "1", "image", "images"), plural(3, "3", "image", "images"), t`Delete the image ${"a"} of ${"{1}"}`, t`Not ${1} there`];
  });
  assert.deepEqual(said, ["1 Bild", "3 Bilder", "{1}: Bild a löschen", "Not 1 there"]);
  await house.closePage(page);
});

// What the walk above does not reach: the words of failures, of the self-test and of long uploads.
test("no sentence stands in the code without its mark", () => {
  const web = new URL("../../../server/web/", import.meta.url);
  const bare = [];
  for (const name of readdirSync(web)) {
    if (!/^(?!docs|camera|texts).*\.js$/.test(name)) continue;
    const code = readFileSync(new URL(name, web), "utf8").replace(/(^|\s)\/\/.*$/gm, "");
    for (const [found] of code.matchAll(/(?<![\w])(?:"[A-Z][a-z]+[ .…!?][^"]*"|`[A-Z][a-z]+[ .…!?][^`]*`|"[a-z]+ [a-z]+ [a-z ]+")/g)) {
      if (!/^"(system volume|Photo )|^`(Bearer|Photo|Pliant) |^"Stopped\."|createElement/.test(found)) bare.push(`${name}: ${found}`);
    }
  }
  assert.deepEqual(bare, []);
});
