// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image.h"

#include <array>
#include <cstring>
#include <random>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "tests/unit/image_files.h"
#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::CornerImage;
using testing::EncodeAs;
using testing::FileBytes;
using testing::ReasonOf;

int At(const Image& image, double x, double y) {
  const int column = static_cast<int>(x * image.width);
  const int row = static_cast<int>(y * image.height);
  return image.pixels[(static_cast<std::size_t>(row) * image.width + column) * image.channels];
}

// Levels of the corners, read top left, top right, bottom left, bottom right.
void ExpectCorners(const Image& image, std::array<int, 4> levels) {
  EXPECT_NEAR(At(image, 0.25, 0.25), levels[0], 6);
  EXPECT_NEAR(At(image, 0.75, 0.25), levels[1], 6);
  EXPECT_NEAR(At(image, 0.25, 0.75), levels[2], 6);
  EXPECT_NEAR(At(image, 0.75, 0.75), levels[3], 6);
}

class EveryFormat : public ::testing::TestWithParam<std::pair<const char*, ImageFormat>> {};

TEST_P(EveryFormat, IsReadByContent) {
  const FileBytes bytes = EncodeAs(CornerImage(97, 65), GetParam().first);
  const ImageHeader header = ReadImageHeader(bytes);
  EXPECT_EQ(header.format, GetParam().second);
  EXPECT_EQ(header.width, 97);
  EXPECT_EQ(header.height, 65);
  const DecodedImage decoded = DecodeImage(bytes);
  EXPECT_EQ(decoded.image.width, 97);
  EXPECT_EQ(decoded.image.height, 65);
  EXPECT_EQ(decoded.image.channels, 1);
  ExpectCorners(decoded.image, {250, 10, 90, 170});
}

// What stands behind the last row (an end mark, a checksum) can be missing.
TEST_P(EveryFormat, CutAnywhereIsRefusedOrHasAllItsRows) {
  const FileBytes bytes = EncodeAs(testing::NoiseImage(80, 60, 3), GetParam().first);
  const Image whole = DecodeImage(bytes).image;
  for (std::size_t keep = 32; keep < bytes.size();
       keep += keep + 40 < bytes.size() ? 1 + bytes.size() / 200 : 1) {
    const FileBytes cut(bytes.begin(), bytes.begin() + keep);
    const std::string reason = ReasonOf(cut);
    EXPECT_TRUE(reason == "image_truncated" || (reason == "decoded" && keep + 24 > bytes.size() &&
                                                DecodeImage(cut).image.pixels == whole.pixels))
        << reason << ", kept " << keep << " of " << bytes.size();
  }
}

// Damage may go unnoticed (a changed pixel is an image too), but must never crash or hang, and
// every refusal must be one of the documented ones.
TEST_P(EveryFormat, DamageIsAnErrorOrAnImage) {
  const FileBytes bytes = EncodeAs(testing::NoiseImage(80, 60, 4), GetParam().first);
  const unsigned seed = 20240611;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  const std::set<std::string> documented = {"decoded",         "image_corrupt",
                                            "image_truncated", "image_type_unknown",
                                            "image_too_large", "image_too_small"};
  for (int round = 0; round < 300; ++round) {
    FileBytes damaged = bytes;
    for (int i = 0; i < 4; ++i) {
      const std::size_t range =
          round % 2 == 0 ? std::min<std::size_t>(80, bytes.size()) : bytes.size();
      damaged[random() % range] = static_cast<std::uint8_t>(random());
    }
    EXPECT_TRUE(documented.contains(ReasonOf(damaged))) << ReasonOf(damaged);
  }
}

TEST_P(EveryFormat, GivesAThumbnailBesideTheSameImage) {
  const cv::Scalar red(0, 0, 255);
  const cv::Scalar green(0, 255, 0);
  const cv::Scalar blue(255, 0, 0);
  for (const int side : {60, 900}) {  // one that is not scaled down, too
    const cv::Mat image =
        testing::Quarters(side, side / 2, {red, green, blue, cv::Scalar::all(255)});
    const FileBytes bytes = EncodeAs(image, GetParam().first);
    const DecodedImage alone = DecodeImage(bytes, {.max_side_px = 300});
    EXPECT_TRUE(alone.thumbnail.empty());
    const DecodedImage both = DecodeImage(bytes, {.max_side_px = 300, .thumbnail_side_px = 64});
    EXPECT_EQ(both.image.pixels, alone.image.pixels);
    EXPECT_EQ(both.original_width, side);
    const Image& small = both.thumbnail;
    ASSERT_EQ(small.channels, 3);
    EXPECT_EQ(small.width, std::min(side, 64));
    EXPECT_EQ(small.height, std::min(side, 64) / 2);
    const auto level = [&](double x, double y, std::size_t channel) {
      const auto at = static_cast<std::size_t>(y * small.height) * small.width +
                      static_cast<std::size_t>(x * small.width);
      return static_cast<int>(small.pixels[3 * at + channel]);
    };
    for (std::size_t channel = 0; channel < 3; ++channel) {
      EXPECT_NEAR(level(0.25, 0.25, channel), channel == 0 ? 255 : 0, 6);
      EXPECT_NEAR(level(0.75, 0.25, channel), channel == 1 ? 255 : 0, 6);
      EXPECT_NEAR(level(0.25, 0.75, channel), channel == 2 ? 255 : 0, 6);
      EXPECT_NEAR(level(0.75, 0.75, channel), 255, 6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Formats, EveryFormat,
    ::testing::Values(std::pair(".jpg", ImageFormat::kJpeg), std::pair(".png", ImageFormat::kPng),
                      std::pair(".webp", ImageFormat::kWebp), std::pair(".bmp", ImageFormat::kBmp),
                      std::pair(".tiff", ImageFormat::kTiff)),
    [](const auto& parameter) { return std::string(parameter.param.first + 1); });

constexpr std::array<std::array<int, 4>, 8> kTurnedCorners = {{
    {250, 10, 90, 170},  // 1: upright
    {10, 250, 170, 90},  // 2: mirrored
    {170, 90, 10, 250},  // 3: half turn
    {90, 170, 250, 10},  // 4: upside down mirrored
    {250, 90, 10, 170},  // 5: transposed
    {90, 250, 170, 10},  // 6: needs a quarter turn clockwise
    {170, 10, 90, 250},  // 7: transposed the other way
    {10, 170, 250, 90},  // 8: needs a quarter turn counter-clockwise
}};

class EveryOrientation : public ::testing::TestWithParam<int> {
 protected:
  void Check(const FileBytes& bytes) {
    const DecodedImage decoded = DecodeImage(bytes, {.thumbnail_side_px = 48});
    const bool turned = GetParam() >= 5;
    EXPECT_EQ(decoded.image.width, turned ? 64 : 96);
    EXPECT_EQ(decoded.image.height, turned ? 96 : 64);
    EXPECT_EQ(decoded.original_width, decoded.image.width);
    EXPECT_EQ(decoded.original_height, decoded.image.height);
    ExpectCorners(decoded.image, kTurnedCorners[GetParam() - 1]);
    EXPECT_EQ(decoded.thumbnail.width, turned ? 32 : 48);
    EXPECT_EQ(decoded.thumbnail.height, turned ? 48 : 32);
    ExpectCorners(decoded.thumbnail, kTurnedCorners[GetParam() - 1]);
  }
};

TEST_P(EveryOrientation, Jpeg) {
  for (const bool big_endian : {false, true}) {
    Check(testing::WithJpegExif(EncodeAs(CornerImage(), ".jpg"), GetParam(), big_endian));
  }
}

TEST_P(EveryOrientation, Png) {
  Check(testing::WithPngChunk(EncodeAs(CornerImage(), ".png"), "eXIf",
                              testing::ExifBlock(GetParam(), true)));
}

TEST_P(EveryOrientation, Tiff) {
  cv::Mat grey;
  cv::cvtColor(CornerImage(), grey, cv::COLOR_BGR2GRAY);
  Check(testing::GreyTiff(grey, GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Exif, EveryOrientation, ::testing::Range(1, 9));

TEST(DecodeImage, MetadataDoNotMatter) {
  const FileBytes png = EncodeAs(CornerImage(), ".png");
  const FileBytes with = testing::WithPngChunk(png, "tEXt", {'a', 0, 'b'});
  EXPECT_EQ(DecodeImage(with).image.pixels, DecodeImage(png).image.pixels);
  const FileBytes jpeg = EncodeAs(CornerImage(), ".jpg");
  EXPECT_EQ(DecodeImage(testing::WithJpegExif(jpeg, 1, false)).image.pixels,
            DecodeImage(jpeg).image.pixels);
  // Only the first EXIF block counts.
  const FileBytes twice = testing::WithJpegExif(testing::WithJpegExif(jpeg, 1, false), 6, false);
  EXPECT_EQ(ReadImageHeader(twice).exif_orientation, 6);
}

TEST(DecodeImage, ScalesTheLongerSide) {
  for (const char* extension : {".jpg", ".png"}) {
    const DecodedImage decoded =
        DecodeImage(EncodeAs(CornerImage(3000, 2001), extension), {.max_side_px = 600});
    EXPECT_EQ(decoded.image.width, 600);
    EXPECT_EQ(decoded.image.height, 400);
    EXPECT_EQ(decoded.original_width, 3000);
    EXPECT_EQ(decoded.original_height, 2001);
    EXPECT_DOUBLE_EQ(decoded.scale, 0.2);
    ExpectCorners(decoded.image, {250, 10, 90, 170});
  }
  EXPECT_EQ(DecodeImage(EncodeAs(CornerImage(1500, 40), ".png"), {.max_side_px = 0}).image.width,
            1500);
}

// A ring and a bar of two colours; alpha is 0 elsewhere, where the colour is another one.
cv::Mat Print(const cv::Scalar& ring, const cv::Scalar& bar) {
  cv::Mat drawn(64, 64, CV_8UC4, cv::Scalar(120, 0, 200, 0));
  cv::circle(drawn, {20, 32}, 12, ring, 6);
  cv::rectangle(drawn, {40, 8, 16, 48}, bar, cv::FILLED);
  return drawn;
}

cv::Mat OnGround(const cv::Mat& print, int ground) {
  cv::Mat opaque(print.size(), CV_8UC3, cv::Scalar::all(ground));
  for (int i = 0; i < static_cast<int>(print.total()); ++i) {
    const auto& pixel = print.at<cv::Vec4b>(i / print.cols, i % print.cols);
    if (pixel[3] != 0)
      opaque.at<cv::Vec3b>(i / print.cols, i % print.cols) = {pixel[0], pixel[1], pixel[2]};
  }
  return opaque;
}

TEST(DecodeImage, PanoramasKeepTheirHeight) {
  const auto expect = [](int width, int height, int scaled_width, int scaled_height) {
    const ScaledSize size = ScaleToFit(width, height, 1024);
    EXPECT_EQ(size.width, scaled_width);
    EXPECT_EQ(size.height, scaled_height);
  };
  expect(20'000, 500, 5609, 140);  // as many pixels as 1024 x 768
  expect(500, 20'000, 140, 5609);
  expect(5000, 1000, 1280, 256);  // a quarter of 1024
  expect(4000, 1000, 1024, 256);
  expect(1500, 100, 1500, 100);
  const DecodedImage decoded =
      DecodeImage(EncodeAs(testing::NoiseImage(6000, 150, 1), ".jpg"), {.thumbnail_side_px = 320});
  EXPECT_EQ(decoded.image.width, 5609);
  EXPECT_EQ(decoded.image.height, 140);
  EXPECT_EQ(decoded.thumbnail.height, 44);
  EXPECT_EQ(decoded.original_height, 150);
}

TEST(DecodeImage, TransparencyBecomesAGroundOfContrast) {
  const cv::Scalar black(0, 0, 0, 255);
  const cv::Scalar blue(200, 60, 30, 255);
  const cv::Scalar cream(230, 246, 250, 255);
  const cv::Scalar white(255, 255, 255, 255);
  for (const auto& [print, ground] :
       {std::pair(Print(black, black), 255), std::pair(Print(blue, black), 255),
        std::pair(Print(white, white), 0), std::pair(Print(cream, blue), 0),
        std::pair(Print(white, black), 128)}) {
    const DecodeOptions options{.colour = true, .thumbnail_side_px = 32};
    const DecodedImage expected = DecodeImage(EncodeAs(OnGround(print, ground), ".png"), options);
    FileBytes webp;
    cv::imencode(".webp", print, webp, {cv::IMWRITE_WEBP_QUALITY, 101});
    for (const FileBytes& file :
         {EncodeAs(print, ".png"), webp, EncodeAs(print, ".tiff"), EncodeAs(print, ".bmp")}) {
      const DecodedImage decoded = DecodeImage(file, options);
      EXPECT_EQ(decoded.image.pixels, expected.image.pixels) << ground;
      EXPECT_EQ(decoded.thumbnail.pixels, expected.thumbnail.pixels) << ground;
    }
  }
}

TEST(DecodeImage, AKeyColourOfAGreyPngIsTransparent) {
  for (const int type : {CV_8UC1, CV_16UC1}) {
    cv::Mat grey(64, 64, type, cv::Scalar(1));
    cv::circle(grey, {32, 32}, 20, cv::Scalar(0), 6);
    const FileBytes png = testing::WithPngChunk(EncodeAs(grey, ".png"), "tRNS", {0, 1});
    const Image image = DecodeImage(png).image;
    EXPECT_EQ(At(image, 0.1, 0.1), 255);
    EXPECT_EQ(At(image, 0.5, 0.19), 0);
  }
}

TEST(DecodeImage, SixteenBitsBecomeEight) {
  const cv::Mat image(32, 32, CV_16UC1, cv::Scalar(100 * 257));
  for (const char* extension : {".png", ".tiff"}) {
    EXPECT_EQ(At(DecodeImage(EncodeAs(image, extension)).image, 0.5, 0.5), 100);
  }
}

// Cameras and scanners of 10, 12 or 14 bits leave the upper ones of 16 empty.
TEST(DecodeImage, FewerThanSixteenBitsAreStretched) {
  for (const int bits : {8, 10, 12, 14}) {
    const int white = (1 << bits) - 1;
    for (const int channels : {1, 3, 4}) {
      cv::Mat image(32, 32, CV_16UC(channels), cv::Scalar(0, 0, 0, 65535));
      image.colRange(16, 32).setTo(cv::Scalar(white, white, white, 65535));
      image.colRange(24, 32).setTo(cv::Scalar(white / 2, white / 2, white / 2, 65535));
      for (const char* extension : {".png", ".tiff"}) {
        const Image decoded = DecodeImage(EncodeAs(image, extension)).image;
        EXPECT_EQ(At(decoded, 0.25, 0.5), 0) << bits << extension;
        EXPECT_EQ(At(decoded, 0.6, 0.5), 255) << bits << extension;
        EXPECT_NEAR(At(decoded, 0.9, 0.5), 127, 1) << bits << extension;
      }
    }
  }
}

TEST(DecodeImage, ColourIsRedGreenBlue) {
  const cv::Mat blue(32, 32, CV_8UC3, cv::Scalar(255, 0, 0));
  const Image image = DecodeImage(EncodeAs(blue, ".png"), {.colour = true}).image;
  ASSERT_EQ(image.channels, 3);
  EXPECT_EQ(image.pixels[0], 0);
  EXPECT_EQ(image.pixels[2], 255);
}

TEST(EncodeImage, RoundTripsThroughPng) {
  const Image image = DecodeImage(EncodeAs(CornerImage(), ".png"), {.colour = true}).image;
  EXPECT_EQ(DecodeImage(EncodePng(image), {.colour = true}).image.pixels, image.pixels);
  EXPECT_EQ(ReadImageHeader(EncodeJpeg(image)).format, ImageFormat::kJpeg);
}

TEST(ResizeImage, RefusesNoSize) {
  const Image image = DecodeImage(EncodeAs(CornerImage(), ".png")).image;
  EXPECT_EQ(ResizeImage(image, 48, 32).pixels.size(), 48U * 32U);
  EXPECT_THROW(ResizeImage(image, 0, 32), Error);
  EXPECT_THROW(ResizeImage({}, 4, 4), Error);
}

}  // namespace
}  // namespace pliant
