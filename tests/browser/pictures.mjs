// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures made here: PNG files of blobs, or of nothing at all.
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

export const blank = () => png(240, 180, () => 255);

// Blobs whose places, sizes and shades follow from the seed.
export function blobs(seed, width = 240, height = 180) {
  let state = seed * 2654435761 % 2 ** 32;
  const random = () => {  // mulberry32
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
  const list = Array.from({ length: 60 }, () => ({
    x: random() * width, y: random() * height, r: 4 + 12 * random(), shade: Math.floor(256 * random()),
  }));
  return png(width, height, (x, y) => {
    let shade = 128;
    for (const blob of list) if (Math.hypot(x - blob.x, y - blob.y) < blob.r) shade = blob.shade;
    return shade;
  });
}
