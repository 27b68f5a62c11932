// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is dropped and pasted: addresses, data, images of the page itself, and kinds of files.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { test } from "node:test";
import * as house from "../house.mjs";
import { thing, thingGif } from "../images.mjs";

const server = await house.server("incoming");
const base = `${server.address}/v1/collections/default`;
// Of thing(601), by avifenc --min 20 --max 30 and heif-enc -q 50.
const avif = readFileSync(new URL("../thing_601.avif", import.meta.url));
const heic = readFileSync(new URL("../thing_601.heic", import.meta.url));

let ready = null;
const prepare = () => (ready ??= (async () => {
  for (const [id, seed] of [["one", 601], ["two", 602], ["three", 603]]) {
    const answer = await fetch(`${base}/images/${id}?object=${id}`, {
      method: "PUT", headers: { "Content-Type": "image/png" }, body: thing(seed) });
    assert.ok(answer.ok);
  }
})());

// Drops or pastes what has these types, as another page's image or a clipboard would.
const give = (page, kind, selector, types) => page.evaluate(([how, where, list]) => {
  const transfer = new DataTransfer();
  for (const [type, text] of Object.entries(list)) transfer.setData(type, text);
  document.querySelector(where).dispatchEvent(how === "paste" ?
    new ClipboardEvent("paste", { clipboardData: transfer, bubbles: true }) :
    new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, [kind, selector, types]);

const dataUrl = (bytes, type) => `data:${type};base64,${bytes.toString("base64")}`;

test("an address of an image elsewhere is said not to be enough, and nothing is fetched", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await house.waitForText(page, "#search-status", /in this collection/);
  const address = "https://images.example/mug.jpg";
  await give(page, "drop", "#search-drop", { "text/uri-list": address, "text/html": `<img src="${address}">` });
  await house.waitForText(page, "#search-status.error", /gave only the address of this image[^]*paste it here, or save it/);
  await house.checkAccessibility(page, "an address");
  await house.shoot(page, "address-only");
  await page.reload();
  await house.waitForText(page, "#search-status", /in this collection/);
  await give(page, "paste", "body", { "text/plain": address });
  await house.waitForText(page, "#search-status.error", /only the address/);
  await give(page, "paste", "body", { "text/plain": "some words" });
  await house.waitForText(page, "#search-status.error", /no image in what you pasted/);
  await page.goto(`${server.address}/#/add`);
  await give(page, "drop", "#add-drop", { "text/uri-list": address });
  await house.waitForText(page, "#notices", /only the address/);
  await house.closePage(page);  // which checks that nothing was asked for elsewhere
});

test("where the server fetches images, an address is enough: to search, after Reload, and to add", async () => {
  const elsewhere = createServer((request, answer) => {
    const seed = /(\d+)/.exec(request.url)?.[1];
    answer.writeHead(seed ? 200 : 404).end(seed && thing(Number(seed)));
  });
  await new Promise((ready) => elsewhere.listen(0, "127.0.0.1", ready));
  const host = `127.0.0.1:${elsewhere.address().port}`;
  const fetching = await house.startServer("--fetch-hosts", host, "--fetch-private", "true");
  for (const [id, seed] of [["one", 601], ["two", 602], ["three", 603]]) {
    const put = await fetch(`${fetching.address}/v1/collections/default/images/${id}?object=${id}`, {
      method: "PUT", headers: { "Content-Type": "image/png" }, body: thing(seed) });
    assert.ok(put.ok);
  }
  const page = await house.openPage(fetching.address);
  await house.waitForText(page, "#search-status", /in this collection/);
  const address = `http://${host}/shop/601.png`;
  await give(page, "drop", "#search-drop", { "text/uri-list": address, "text/html": `<img src="${address}">` });
  await house.waitForText(page, "#search-status", /^Found: one/);
  assert.equal(new URLSearchParams(new URL(page.url()).hash.split("?")[1]).get("url"), address);
  await house.checkAccessibility(page, "an image that the server has fetched");
  await house.shoot(page, "fetched");
  await page.reload();
  await house.waitForText(page, "#search-status", /^Found: one/);
  await give(page, "paste", "body", { "text/plain": `http://${host}/602.png` });
  await house.waitForText(page, "#search-status", /^Found: two/);
  await give(page, "paste", "body", { "text/plain": `http://${host}/none.png` });
  await house.waitForText(page, "#search-status.error", /answered with status 404/);
  await give(page, "paste", "body", { "text/plain": "https://other.example/mug.png" });
  await house.waitForText(page, "#search-status.error", /does not fetch from this host/);

  await page.goto(`${fetching.address}/#/add`);
  await give(page, "drop", "#add-drop", { "text/uri-list": `http://${host}/tea%20cup%20604.png?size=9` });
  await give(page, "drop", "#add-drop", { "text/uri-list": `http://${host}/gone.png` });
  assert.equal(await page.locator("#add-list input").first().inputValue(), "tea cup 604");
  await page.getByRole("button", { name: "Add 2 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 1 image added, 1 failed/);
  const { images } = await (await fetch(`${fetching.address}/v1/collections/default/images?object=tea%20cup%20604`)).json();
  assert.equal(images[0].source, `http://${host}/tea%20cup%20604.png`);
  await house.closePage(page);
  await fetching.stop();
  elsewhere.close();
});

test("data in place of an address are an image; one of the page's own is searched with as it is stored", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await give(page, "drop", "#search-drop", { "text/html": `<p><img src="${dataUrl(thing(601), "image/png")}"></p>` });
  await house.waitForText(page, "#search-status", /^Found: one/);
  await give(page, "drop", "#search-drop", { "text/uri-list": `${base}/images/two/thumbnail` });
  await page.waitForFunction(() => location.hash === "#/search?image=two");
  await give(page, "drop", "#search-drop", { "text/uri-list": `${server.address}/#/image?id=three` });
  await page.waitForFunction(() => location.hash === "#/search?image=three");
  const files = (address) => page.evaluate(async (one) => {
    const { fileOfData } = await import("/assets/incoming.js");
    const file = fileOfData(one);
    return file && [file.name, file.type, file.size];
  }, address);
  assert.deepEqual(await files("data:image/png;base64,AAECAw=="), ["image.png", "image/png", 4]);
  assert.deepEqual(await files("data:image/svg+xml;charset=utf-8,%3Csvg/%3E"), ["image.svg", "image/svg+xml", 6]);
  for (const none of ["data:text/plain,x", "data:image/png;base64,???", "https://x.example/y.png"]) {
    assert.equal(await files(none), null, none);
  }
  await house.closePage(page);
});

test("an address that was just chosen is not lost to the search before it", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  const searched = (id, act) => Promise.all([
    page.waitForRequest((one) => one.url().endsWith("/search") && one.postDataJSON()?.image_id === id), act()]);
  await searched("two", () => page.evaluate(() => { location.hash = "#/search?image=two"; }));
  // The search of "two" notes its address before the page has heard of the next one.
  await searched("three", () => page.evaluate(async () => {
    const { noteAddress } = await import("/assets/router.js");
    location.hash = "#/search?image=three";
    noteAddress("#/search?image=two");
  }));
  assert.equal(await page.evaluate(() => location.hash), "#/search?image=three");
  await searched("two", () => page.goBack());
  await house.closePage(page);
});

test("of two images that are dropped one after the other the second is searched with, however long the first takes", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await house.waitForText(page, "#search-status", /in this collection/);
  const searches = [];
  page.on("request", (one) => { if (one.url().endsWith("/search")) searches.push(one.url()); });
  await page.evaluate((files) => {
    for (const [name, type, text] of files) {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], name, { type }));
      document.querySelector("#search-drop").dispatchEvent(
        new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
    }
  }, [["slow.gif", "image/gif", thingGif(602).toString("base64")], ["mine.png", "image/png", thing(601).toString("base64")]]);
  await house.waitForText(page, "#search-status", /^Found: one/);
  assert.equal(searches.length, 1);
  await house.closePage(page);
});

test("who goes to another view while an image is read stays there", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await house.waitForText(page, "#search-status", /in this collection/);
  await page.evaluate(async (text) => {
    const { keepQuery } = await import("/assets/kept.js");
    const file = () => new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], "slow.gif", { type: "image/gif" });
    const transfer = new DataTransfer();
    transfer.items.add(file());
    document.querySelector("#search-drop").dispatchEvent(
      new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
    location.hash = "#/objects";
    for (let i = 0; i < 3; ++i) await keepQuery(file());  // by then the one that was dropped is read
  }, thingGif(602).toString("base64"));
  assert.equal(await page.evaluate(() => location.hash), "#/objects");
  assert.equal(await page.locator("#view-objects").isVisible(), true);
  await house.closePage(page);
});

test("an image that is given as soon as the search view is asked for is searched with", async () => {
  await prepare();
  const page = await house.openPage(`${server.address}/#/objects`);
  await page.locator("#objects-list .card").first().waitFor();
  await page.evaluate((text) => {
    document.querySelector("nav [data-view=search]").click();
    const transfer = new DataTransfer();
    transfer.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], "mine.png", { type: "image/png" }));
    const input = document.querySelector("#search-file");
    input.files = transfer.files;
    input.dispatchEvent(new Event("change", { bubbles: true }));
  }, thing(601).toString("base64"));
  await house.waitForText(page, "#search-status", /^Found: one/);
  await house.closePage(page);
});

test("GIF, AVIF and HEIC are sent as they are; what is no photo is said with what to do", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  const search = (name, mimeType, buffer) => page.locator("#search-file").setInputFiles([{ name, mimeType, buffer }]);
  await search("new.avif", "image/avif", avif);
  await house.waitForText(page, "#search-status", /^Found: one/);
  await search("moving.gif", "image/gif", thingGif(602));
  await house.waitForText(page, "#search-status", /^Found: two/);
  await search("IMG_0001.HEIC", "image/heic", heic);
  await house.waitForText(page, "#search-status", /^Found: one/);
  await house.shoot(page, "heic");
  await search("film.mp4", "video/mp4", Buffer.from("\0\0\0\x18ftypisom\0\0\0\0isom", "latin1"));
  await house.waitForText(page, "#search-status.error", /A video is not a photo/);
  await search("text.pdf", "application/pdf", Buffer.from("%PDF-1.7 and so on"));
  await house.waitForText(page, "#search-status.error", /A PDF is a document/);
  await search("drawing.svg", "image/svg+xml", Buffer.from("<?xml version='1.0'?><svg xmlns='x'/>"));
  await house.waitForText(page, "#search-status.error", /drawing, not a photo/);

  await page.goto(`${server.address}/#/add`);
  await page.locator("#add-files").setInputFiles([
    { name: "cat.gif", mimeType: "image/gif", buffer: thingGif(610) },
    { name: "phone.heic", mimeType: "image/heic", buffer: heic }]);
  await page.getByRole("button", { name: "Add 2 images" }).click();
  await house.waitForText(page, "#add-status", /Finished: 2 images added/);
  for (const [object, type, source] of [["cat", "image/gif", "cat.gif"], ["phone", "image/heic", "phone.heic"]]) {
    const { images } = await (await fetch(`${base}/images?object=${object}`)).json();
    assert.deepEqual([images[0].media_type, images[0].source, images[0].width], [type, source, 320]);
  }
  await house.closePage(page);
});

// Drops image files of these seeds.
const dropImages = (page, selector, seeds) => page.evaluate(([where, list]) => {
  const transfer = new DataTransfer();
  for (const [name, text] of list) {
    transfer.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], name, { type: "image/png" }));
  }
  document.querySelector(where).dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, [selector, seeds.map((seed) => [`thing ${seed}.png`, thing(seed).toString("base64")])]);

test("of many images on the search page, all are added or the first is searched with, as people say", async () => {
  await prepare();
  const page = await house.openPage(server.address);
  await house.waitForText(page, "#search-status", /in this collection/);
  await dropImages(page, "#search-drop", [602, 621, 622]);
  await house.waitForText(page, "#many-dialog", /^You dropped 3 images\. Add all of them, or search with the first\?/);
  await house.checkAccessibility(page, "many images");
  await house.shoot(page, "many-images");
  await page.getByRole("button", { name: "Search with the first" }).click();
  await house.waitForText(page, "#search-status", /: two\./);
  await dropImages(page, "#search-drop", [602, 621, 622]);
  await page.locator("#many-dialog").waitFor();
  await page.keyboard.press("Escape");
  await page.locator("#many-dialog").waitFor({ state: "hidden" });
  assert.equal(await page.locator("#view-search").isVisible(), true);
  await dropImages(page, "#search-drop", [602, 621, 622]);
  await page.getByRole("button", { name: "Add all" }).click();
  await page.getByRole("button", { name: "Add 3 images" }).waitFor();
  assert.match(page.url(), /#\/add$/);
  await house.closePage(page);
});

test("readers search with the first of many images, and are told so; they add nothing elsewhere", async () => {
  await prepare();
  const page = await house.openPage("about:blank");
  await page.route("**/v1/me", async (route) => {
    const answer = await route.fetch();
    return route.fulfill({ response: answer, json: { ...await answer.json(), scopes: ["read"] } });
  });
  page.faults.length = 0;
  await page.goto(server.address);
  await dropImages(page, "#search-drop", [602, 621]);
  await house.waitForText(page, "#notices", /You dropped 2 images\. Pliant searches with the first, because your key does not allow adding/);
  await house.waitForText(page, "#search-status", /: two\./);
  await page.goto(`${server.address}/#/objects`);
  await page.locator("#objects-list .card").first().waitFor();
  await dropImages(page, "#view-objects", [621]);
  await house.waitForText(page, "#notices", /search but not add/);
  assert.equal(await page.locator("#view-objects").isVisible(), true);
  await page.context().close();
});

test("many images are listed to be added in an empty collection, and on the pages of objects, images and the collection", async () => {
  const empty = await house.server("empty");
  const page = await house.openPage(empty.address);
  await page.locator("#welcome").waitFor();
  await dropImages(page, "#welcome", [621, 622]);
  await page.getByRole("button", { name: "Add 2 images" }).waitFor();
  await house.closePage(page);

  await prepare();
  for (const [hash, sign] of [["objects", "#objects-list .card"], ["images", "#images-list .card"], ["object?name=one", "#object-list .card"],
                              ["image?id=one", "#image-facts div"], ["collection", "#collection-facts div"]]) {
    const other = await house.openPage(`${server.address}/#/${hash}`);
    await other.locator(sign).first().waitFor();
    await dropImages(other, sign, [621, 622]);
    await other.getByRole("button", { name: "Add 2 images" }).waitFor();
    await house.closePage(other);
  }
});

test("what is no photo is told by its first bytes", async () => {
  const page = await house.openPage(server.address);
  const advice = await page.evaluate(async () => {
    const { adviceFor } = await import("/assets/incoming.js");
    const bytes = (text) => Uint8Array.from(text, (c) => c.charCodeAt(0));
    return ["\xff\xd8\xff\xe0", "II*\0", "\0\0\0\x20ftypavif\0\0\0\0avifmif1miaf", "\0\0\0\x18ftypmif1\0\0\0\0mif1heic", "words", "",
            "%PDF-1", "\0\0\0\x14ftypqt  ", "\0\0\0\x18ftypisom\0\0\x02\0isomiso2", "\x1aE\xdf\xa3", "<svg>"]
      .map((text) => adviceFor(bytes(text))?.split(" ")[1] ?? "photo");
  });
  assert.deepEqual(advice, ["photo", "photo", "photo", "photo", "photo", "photo", "PDF", "video", "video", "video", "SVG"]);
  await house.closePage(page);
});
