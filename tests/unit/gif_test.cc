// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// GIF: the first frame on its screen.
#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::Append;
using testing::FileBytes;
using testing::ReasonOf;

struct Frame {
  int left = 0, top = 0, width = 40, height = 40;
  bool interlaced = false;
  int transparent = -1;
};

// A screen of 40 x 40 with 128 levels of grey. Codes have 8 bits: a clear code (128) comes before
// the table would grow. The level of a pixel is its row of the frame, plus one in every other
// column.
FileBytes Gif(const Frame& frame, const std::string& before = {}) {
  FileBytes file;
  for (const char c : std::string("GIF89a")) file.push_back(static_cast<std::uint8_t>(c));
  Append(file, 40, 2, false);
  Append(file, 40, 2, false);
  for (const int byte : {0xF6, 0, 0}) file.push_back(static_cast<std::uint8_t>(byte));
  for (int i = 0; i < 128; ++i) Append(file, 0x020202U * i, 3, false);
  file.insert(file.end(), before.begin(), before.end());
  if (frame.transparent >= 0) {
    for (const int byte : {0x21, 0xF9, 4, 1, 0, 0, frame.transparent, 0}) {
      file.push_back(static_cast<std::uint8_t>(byte));
    }
  }
  file.push_back(0x2C);
  for (const int value : {frame.left, frame.top, frame.width, frame.height}) {
    Append(file, static_cast<std::uint32_t>(value), 2, false);
  }
  file.push_back(frame.interlaced ? 0x40 : 0);
  file.push_back(7);
  std::vector<int> rows;
  for (const auto& [first, step] : {std::pair(0, 8), {4, 8}, {2, 4}, {1, 2}}) {
    for (int y = first; y < frame.height; y += step) rows.push_back(y);
  }
  if (!frame.interlaced) std::sort(rows.begin(), rows.end());
  FileBytes codes;
  for (const int y : rows) {
    codes.push_back(128);
    for (int x = 0; x < frame.width; ++x) codes.push_back(static_cast<std::uint8_t>(y + x % 2));
  }
  codes.push_back(129);
  for (std::size_t at = 0; at < codes.size(); at += 255) {
    const std::size_t size = std::min<std::size_t>(255, codes.size() - at);
    file.push_back(static_cast<std::uint8_t>(size));
    file.insert(file.end(), codes.begin() + at, codes.begin() + at + size);
  }
  file.push_back(0);
  file.push_back(0x3B);
  return file;
}

int At(const Image& image, int x, int y) {
  return image.pixels[static_cast<std::size_t>(y * image.width + x) * image.channels];
}

TEST(Gif, RowsInBothOrders) {
  for (const bool interlaced : {false, true}) {
    const DecodedImage decoded = DecodeImage(Gif({.interlaced = interlaced}));
    EXPECT_EQ(decoded.format, ImageFormat::kGif);
    ASSERT_EQ(decoded.original_width, 40);
    ASSERT_EQ(decoded.original_height, 40);
    for (int y = 0; y < 40; ++y) {
      EXPECT_EQ(At(decoded.image, 6, y), 2 * y);
      EXPECT_EQ(At(decoded.image, 7, y), 2 * y + 2);
    }
  }
}

TEST(Gif, AFrameOnAScreenThatIsLargerOrSmaller) {
  const Image small = DecodeImage(Gif({.left = 10, .top = 20, .width = 20, .height = 20})).image;
  EXPECT_EQ(small.width, 40);
  EXPECT_EQ(At(small, 12, 39), 2 * 19);
  EXPECT_EQ(At(small, 2, 2), 255) << "a ground behind it";
  const Image large = DecodeImage(Gif({.left = 10, .width = 60, .height = 20})).image;
  EXPECT_EQ(large.width, 70);
  EXPECT_EQ(large.height, 40);
}

TEST(Gif, ATransparentColour) {
  const Image image = DecodeImage(Gif({.transparent = 5})).image;
  EXPECT_EQ(At(image, 6, 5), 255);
  EXPECT_EQ(At(image, 7, 5), 12);
}

TEST(Gif, ExtensionsBeforeTheFrame) {
  const std::string loops("\x21\xFF\x0BNETSCAPE2.0\x03\x01\0\0\0", 19);
  const std::string comment("\x21\xFE\x02hi\0", 6);
  EXPECT_EQ(DecodeImage(Gif({}, loops + comment)).image.pixels, DecodeImage(Gif({})).image.pixels);
}

TEST(Gif, OnlyTheFirstFramesRowsCount) {
  const FileBytes whole = Gif({});
  for (std::size_t keep = 6; keep < whole.size(); ++keep) {
    const FileBytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(keep));
    const std::string reason = ReasonOf(cut);
    EXPECT_TRUE(reason == "image_truncated" || (reason == "decoded" && keep + 3 > whole.size()))
        << keep << " of " << whole.size() << ": " << reason;
  }
}

TEST(Gif, WhatCannotBeReadIsRefused) {
  FileBytes empty = Gif({});
  empty.resize(13 + 3 * 128);
  empty.push_back(0x3B);
  EXPECT_EQ(ReasonOf(empty), "image_corrupt");
  FileBytes large = Gif({});
  const std::size_t frame = 13 + 3 * 128;
  for (const std::size_t at : {frame + 5, frame + 6, frame + 7, frame + 8}) large[at] = 0xFF;
  EXPECT_EQ(ReasonOf(large), "image_too_large");
}

}  // namespace
}  // namespace pliant
