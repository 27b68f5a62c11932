// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is read of an image file before it is decoded: its header, and whether it is whole.
#include "descriptor/image/image_header.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::Bytes;
using pliant::ScannedImage;
using pliant::fuzz::Accepts;
using pliant::fuzz::Require;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::int64_t kMostPixels = 100'000'000;
  const Bytes bytes(data, size);
  ScannedImage scanned;
  if (!Accepts([&] { scanned = pliant::ScanImage(bytes); })) return 0;
  const pliant::ImageHeader& header = scanned.header;
  Require(header.format == pliant::SniffFormat(bytes), "the format is that of the first bytes");
  Require(header.width > 0 && header.height > 0, "a header that is accepted has a size");
  Require(header.exif_orientation >= 1 && header.exif_orientation <= 8, "an orientation is 1 to 8");
  if (header.width > kMostPixels / header.height) return 0;  // refused before the structure is read
  if (!Accepts([&] { pliant::CheckStructure(bytes, scanned); })) return 0;
  Require(scanned.pixel_bytes > 0 && scanned.buffer_bytes >= 0, "decoding takes memory");
  return 0;
}
