// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// BMP in all its kinds.
#include <array>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/image/image.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/image_files.h"

namespace pliant::testing {
namespace {

struct Bitmap {
  int width = 16;
  int height = 16;  // negative: from the top down
  int bits = 24;
  std::uint32_t compression = 0;
  std::vector<std::uint32_t> masks = {};
  std::vector<std::uint32_t> palette = {};
  std::uint32_t header_bytes = 40;
};

// Pixels are the file's rows, padded.
FileBytes File(const Bitmap& b, const FileBytes& pixels) {
  FileBytes file = {'B', 'M'};
  const auto extra = static_cast<std::uint32_t>(b.header_bytes == 40 ? 4 * b.masks.size() : 0);
  const auto at = static_cast<std::uint32_t>(14 + b.header_bytes + extra + 4 * b.palette.size());
  for (const std::uint32_t value : {at + static_cast<std::uint32_t>(pixels.size()), 0U, at}) {
    Append(file, value, 4, false);
  }
  for (const std::uint32_t value : {b.header_bytes, static_cast<std::uint32_t>(b.width),
                                    static_cast<std::uint32_t>(b.height)}) {
    Append(file, value, 4, false);
  }
  Append(file, 1, 2, false);
  Append(file, static_cast<std::uint32_t>(b.bits), 2, false);
  for (const std::uint32_t value :
       {b.compression, static_cast<std::uint32_t>(pixels.size()), 0U, 0U, 0U, 0U}) {
    Append(file, value, 4, false);
  }
  for (const std::uint32_t mask : b.masks) Append(file, mask, 4, false);
  while (file.size() < 14 + b.header_bytes) file.push_back(0);
  for (const std::uint32_t colour : b.palette) Append(file, colour, 4, false);
  file.insert(file.end(), pixels.begin(), pixels.end());
  return file;
}

Image Decoded(const FileBytes& file) { return DecodeImage(file, {.colour = true}).image; }

std::array<int, 3> At(const Image& image, int x, int y) {
  const std::uint8_t* p = image.pixels.data() + 3 * (y * image.width + x);
  return {p[0], p[1], p[2]};
}

using Colour = std::array<int, 3>;

// Rows of 16 pixels, each of `bytes` bytes, of the values f(x, y) of the file's own order.
template <typename Value>
FileBytes Rows(int bytes, Value&& value) {
  FileBytes pixels;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) Append(pixels, value(x, y), bytes, false);
  }
  return pixels;
}

TEST(Bmp, SixteenBitsOfBothKinds) {
  const auto plain =
      Rows(2, [](int x, int y) { return x == 0 ? 0x7C00U : (y == 0 ? 0x03E0U : 31U); });
  const Image five = Decoded(File({.bits = 16}, plain));
  EXPECT_EQ(At(five, 0, 0), (Colour{255, 0, 0}));
  EXPECT_EQ(At(five, 1, 15), (Colour{0, 255, 0})) << "the file begins at the bottom";
  EXPECT_EQ(At(five, 1, 0), (Colour{0, 0, 255}));
  const auto six =
      Rows(2, [](int x, int) { return x == 0 ? 0xF800U : (x == 1 ? 0x07E0U : 0x0410U); });
  for (const std::uint32_t header : {40U, 108U, 124U}) {
    const Image image = Decoded(File(
        {.bits = 16, .compression = 3, .masks = {0xF800, 0x07E0, 0x001F}, .header_bytes = header},
        six));
    EXPECT_EQ(At(image, 0, 3), (Colour{255, 0, 0})) << header;
    EXPECT_EQ(At(image, 1, 3), (Colour{0, 255, 0})) << header;
    EXPECT_EQ(At(image, 2, 3), (Colour{0, 129, 131})) << header;
  }
}

TEST(Bmp, AlphaIsUsedIfAnythingIsVisible) {
  const std::vector<std::uint32_t> masks = {0xFF0000, 0xFF00, 0xFF, 0xFF000000};
  const Bitmap bitmap = {.bits = 32, .compression = 3, .masks = masks, .header_bytes = 124};
  const Image half =
      Decoded(File(bitmap, Rows(4, [](int x, int) { return x < 8 ? 0xFF0000FFU : 0x000000FFU; })));
  EXPECT_EQ(At(half, 2, 2), (Colour{0, 0, 255}));
  EXPECT_EQ(At(half, 12, 2), (Colour{255, 255, 255}));
  const Image none = Decoded(File(bitmap, Rows(4, [](int, int) { return 0x000000FFU; })));
  EXPECT_EQ(At(none, 2, 2), (Colour{0, 0, 255}));
  const Image without = Decoded(File({.bits = 32}, Rows(4, [](int, int) { return 0x000000FFU; })));
  EXPECT_EQ(At(without, 2, 2), (Colour{0, 0, 255}));
  const Image spare = Decoded(
      File({.bits = 32}, Rows(4, [](int x, int) { return x < 8 ? 0xFF0000FFU : 0x00FF0000U; })));
  EXPECT_EQ(At(spare, 2, 2), (Colour{0, 0, 255}));
  EXPECT_EQ(At(spare, 12, 2), (Colour{255, 255, 255}));
}

TEST(Bmp, RunLengthsOfEightBits) {
  FileBytes data = {16, 1, 0, 0};  // row 15: all 1
  for (const std::uint8_t byte : {0, 3, 2, 1, 2, 0, 4, 2, 0, 0})
    data.push_back(byte);                                             // 2 1 2, 4 of 2
  for (const std::uint8_t byte : {0, 2, 5, 1}) data.push_back(byte);  // to row 12, column 5
  for (const std::uint8_t byte : {2, 2, 0, 1}) data.push_back(byte);
  const Image image =
      Decoded(File({.bits = 8, .compression = 1, .palette = {0x000000, 0xFF0000, 0x00FF00}}, data));
  EXPECT_EQ(At(image, 15, 15), (Colour{255, 0, 0}));
  EXPECT_EQ(At(image, 0, 14), (Colour{0, 255, 0}));
  EXPECT_EQ(At(image, 1, 14), (Colour{255, 0, 0}));
  EXPECT_EQ(At(image, 6, 14), (Colour{0, 255, 0}));
  EXPECT_EQ(At(image, 7, 14), (Colour{0, 0, 0}));
  EXPECT_EQ(At(image, 4, 12), (Colour{0, 0, 0}));
  EXPECT_EQ(At(image, 6, 12), (Colour{0, 255, 0}));
}

TEST(Bmp, RunLengthsOfFourBits) {
  FileBytes data = {5, 0x12, 0, 5, 0x21, 0x12, 0x10, 0, 0, 0, 0, 1};
  const Image image =
      Decoded(File({.bits = 4, .compression = 2, .palette = {0x000000, 0xFF0000, 0x00FF00}}, data));
  for (int x = 0; x < 16; ++x) {
    const Colour expected = x < 5    ? (x % 2 == 0 ? Colour{255, 0, 0} : Colour{0, 255, 0})
                            : x < 10 ? (x == 5 || x == 8 ? Colour{0, 255, 0} : Colour{255, 0, 0})
                                     : Colour{0, 0, 0};
    EXPECT_EQ(At(image, x, 15), expected) << x;
  }
}

TEST(Bmp, PalettesOfOneAndFourBitsAndOfOs2) {
  FileBytes bits;
  for (int y = 0; y < 16; ++y) Append(bits, 0x00000F80, 4, false);  // bytes 80 0F 00 00
  const Image one = Decoded(File({.bits = 1, .palette = {0x0000FF, 0xFFFFFF}}, bits));
  EXPECT_EQ(At(one, 0, 0), (Colour{255, 255, 255}));
  EXPECT_EQ(At(one, 1, 0), (Colour{0, 0, 255}));
  EXPECT_EQ(At(one, 12, 0), (Colour{255, 255, 255}));
  FileBytes nibbles;
  for (int y = 0; y < 16; ++y) {
    for (int i = 0; i < 8; ++i) nibbles.push_back(static_cast<std::uint8_t>(i == 0 ? 0x12 : 0));
  }
  const Image four =
      Decoded(File({.height = -16, .bits = 4, .palette = {0, 0xFF0000, 0xFF00}}, nibbles));
  EXPECT_EQ(At(four, 0, 0), (Colour{255, 0, 0}));
  EXPECT_EQ(At(four, 1, 0), (Colour{0, 255, 0}));
  FileBytes core = {'B', 'M'};
  for (const std::uint32_t value : {0U, 0U, 26U, 12U}) Append(core, value, 4, false);
  for (const std::uint32_t value : {16U, 16U, 1U, 24U}) Append(core, value, 2, false);
  for (int i = 0; i < 256; ++i) Append(core, 0x00FF00, 3, false);
  EXPECT_EQ(At(Decoded(core), 7, 7), (Colour{0, 255, 0}));
}

TEST(Bmp, IsAsOpenCvReadsIt) {
  const cv::Mat image = CornerImage(37, 21);
  cv::Mat rgb;
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  const Image decoded = Decoded(EncodeAs(image, ".bmp"));
  ASSERT_EQ(decoded.width, 37);
  EXPECT_TRUE(std::equal(decoded.pixels.begin(), decoded.pixels.end(), rgb.data));
}

TEST(Bmp, TheLastRowNeedsNoPaddingButItsPixels) {
  FileBytes pixels;
  for (int y = 0; y < 17; ++y) {
    for (int i = 0; i < 17 * 3; ++i) pixels.push_back(7);
    if (y < 16) pixels.push_back(0);
  }
  FileBytes file = File({.width = 17, .height = 17}, pixels);
  EXPECT_EQ(At(Decoded(file), 16, 0), (Colour{7, 7, 7}));
  file.pop_back();
  ExpectError(ErrorCode::kUnprocessable, "image_truncated", [&] { Decoded(file); });
}

TEST(Bmp, WhatCannotBeReadIsRefused) {
  const FileBytes data(16 * 16 * 4, 0);
  const Bitmap two_bits{.bits = 2};
  const Bitmap jpeg_inside{.bits = 24, .compression = 4};
  const Bitmap bytes_of_nibbles{.bits = 4, .compression = 1};
  const Bitmap no_masks{.bits = 16, .compression = 3, .masks = {0, 0, 0}};
  const Bitmap runs_downwards{.height = -16, .bits = 8, .compression = 1};
  for (const Bitmap& bitmap : {two_bits, jpeg_inside, bytes_of_nibbles, no_masks, runs_downwards}) {
    ExpectError(ErrorCode::kUnprocessable, "image_corrupt", [&] { Decoded(File(bitmap, data)); });
  }
  const FileBytes cut_short = File({.bits = 8, .compression = 1}, {16, 1, 0, 0});
  ExpectError(ErrorCode::kUnprocessable, "image_truncated", [&] { Decoded(cut_short); });
}

}  // namespace
}  // namespace pliant::testing
