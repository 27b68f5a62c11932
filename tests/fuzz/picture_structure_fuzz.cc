// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is read of a picture file before a decoder sees it: its header, whether it is whole, and the
// file without its metadata.
#include "descriptor/image/image_header.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::Bytes;
using pliant::ScannedImage;
using pliant::fuzz::Accepts;
using pliant::fuzz::Require;

// A decoder is given `kept`, but the limits were checked of the file it was made of.
void CheckWithoutMetadata(Bytes kept, const ScannedImage& whole) {
  ScannedImage scanned;
  const bool accepted = Accepts([&] {
    scanned = pliant::ScanImage(kept);
    pliant::CheckStructure(kept, scanned);
  });
  Require(accepted, "a file that is accepted is accepted without its metadata");
  Require(scanned.header.format == whole.header.format &&
              scanned.header.width == whole.header.width &&
              scanned.header.height == whole.header.height,
          "the size is the same without metadata");
  Require(scanned.pixel_bytes == whole.pixel_bytes && scanned.buffer_bytes == whole.buffer_bytes,
          "the memory that decoding takes is the same without metadata");
  Require(pliant::WithoutMetadata(kept, scanned.header.format).empty(), "no metadata are left");
}

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
  const std::vector<std::uint8_t> kept = pliant::WithoutMetadata(bytes, header.format);
  Require(kept.size() <= bytes.size(), "a file does not grow when it loses its metadata");
  if (!kept.empty()) CheckWithoutMetadata(kept, scanned);
  return 0;
}
