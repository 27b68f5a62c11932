// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The page's own arithmetic and words, called in the page.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as house from "../house.mjs";

const server = await house.server("demonstration");

// As the server judges a hit.
const verdictOf = (probability) => (probability >= 0.9 ? "found" : probability >= 0.2 ? "perhaps" : "unlikely");

// Calls an exported function of a module of the page.
async function withModules(use) {
  const page = await house.openPage(server.address);
  const call = (module, name, ...given) => page.evaluate(async ([from, which, list]) => {
    const loaded = await import(`/assets/${from}`);
    try {
      return { value: loaded[which](...list) };
    } catch (error) {
      return { error: error.message };
    }
  }, [module, name, given]);
  await use(call);
  await house.closePage(page);
}

test("an affine map takes corner to corner", () => withModules(async (call) => {
  const from = [[1, 2], [11, 3], [4, 9]];
  const to = [[-3, 5], [8, 40], [0.5, -7]];
  const [a, b, c, d, e, f] = (await call("compare.js", "affine", from, to)).value;
  for (const [i, [x, y]] of from.entries()) {
    assert.ok(Math.hypot(a * x + c * y + e - to[i][0], b * x + d * y + f - to[i][1]) < 1e-9);
  }
  const line = [[0, 0], [1, 1], [2, 2]];
  assert.equal((await call("compare.js", "affine", line, to)).value, null);
}));

test("a mesh is cut into triangles; those with a corner that is not trusted are left out",
     () => withModules(async (call) => {
  const mesh = { columns: 3, rows: 2, reference_width: 21, reference_height: 11,
                 points: [[0, 0], [5, 0], [9, 1], [0, 4], [5, 5], [9, 6]] };
  const all = (await call("compare.js", "triangles", mesh)).value;
  assert.equal(all.length, 4);
  assert.deepEqual(all[0], { reference: [[0, 0], [10, 0], [10, 10]], query: [[0, 0], [5, 0], [5, 5]] });
  const area = ([[x0, y0], [x1, y1], [x2, y2]]) => ((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / 2;
  assert.equal(all.reduce((sum, one) => sum + area(one.reference), 0), 20 * 10);
  const some = (await call("compare.js", "triangles",
                           { ...mesh, trusted: [true, true, false, true, true, true] })).value;
  assert.equal(some.length, 3);
}));

// The query says by its colours where each pixel is; the mesh bends it by a known function.
test("flattening puts every pixel where the mesh says", async () => {
  const page = await house.openPage(server.address);
  const worst = await page.evaluate(async () => {
    const { drawFlattened } = await import("/assets/compare.js");
    const query = new OffscreenCanvas(256, 256);
    const paint = query.getContext("2d");
    const pixels = paint.createImageData(256, 256);
    for (let i = 0; i < 256 * 256; ++i) pixels.data.set([i % 256, Math.floor(i / 256), 0, 255], 4 * i);
    paint.putImageData(pixels, 0, 0);
    const bend = (x, y) => [30 + 0.9 * x + 12 * Math.sin(y / 40), 20 + 0.8 * y + 10 * Math.sin(x / 50)];
    const mesh = { columns: 21, rows: 21, reference_width: 201, reference_height: 201, points: [] };
    for (let r = 0; r < 21; ++r) for (let c = 0; c < 21; ++c) mesh.points.push(bend(10 * c, 10 * r));
    const flat = new OffscreenCanvas(402, 402);  // twice the reference's size
    const context = flat.getContext("2d");
    drawFlattened(context, query, 256, mesh, 2);
    const { data } = context.getImageData(0, 0, 402, 402);
    let off = 0;
    for (let y = 4; y < 197; y += 3) {
      for (let x = 4; x < 197; x += 3) {
        const i = 4 * ((2 * y + 1) * 402 + 2 * x + 1);
        const [u, v] = bend(x + 0.25, y + 0.25);  // the canvas pixel's centre
        off = Math.max(off, Math.abs(data[i] - u), Math.abs(data[i + 1] - v), 255 - data[i + 3]);
      }
    }
    return off;
  });
  assert.ok(worst < 1.5, `${worst} pixels off`);
  await house.closePage(page);
});

test("no ground shines through between the triangles, also of a photo that is larger than the canvas", async () => {
  const page = await house.openPage(server.address);
  for (const side of [256, 2048]) {
    const seams = await page.evaluate(async (side) => {
      const { drawFlattened } = await import("/assets/compare.js");
      const query = new OffscreenCanvas(side, side);
      query.getContext("2d").fillRect(0, 0, side, side);
      const mesh = { columns: 21, rows: 11, reference_width: 201, reference_height: 201, points: [] };
      for (let r = 0; r < 11; ++r) for (let c = 0; c < 21; ++c) mesh.points.push([20 + 10 * c + r, 20 + 19 * r + c]);
      const flat = document.createElement("canvas");  // those off the screen have sharp edges
      flat.width = flat.height = 321;
      const context = flat.getContext("2d");
      drawFlattened(context, query, 256, mesh, 1.6);
      const { data } = context.getImageData(1, 1, 318, 318);
      return data.filter((value, i) => i % 4 === 3 && value < 255).length;
    }, side);
    assert.equal(seams, 0, `${side}`);
  }
  await house.closePage(page);
});

test("a convex hull holds every point and only points that were given", () => withModules(async (call) => {
  const points = Array.from({ length: 40 }, (_, i) => [(i * 37) % 101, (i * i * 13) % 89]);
  const hull = (await call("compare.js", "convexHull", points)).value;
  assert.ok(hull.length > 2);
  for (const [i, [x0, y0]] of hull.entries()) {
    const [x1, y1] = hull[(i + 1) % hull.length];
    assert.ok(points.some(([x, y]) => x === x0 && y === y0));
    for (const [x, y] of points) assert.ok((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0);
  }
}));

test("labels and conditions are read as they are typed", () => withModules(async (call) => {
  const labels = async (...given) => call("labels.js", "parseLabels", ...given);
  assert.deepEqual(await labels(" shelf = 4, colour=red,new=true , code=007 "),
                   { value: { shelf: 4, colour: "red", new: true, code: "007" } });
  assert.deepEqual(await labels(""), { value: null });
  assert.deepEqual(await labels("year>=2020, year<2024, name=x", true),
                   { value: { year: { gte: 2020, lt: 2024 }, name: "x" } });
  assert.match((await labels("red")).error, /"red" is not a label/);
  assert.match((await labels("=red")).error, /not a label/);
  assert.match((await labels("year>3")).error, /not a label/);
}));

test("an answer is said in a sentence", () => withModules(async (call) => {
  const hits = (...list) => list.map(([name, probability]) => ({ name, probability, score: 0.1, verdict: verdictOf(probability) }));
  const words = async (given) => (await call("words.js", "verdictWords", { found: null, ...given })).value;
  assert.equal(await words({ hits: hits(["mug", 0.95], ["tin", 0.3]), found: 1 }), "Found: mug.");
  assert.equal(await words({ hits: hits(["mug", 0.95]), found: 1, inPart: true }), "Found in this part: mug.");
  assert.equal(await words({ hits: hits(["a", 1], ["b", 0.99], ["c", 0.9], ["d", 0.91], ["e", 0.4]), found: 4 }),
               "4 objects found: a, b, c and d.");
  assert.equal(await words({ hits: hits(["a", 1], ["b", 1], ["c", 1], ["d", 1], ["e", 1]), found: 9 }),
               "9 objects found: a, b, c, d and 5 more.", "those on later pages count");
  assert.equal(await words({ hits: hits(["a", 1], ["a", 0.95]), found: 2 }), "Found: a.", "images of one object");
  const images = hits(["a", 1], ["a", 0.95], ["b", 0.95]);
  assert.equal(await words({ hits: hits(["a", 1], ["b", 1]), found: 9, grouped: false }),
               "2 or more objects found: a and b.", "nine images are of two objects at least");
  assert.equal(await words({ hits: images, found: 3, grouped: false }), "2 objects found: a and b.");
  assert.equal(await words({ hits: hits(["a", 1], ["a", 1]), found: 30, grouped: false }), "Found: a.");
  assert.equal(await words({ hits: hits(["mug", 0.5], ["tin", 0.4], ["cup", 0.02]), found: 0 }), "Perhaps: mug or tin.");
  assert.equal(await words({ hits: hits(["mug", 0.2]), found: 0 }), "Perhaps: mug.");
  assert.equal(await words({ hits: hits(["mug", 0.19]), found: 0 }), "Not found.");
  assert.equal(await words({ hits: hits(["mug", 0.19]), found: 0, stored: true }), "No other similar object found.");
  assert.equal(await words({ hits: [], found: 0, filtered: true }), "Not found with these filters.");
  const score = (value) => [{ name: "mug", probability: null, verdict: null, score: value }];
  assert.equal(await words({ hits: score(0.5) }), "Perhaps: mug.", "without probabilities nothing is sure");
  assert.equal(await words({ hits: score(0.19) }), "Not found.");
  const advice = async (given) => (await call("words.js", "adviceWords", given)).value;
  assert.match(await advice({ hits: hits(["mug", 0.89]) }), /select the part/);
  assert.match(await advice({ hits: [] }), /select the part/);
  for (const given of [{ hits: hits(["mug", 0.9]) }, { hits: [], inPart: true }, { hits: [], stored: true }]) {
    assert.equal(await advice(given), "");
  }
}));

test("a problem is said once, with when to try again, and not blamed on the key", () => withModules(async (call) => {
  const words = async (status, code, retry) => (await call("words.js", "problemWords", status, { code, detail: "Try again later." }, retry)).value;
  assert.equal(await words(503, "starting", 5), "The server is loading its index. Try again in 5 s.");
  assert.equal(await words(503, "busy", 2), "The server is busy. Try again in 2 s.");
  assert.match(await words(403, "forbidden", 0), /key/);
  assert.doesNotMatch(await words(403, "cross_site", 0), /key/);
}));

test("names are made of folders and files, and of the time where those say nothing", () => withModules(async (call) => {
  const name = async (...given) => (await call("names.js", "defaultName", ...given)).value;
  const file = (own) => ({ name: own, lastModified: 0 });
  assert.deepEqual([await name(file("red scarf.jpg")), await name(file("a.b.tiff")), await name(file(".jpg")),
                    await name(file("x.jpg"), "lamp"), await name(file("caf\u0065\u0301\u202e.png"))],
                   ["red scarf", "a.b", ".jpg", "lamp", "caf\u00e9"]);
  const made = await name(file("image.png"));
  assert.match(made, /^Photo (1969|1970)-/);
  assert.equal(await name(file("IMG_1234.png"), "", [made]), `${made} (2)`);
  for (const camera of ["IMG_1234", "IMG_E1234", "DSC00123", "_DSC0123", "DSCN0123", "PXL_20231128_101112345", "PXL_20231128_101112345.MP", "20231128_101112",
                        "2023-11-28 10.11.12", "IMG-20231128-WA0001", "WhatsApp Image 2023-11-28 at 10.11.12 (1)", "Screenshot_20231128-101112",
                        "photo_2023-11-28_10-11-12", "GOPR0123", "DJI_0012", "image (2)", "image0"]) {
    assert.match(await name(file(`${camera}.jpg`)), /^Photo /, camera);
  }
  for (const own of ["1015", "1015 (2)", "4006381333931", "978-3-16-148410-0", "20231128", "12.5 cm", "A1015", "Sam", "Sam 2", "capture the flag", "e1"]) {
    assert.equal(await name(file(`${own}.jpg`)), own);
  }
}));

test("the time that is left is said in minutes and hours", () => withModules(async (call) => {
  const words = async (minutes) => (await call("add.js", "timeWords", 60_000 * minutes)).value;
  assert.deepEqual([await words(0.2), await words(1), await words(12.4), await words(150)],
                   ["less than a minute left", "about 1 minute left", "about 12 minutes left", "about 3 hours left"]);
}));

test("names with numbers are in natural order", () => withModules(async (call) => {
  assert.ok((await call("names.js", "inNaturalOrder", "box (2)", "box (10)")).value < 0);
  assert.ok((await call("names.js", "inNaturalOrder", "box 10", "box 9")).value > 0);
}));

test("collections have names for addresses, whatever people call them", () => withModules(async (call) => {
  const made = async (...given) => (await call("names.js", "collectionNameFor", ...given)).value;
  assert.deepEqual([await made("attic"), await made("Summer shirts 2026!"), await made("Été à Łódź"), await made("夏"), await made("..")],
                   ["attic", "summer-shirts-2026", "ete-a-odz", "collection", "collection"]);
  assert.equal(await made("Été!", ["ete", "ete-2"]), "ete-3");
  assert.match(await made("x ".repeat(60)), /^[a-z-]{1,64}$/);
}));

// Joiners stay where writing needs them: after a letter of Persian or Hindi, and in emoji.
test("names that the page proposes are such that the server takes", () => withModules(async (call) => {
  const proposed = async (stem) => (await call("names.js", "defaultName", { name: `${stem}.png`, lastModified: 0 })).value;
  const statusOf = async (object) => (await fetch(`${server.address}/v1/collections/default/objects/none`, {
    method: "PATCH", headers: { "Content-Type": "application/merge-patch+json" }, body: JSON.stringify({ object }) })).status;
  const persian = "\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645";
  const family = "\u{1f468}\u200d\u{1f469}";
  for (const [stem, name] of [
    ["tag\u{e0041}\u{10ffff}ged", "tagged"], ["la\u200cmp\u200d", "lamp"], ["half\ud800 one", "half one"],
    [persian, persian], [`${persian}\u200c`, persian], [family, family], [`${family}\u200d\u200d `, family],
    ["\u200d\u3000\u200dcup", "cup"], ["x".repeat(300), "x".repeat(200)],
    ["\u6f22".repeat(190), "\u6f22".repeat(170)], ["\u{1f468}".repeat(128), "\u{1f468}".repeat(100)]]) {
    assert.equal(await proposed(stem), name);
    assert.equal(await statusOf(name), 404, `the server takes ${name}: there is only nothing to rename`);
  }
  assert.notEqual(await statusOf("la\u200cmp"), 404);
  const shown = await call("names.js", "objectName", "", "gnp.\u202e\u{e0041}cat.png");
  assert.equal(shown.value, "gnp.cat");
}));

test("the focus goes to what was added, or to what unfolds it", async () => {
  const page = await house.openPage(server.address);
  const focused = (probabilities) => page.evaluate(async (list) => {
    const { addHits, clearHits, focusHit, showRest } = await import("/assets/results.js");
    for (const id of ["workspace", "results-panel"]) document.getElementById(id).hidden = false;
    clearHits();
    addHits(list.map(([probability, verdict], i) => ({ image_id: `none-${i}`, name: `hit ${i}`, rank: i + 1, score: 0, probability, verdict })),
            new Map(), () => {});
    showRest(0);
    document.activeElement.blur();
    focusHit(1);
    return document.activeElement.id || document.activeElement.querySelector(".name")?.textContent;
  }, probabilities.map((one) => [one, verdictOf(one)]));
  assert.deepEqual([await focused([0.9, 0.8]), await focused([0.9, 0.1]), await focused([0.9])],
                   ["2. hit 1", "weaker-toggle", "1. hit 0"]);
  await house.closePage(page);
});

test("the recommendation follows the collection's growth", () => withModules(async (call) => {
  const advice = async (images, descriptors, available, sampled) => (await call(
    "collection.js", "recommendation",
    { images, descriptors, vocabulary: available ? { available, sampled } : null })).value;
  assert.match((await advice(0, 0)).text, /Add images first/);
  assert.deepEqual([(await advice(3, 900)).due, (await advice(3, 900, 900, 900)).due,
                    (await advice(9, 2700, 900, 900)).due, (await advice(900, 90_000, 45_000, 40_000)).due,
                    (await advice(900, 990_000, 45_000, 40_000)).due, (await advice(1, 300, 900, 900)).due],
                   [true, false, true, false, true, true]);
}));
