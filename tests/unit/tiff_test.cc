// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TIFF: pages, BigTIFF, samples of 16 bits, alpha.
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::Append;
using testing::FileBytes;

struct Page {
  cv::Mat pixels;  // of 8 or 16 bits, channels in the order of the file
  int photometric = 1;
  int extra_sample = -1;  // 1: premultiplied alpha, 2: separate
};

// Little-endian, one strip a page.
FileBytes Tiff(const std::vector<Page>& pages, bool big = false) {
  const int word = big ? 8 : 4;
  FileBytes file;
  Append(file, 0x4949, 2, false);
  Append(file, big ? 43 : 42, 2, false);
  if (big) Append(file, 8, 4, false);
  std::size_t link = file.size();  // where the next directory's place is written
  const auto append = [&](std::uint32_t value, int bytes) {
    Append(file, value, std::min(bytes, 4), false);
    if (bytes == 8) Append(file, 0, 4, false);
  };
  append(0, word);
  for (const Page& page : pages) {
    const auto strip = static_cast<std::uint32_t>(file.size());
    const auto bytes = static_cast<std::uint32_t>(page.pixels.total() * page.pixels.elemSize());
    file.insert(file.end(), page.pixels.data, page.pixels.data + bytes);
    const auto directory = static_cast<std::uint32_t>(file.size());
    for (unsigned i = 0; i < 4; ++i) file[link + i] = static_cast<std::uint8_t>(directory >> 8 * i);
    std::vector<std::pair<int, int>> tags = {{256, page.pixels.cols},
                                             {257, page.pixels.rows},
                                             {258, page.pixels.depth() == CV_16U ? 16 : 8},
                                             {259, 1},
                                             {262, page.photometric},
                                             {273, static_cast<int>(strip)},
                                             {277, page.pixels.channels()},
                                             {278, page.pixels.rows},
                                             {279, static_cast<int>(bytes)}};
    if (page.extra_sample >= 0) tags.emplace_back(338, page.extra_sample);
    append(static_cast<std::uint32_t>(tags.size()), big ? 8 : 2);
    for (const auto& [tag, value] : tags) {
      // Bits are told once for all samples, which libtiff accepts.
      Append(file, tag, 2, false);
      Append(file, tag == 258 || tag == 338 ? 3 : 4, 2, false);  // SHORT, LONG
      append(1, word);
      append(static_cast<std::uint32_t>(value), word);
    }
    link = file.size();
    append(0, word);
  }
  return file;
}

int At(const Image& image, int x, int y) {
  return image.pixels[static_cast<std::size_t>(y * image.width + x) * image.channels];
}

cv::Mat Flat(int width, int height, int type, const cv::Scalar& value) {
  return {height, width, type, value};
}

TEST(Tiff, TheLargestPageCounts) {
  const Page small{Flat(20, 30, CV_8UC1, 10)};
  const Page large{Flat(60, 40, CV_8UC1, 200)};
  const Page other{Flat(60, 40, CV_8UC1, 90)};
  for (const bool big : {false, true}) {
    for (const auto& pages :
         {std::vector{large}, {small, large}, {large, small}, {small, large, other}}) {
      const Image image = DecodeImage(Tiff(pages, big)).image;
      EXPECT_EQ(image.width, 60);
      EXPECT_EQ(image.height, 40);
      EXPECT_EQ(At(image, 30, 20), 200);
    }
  }
  // The limits are those of the page that is decoded.
  EXPECT_EQ(testing::ReasonOf(Tiff({small, large}), {.max_pixels = 60 * 40 - 1}),
            "image_too_large");
}

TEST(Tiff, PagesThatFollowInACircleEnd) {
  FileBytes file = Tiff({{Flat(20, 30, CV_8UC1, 10)}});
  std::copy_n(file.begin() + 4, 4, file.end() - 4);
  EXPECT_EQ(testing::ReasonOf(file), "decoded");
}

TEST(Tiff, SixteenBitsOfAllKinds) {
  const cv::Scalar white = cv::Scalar::all(1023);
  EXPECT_EQ(At(DecodeImage(Tiff({{Flat(20, 20, CV_16UC1, white)}})).image, 5, 5), 255);
  EXPECT_EQ(At(DecodeImage(Tiff({{Flat(20, 20, CV_16UC1, white), 0}})).image, 5, 5), 0);
  const Image colour =
      DecodeImage(Tiff({{Flat(20, 20, CV_16UC3, {1023, 0, 512}), 2}}), {.colour = true}).image;
  EXPECT_EQ(colour.pixels[0], 255);
  EXPECT_EQ(colour.pixels[1], 0);
  EXPECT_NEAR(colour.pixels[2], 128, 1);
}

TEST(Tiff, AlphaOfBothKinds) {
  for (const int type : {CV_8U, CV_16U}) {
    const double full = type == CV_8U ? 255 : 65535;
    for (const int kind : {1, 2}) {
      cv::Mat rgba = Flat(32, 32, CV_MAKETYPE(type, 4), {0, 0, 0, 0});
      const double value = kind == 1 ? full / 2 : full;  // white at half
      rgba.rowRange(8, 24).setTo(cv::Scalar(value, value, value, full / 2));
      const Image image = DecodeImage(Tiff({{rgba, 2, kind}})).image;
      EXPECT_EQ(At(image, 5, 2), 0) << "a black ground";
      EXPECT_NEAR(At(image, 5, 16), 128, 2) << type << ", " << kind;
      cv::Mat grey = Flat(32, 32, CV_MAKETYPE(type, 2), {0, 0});
      grey.rowRange(8, 24).setTo(cv::Scalar(full, full));
      const Image print = DecodeImage(Tiff({{grey, 1, kind}})).image;
      EXPECT_EQ(At(print, 5, 2), 0);
      EXPECT_EQ(At(print, 5, 16), 255);
    }
  }
}

}  // namespace
}  // namespace pliant
