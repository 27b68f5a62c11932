// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images made here: PNG files of blobs, or of nothing at all.
import { deflateSync } from "node:zlib";

// Node has it from version 20 only.
function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

function chunk(type, data) {
  const body = Buffer.concat([Buffer.from(type, "latin1"), data]);
  const length = Buffer.alloc(4);
  length.writeUInt32BE(data.length);
  const check = Buffer.alloc(4);
  check.writeUInt32BE(crc32(body));
  return Buffer.concat([length, body, check]);
}

// grey(x, y) is 0..255.
function png(width, height, grey) {
  const rows = Buffer.alloc(height * (width + 1));  // each row begins with its filter: none
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) rows[y * (width + 1) + 1 + x] = grey(x, y);
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header[8] = 8;  // bits; colour type 0 is grey
  return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", header),
                        chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

// --- things that are told apart: triangles of many shades

const kThing = [320, 240];  // pixels

function thingShades(seed) {
  const random = randomOf(seed);
  const triangles = Array.from({ length: 140 }, () => {
    const [x, y] = [random() * kThing[0], random() * kThing[1]];
    const corners = Array.from({ length: 3 }, () => [x + 70 * (random() - 0.5), y + 70 * (random() - 0.5)]);
    return { x, y, corners, shade: Math.floor(256 * random()) };
  });
  const side = ([ax, ay], [bx, by], x, y) => (bx - ax) * (y - ay) - (by - ay) * (x - ax);
  return (x, y) => {
    let shade = 128;
    for (const { x: u, y: v, corners: [a, b, c], shade: own } of triangles) {
      if (Math.abs(x - u) > 35 || Math.abs(y - v) > 35) continue;
      const signs = [side(a, b, x, y) > 0, side(b, c, x, y) > 0, side(c, a, x, y) > 0];
      if (signs[0] === signs[1] && signs[1] === signs[2]) shade = own;
    }
    return shade;
  };
}

export const thing = (seed) => png(...kThing, thingShades(seed));

// The same thing with noise of its own for each `noise`.
export function noisyThing(seed, noise) {
  const [shade, random] = [thingShades(seed), randomOf(noise)];
  return png(...kThing, (x, y) => Math.max(0, Math.min(255, shade(x, y) + Math.floor(25 * random()) - 12)));
}

// A photograph of things: each of `parts` is { seed, x, y (its middle), scale, angle (degrees) }.
export function photograph(parts, width = 640, height = 480) {
  const placed = parts.map(({ seed, x, y, scale = 1, angle = 0 }) => {
    const [c, s] = [Math.cos(angle * Math.PI / 180) / scale, Math.sin(angle * Math.PI / 180) / scale];
    return { shade: thingShades(seed), inside: (px, py) => {
      const [u, v] = [px - x, py - y];
      return [c * u + s * v + kThing[0] / 2, c * v - s * u + kThing[1] / 2];
    } };
  });
  return png(width, height, (px, py) => {
    let grey = 200 + 10 * Math.sin(px / 37);
    for (const { shade, inside } of placed) {
      const [u, v] = inside(px, py);
      if (u >= 0 && v >= 0 && u < kThing[0] && v < kThing[1]) grey = 20 + 0.8 * shade(u, v);  // not as bright as it was
    }
    return Math.round(grey);
  });
}

// A GIF of 128 grey values. Its codes are not compressed: a clear code comes before the table would grow.
function gif(width, height, grey) {
  const kClear = 128, kEnd = 129, kBits = 8, kUntilClear = 100;
  const codes = [];
  for (let i = 0; i < width * height; ++i) {
    if (i % kUntilClear === 0) codes.push(kClear);
    codes.push(grey(i % width, Math.floor(i / width)) >> 1);
  }
  const bytes = Buffer.from([...codes, kEnd]);  // eight bits each
  const blocks = [];
  for (let at = 0; at < bytes.length; at += 255) {
    const block = bytes.subarray(at, at + 255);
    blocks.push(Buffer.from([block.length]), block);
  }
  const size = [width & 255, width >> 8, height & 255, height >> 8];
  const palette = Array.from({ length: 128 }, (_, i) => [2 * i, 2 * i, 2 * i]).flat();
  return Buffer.concat([Buffer.from("GIF89a", "latin1"), Buffer.from([...size, 0xf6, 0, 0, ...palette]),
                        Buffer.from([0x2c, 0, 0, 0, 0, ...size, 0, kBits - 1]), ...blocks, Buffer.from([0, 0x3b])]);
}

// A TIFF, which no browser here shows: little-endian, one strip, not compressed.
function tiff(width, height, grey) {
  const tags = [[256, width], [257, height], [258, 8], [259, 1], [262, 1], [273, 0], [277, 1], [278, height], [279, width * height]];
  const head = Buffer.alloc(8 + 2 + 12 * tags.length + 4);
  head.write("II*\0", "latin1");
  head.writeUInt32LE(8, 4);
  head.writeUInt16LE(tags.length, 8);
  for (const [i, [tag, value]] of tags.entries()) {
    const at = 10 + 12 * i;
    head.writeUInt16LE(tag, at);
    head.writeUInt16LE(4, at + 2);  // 32 bits
    head.writeUInt32LE(1, at + 4);
    head.writeUInt32LE(tag === 273 ? head.length : value, at + 8);
  }
  const pixels = Buffer.alloc(width * height);
  for (let i = 0; i < pixels.length; ++i) pixels[i] = grey(i % width, Math.floor(i / width));
  return Buffer.concat([head, pixels]);
}

export const thingTiff = (seed) => tiff(...kThing, thingShades(seed));

export const thingGif = (seed) => gif(...kThing, thingShades(seed));

export const blank = () => png(240, 180, () => 255);

function randomOf(seed) {
  let state = seed * 2654435761 % 2 ** 32;
  return () => {  // mulberry32
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

// Blobs whose places, sizes and shades follow from the seed: grey(x, y). scale: of what is drawn; half the width and
// height at scale 0.5 is the same image at half its size.
function blobShades(seed, width, height, scale) {
  const random = randomOf(seed);
  const list = Array.from({ length: 60 }, () => ({
    x: random() * width, y: random() * height, r: scale * (4 + 12 * random()), shade: Math.floor(256 * random()),
  }));
  return (x, y) => {
    let shade = 128;
    for (const blob of list) if (Math.hypot(x - blob.x, y - blob.y) < blob.r) shade = blob.shade;
    return shade;
  };
}

export const blobs = (seed, width = 240, height = 180, scale = 1) =>
  png(width, height, blobShades(seed, width, height, scale));

// The part of blobs(seed, width, height) from (left, top) on.
export function partOfBlobs(seed, width, height, left, top) {
  const grey = blobShades(seed, width, height, 1);
  return png(width - left, height - top, (x, y) => grey(x + left, y + top));
}
