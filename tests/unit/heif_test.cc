// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// HEIC and AVIF: files of libheif's own encoder (heif-enc), and such put together from its boxes.
#include <array>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::FileBytes;
using testing::ReasonOf;

FileBytes Sample(const std::string& name) {
  std::ifstream file(PLIANT_SOURCE_DIR "/tests/fuzz/corpus/image/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

int At(const Image& image, double x, double y) {
  const auto column = static_cast<std::size_t>(x * image.width);
  const auto row = static_cast<std::size_t>(y * image.height);
  return image.pixels[(row * image.width + column) * image.channels];
}

void ExpectCorners(const Image& image, const std::array<int, 4>& levels) {
  EXPECT_NEAR(At(image, 0.2, 0.2), levels[0], 6);
  EXPECT_NEAR(At(image, 0.8, 0.2), levels[1], 6);
  EXPECT_NEAR(At(image, 0.2, 0.8), levels[2], 6);
  EXPECT_NEAR(At(image, 0.8, 0.8), levels[3], 6);
}

TEST(Heif, BothCodecs) {
  for (const auto& [name, format] : {std::pair("corners.heic", ImageFormat::kHeic),
                                     std::pair("ten_bits.heic", ImageFormat::kHeic),
                                     std::pair("corners.avif", ImageFormat::kAvif)}) {
    const DecodedImage decoded = DecodeImage(Sample(name), {.thumbnail_side_px = 48});
    EXPECT_EQ(decoded.format, format);
    EXPECT_EQ(decoded.original_width, 96);
    EXPECT_EQ(decoded.original_height, 64);
    ExpectCorners(decoded.image, {250, 10, 90, 170});
    EXPECT_EQ(decoded.thumbnail.width, 48);
    ExpectCorners(decoded.thumbnail, {250, 10, 90, 170});
  }
  EXPECT_EQ(MediaType(ImageFormat::kHeic), "image/heic");
  EXPECT_EQ(MediaType(ImageFormat::kAvif), "image/avif");
}

TEST(Heif, TurnsAsTheFileSays) {
  const DecodedImage decoded = DecodeImage(Sample("turned.heic"));
  EXPECT_EQ(decoded.original_width, 64);
  EXPECT_EQ(decoded.original_height, 96);
  ExpectCorners(decoded.image, {90, 250, 170, 10});
}

// As telephones write it: 2 x 3 tiles, the last row of them not whole.
TEST(Heif, JoinsTiles) {
  const DecodedImage decoded = DecodeImage(Sample("tiles.heic"));
  EXPECT_EQ(decoded.original_width, 192);
  EXPECT_EQ(decoded.original_height, 190);
  for (const double x : {0.0, 0.5}) {
    for (const int row : {0, 1, 2}) {
      EXPECT_NEAR(At(decoded.image, x + 0.1, (row * 64 + 10) / 190.0), 250, 6);
      EXPECT_NEAR(At(decoded.image, x + 0.4, (row * 64 + 50) / 190.0), 170, 6);
    }
  }
}

TEST(Heif, TransparencyGetsAGround) {
  const Image image = DecodeImage(Sample("print.avif")).image;
  EXPECT_NEAR(At(image, 0.5, 0.5), 255, 3) << "a white print";
  EXPECT_NEAR(At(image, 0.05, 0.1), 0, 3);
}

TEST(Heif, LimitsHoldBeforeDecoding) {
  const FileBytes file = Sample("tiles.heic");
  EXPECT_EQ(ReasonOf(file, {.max_pixels = 192 * 190 - 1}), "image_too_large");
  EXPECT_EQ(ReasonOf(file, {.max_decode_bytes = 192 * 190 * 3}), "image_too_large");
}

TEST(Heif, CutAnywhereIsRefused) {
  for (const char* name : {"corners.heic", "tiles.heic", "print.avif"}) {
    const FileBytes file = Sample(name);
    for (std::size_t keep = 32; keep < file.size(); keep += 7) {
      const FileBytes cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(keep));
      EXPECT_EQ(ReasonOf(cut), "image_truncated") << name << ", " << keep << " of " << file.size();
    }
  }
}

TEST(Heif, AVideoIsNone) {
  FileBytes file = Sample("corners.heic");
  std::copy_n("isom\0\0\0\0isommp42", 16, file.begin() + 8);
  EXPECT_EQ(ReasonOf(file), "image_type_unknown");
}

}  // namespace
}  // namespace pliant
