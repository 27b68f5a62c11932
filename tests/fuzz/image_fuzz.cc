// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decoding of images under small limits. libFuzzer's -malloc_limit_mb says whether they hold.
#include <algorithm>

#include "descriptor/image/image.h"
#include "tests/fuzz/fuzz.h"

namespace {

bool IsWhole(const pliant::Image& image) {
  return image.pixels.size() == static_cast<std::size_t>(image.width) *
                                    static_cast<std::size_t>(image.height) *
                                    static_cast<std::size_t>(image.channels);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  pliant::DecodeOptions options;
  options.max_side_px = size % 2 == 0 ? 0 : 48;
  options.max_pixels = 256 * 1024;
  options.max_decode_bytes = 4 << 20;
  options.min_side_px = 4;
  options.colour = size % 3 != 0;
  options.thumbnail_side_px = size % 5 == 0 ? 0 : 16;
  pliant::DecodedImage decoded;
  const auto decode = [&] { decoded = pliant::DecodeImage({data, size}, options); };
  if (!pliant::fuzz::Accepts(decode)) return 0;
  const pliant::Image& image = decoded.image;
  const pliant::Image& thumbnail = decoded.thumbnail;
  Require(image.channels == (options.colour ? 3 : 1), "the channels are those asked for");
  Require(IsWhole(image) && !image.empty(), "an image has all its pixels");
  Require(IsWhole(thumbnail) && thumbnail.empty() == (options.thumbnail_side_px == 0) &&
              thumbnail.width * thumbnail.height <=
                  options.thumbnail_side_px * options.thumbnail_side_px,
          "a thumbnail is there when it was asked for, and as small");
  Require(std::min(decoded.original_width, decoded.original_height) >= options.min_side_px,
          "no side is too short");
  Require(std::int64_t{decoded.original_width} * decoded.original_height <= options.max_pixels,
          "no image is too large");
  Require(options.max_side_px == 0 || std::max(image.width, image.height) <= options.max_side_px ||
              image.width * image.height <= options.max_side_px * options.max_side_px,
          "no side is too long, but for a panorama");
  if (!thumbnail.empty() && !options.colour) {
    options.thumbnail_side_px = 0;
    Require(pliant::DecodeImage({data, size}, options).image.pixels == image.pixels,
            "a thumbnail beside changes nothing");
  }
  const pliant::ImageHeader header = pliant::ReadImageHeader({data, size});
  const bool turned = header.exif_orientation >= 5;
  Require((turned ? header.height : header.width) == decoded.original_width &&
              (turned ? header.width : header.height) == decoded.original_height,
          "the header says the size of the image");
  return 0;
}
