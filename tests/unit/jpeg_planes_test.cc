// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// JPEGs of every kind: one pass gives the grey values that OpenCV gives, and the colours.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::FileBytes;
using testing::ReasonOf;

constexpr int kThumbnailSide = 40;

// So smooth that an eighth of the size loses little.
cv::Mat Colourful(int width, int height, int channels = 3) {
  std::vector<cv::Mat> planes;
  for (int i = 0; i < channels; ++i) planes.push_back(testing::NoiseImage(width, height, 7 + i));
  cv::Mat image;
  cv::merge(planes, image);
  cv::GaussianBlur(image, image, {0, 0}, 12.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

FileBytes Jpeg(const cv::Mat& image, int sampling, bool progressive) {
  const std::unique_ptr<void, int (*)(tjhandle)> compressor(tjInitCompress(), tjDestroy);
  const int format = image.channels() == 4 ? TJPF_CMYK : TJPF_BGR;
  unsigned char* data = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(compressor.get(), image.data, image.cols, static_cast<int>(image.step),
                        image.rows, format, &data, &size, sampling, 95,
                        progressive ? TJFLAG_PROGRESSIVE : 0),
            0);
  FileBytes bytes(data, data + size);
  tjFree(data);
  return bytes;
}

double MeanDifference(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

// What DecodeImage gives with a thumbnail beside, against what it gives apart.
void ExpectTheSameApart(const FileBytes& bytes, int max_side_px) {
  const DecodedImage both =
      DecodeImage(bytes, {.max_side_px = max_side_px, .thumbnail_side_px = kThumbnailSide});
  const DecodedImage grey = DecodeImage(bytes, {.max_side_px = max_side_px});
  EXPECT_EQ(both.image.width, grey.image.width);
  EXPECT_EQ(both.image.height, grey.image.height);
  EXPECT_TRUE(both.image.pixels == grey.image.pixels);  // no megabyte of values in the message
  const Image colours = DecodeImage(bytes, {.max_side_px = max_side_px, .colour = true}).image;
  ASSERT_EQ(std::max(both.thumbnail.width, both.thumbnail.height), kThumbnailSide);
  EXPECT_LT(MeanDifference(both.thumbnail,
                           ResizeImage(colours, both.thumbnail.width, both.thumbnail.height)),
            2.0);
}

class EverySampling : public ::testing::TestWithParam<int> {};

TEST_P(EverySampling, GivesGreyValuesAndColoursInOnePass) {
  for (const bool progressive : {false, true}) {
    for (const cv::Size& size : {cv::Size(97, 61), {640, 480}, {643, 1001}}) {
      SCOPED_TRACE(std::to_string(size.width) + (progressive ? ", progressive" : ""));
      const FileBytes bytes = Jpeg(Colourful(size.width, size.height), GetParam(), progressive);
      for (const int max_side_px : {0, 300}) ExpectTheSameApart(bytes, max_side_px);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Samplings, EverySampling,
                         ::testing::Values(TJSAMP_444, TJSAMP_422, TJSAMP_420, TJSAMP_GRAY,
                                           TJSAMP_440, TJSAMP_411));

TEST(JpegPlanes, OtherColoursAreLeftToOpenCv) {
  for (const bool progressive : {false, true}) {
    ExpectTheSameApart(Jpeg(Colourful(640, 480, 4), TJSAMP_444, progressive), 300);
  }
}

TEST(JpegPlanes, DamagedFilesAreReadOrRefusedAsWithoutThumbnail) {
  std::minstd_rand random(20);
  int decoded = 0;
  for (int round = 0; round < 400; ++round) {
    FileBytes bytes = Jpeg(Colourful(120, 90), TJSAMP_420, round % 2 == 0);
    const std::size_t range =
        round % 4 < 2 ? bytes.size() : std::min<std::size_t>(700, bytes.size());
    for (int i = 0; i < 3; ++i) bytes[random() % range] = static_cast<std::uint8_t>(random());
    const std::string reason = ReasonOf(bytes);
    EXPECT_EQ(ReasonOf(bytes, {.thumbnail_side_px = kThumbnailSide}), reason);
    if (reason != "decoded") continue;
    ++decoded;
    EXPECT_TRUE(DecodeImage(bytes, {.thumbnail_side_px = kThumbnailSide}).image.pixels ==
                DecodeImage(bytes).image.pixels);
  }
  EXPECT_GT(decoded, 50);
  EXPECT_LT(decoded, 400);
}

}  // namespace
}  // namespace pliant
