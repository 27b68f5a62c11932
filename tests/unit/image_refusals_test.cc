// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that are refused, and why.
#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::CornerImage;
using testing::EncodeAs;
using testing::FileBytes;
using testing::ReasonOf;

TEST(DecodeImage, NamesWhatIsWrong) {
  EXPECT_EQ(ReasonOf({}), "image_empty");
  EXPECT_EQ(ReasonOf({'h', 'e', 'l', 'l', 'o'}), "image_type_unknown");
  EXPECT_EQ(ReasonOf({'B', 'M'}), "image_truncated");
  EXPECT_EQ(ReasonOf(EncodeAs(CornerImage(15, 64), ".png")), "image_too_small");
  EXPECT_EQ(ReasonOf(EncodeAs(CornerImage(), ".png"), {.max_pixels = 96 * 64 - 1}),
            "image_too_large");
  EXPECT_EQ(ReasonOf(EncodeAs(CornerImage(), ".png"), {.max_bytes = 10}), "image_too_large");
  EXPECT_EQ(ReasonOf(testing::PngClaiming(97, 64)), "image_corrupt");
}

TEST(DecodeImage, RefusesABombByItsHeader) {
  EXPECT_EQ(ReasonOf(testing::PngClaiming(60'000, 60'000)), "image_too_large");
  EXPECT_EQ(ReasonOf(testing::PngClaiming(0xFFFFFFFF, 0xFFFFFFFF)), "image_too_large");
}

TEST(DecodeImage, RefusesWhatWouldTakeTooMuchMemory) {
  // 96 x 64 pixels: 3 bytes each and one of grey as PNG.
  const FileBytes png = EncodeAs(CornerImage(), ".png");
  EXPECT_EQ(ReasonOf(png, {.max_decode_bytes = 4 * 96 * 64}), "decoded");
  EXPECT_EQ(ReasonOf(png, {.max_decode_bytes = 4 * 96 * 64 - 1}), "image_too_large");
  const FileBytes jpeg = EncodeAs(CornerImage(), ".jpg");
  EXPECT_EQ(ReasonOf(jpeg, {.max_decode_bytes = 3 * 96 * 64}), "decoded");
  // Progressive: all coefficients are kept, of 16 bits; those of colours at half the size.
  FileBytes progressive;
  cv::imencode(".jpg", CornerImage(), progressive, {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_EQ(ReasonOf(progressive, {.max_decode_bytes = 3 * 96 * 64}), "image_too_large");
  EXPECT_EQ(ReasonOf(progressive, {.max_decode_bytes = 6 * 96 * 64}), "decoded");
}

// One TIFF tag again, with another value, at the place where the directory's entries end.
FileBytes WithTagTwice(FileBytes tiff, int tag, std::uint32_t value) {
  std::uint32_t directory = 0;
  std::memcpy(&directory, tiff.data() + 4, 4);
  FileBytes entry;
  testing::Append(entry, tag, 2, false);
  testing::Append(entry, 4, 2, false);
  testing::Append(entry, 1, 4, false);
  testing::Append(entry, value, 4, false);
  const std::size_t end = directory + 2 + 12 * std::size_t{tiff[directory]};
  tiff.insert(tiff.begin() + static_cast<std::ptrdiff_t>(end), entry.begin(), entry.end());
  ++tiff[directory];
  return tiff;
}

// The limits are checked with the size that the decoder believes: libtiff takes the first value.
TEST(DecodeImage, ATagThatIsThereTwiceHidesNothing) {
  cv::Mat grey;
  cv::cvtColor(CornerImage(), grey, cv::COLOR_BGR2GRAY);
  const FileBytes tiff = testing::GreyTiff(grey, 1);
  EXPECT_EQ(ReasonOf(tiff), "decoded");
  for (const int tag : {256, 257, 258, 273, 277, 278, 279}) {
    const FileBytes twice = WithTagTwice(tiff, tag, 12'000);
    const ImageHeader header = ReadImageHeader(twice);
    EXPECT_EQ(header.width, grey.cols) << tag;
    EXPECT_EQ(header.height, grey.rows) << tag;
    EXPECT_EQ(DecodeImage(twice).image.pixels, DecodeImage(tiff).image.pixels) << tag;
  }
  EXPECT_EQ(ReasonOf(WithTagTwice(tiff, 40'000, 1)), "decoded") << "an unknown tag";
}

// The header says less than the data hold: they are not unpacked behind the last row.
TEST(DecodeImage, APngHasNoMoreRowsThanItsHeaderSays) {
  const cv::Mat flat(1000, 1000, CV_8UC1, cv::Scalar(7));
  FileBytes png = EncodeAs(flat, ".png");
  const FileBytes small = testing::PngClaiming(100, 100);
  std::copy(small.begin() + 16, small.begin() + 24, png.begin() + 16);
  FileBytes crc;
  testing::Append(crc, testing::PngCrc(png.data() + 12, 17), 4, true);
  std::copy(crc.begin(), crc.end(), png.begin() + 29);
  const Image image = DecodeImage(png).image;
  EXPECT_EQ(image.width, 100);
  EXPECT_EQ(image.height, 100);
}

// libwebp reads "/" as the first byte of an image without chunks, here of 14417 x 10593 pixels.
TEST(DecodeImage, RefusesAWebpThatHidesItsSize) {
  FileBytes webp = EncodeAs(CornerImage(), ".webp");
  const std::string chunk("/P8X\x0A\0\0\0\x08\0\0\0\x13\0\0\x17\0\0", 18);
  webp.insert(webp.begin() + 12, chunk.begin(), chunk.end());
  webp[4] = static_cast<std::uint8_t>(webp[4] + chunk.size());
  EXPECT_THROW(ReadImageHeader(webp), Error);
  EXPECT_EQ(ReasonOf(webp), "image_corrupt");
}

std::string HeaderReasonOf(const FileBytes& bytes) {
  try {
    ReadImageHeader(bytes);
  } catch (const Error& e) {
    return e.reason();
  }
  return "read";
}

// What stands behind may be metadata, which are dropped: the size would be another one.
TEST(DecodeImage, RefusesAHeaderThatReachesIntoWhatStandsBehind) {
  FileBytes png = EncodeAs(CornerImage(), ".png");
  EXPECT_EQ(HeaderReasonOf(png), "read");
  png[11] = 0;  // of 13 bytes
  EXPECT_EQ(HeaderReasonOf(png), "image_corrupt");

  FileBytes webp = EncodeAs(CornerImage(), ".webp");
  EXPECT_EQ(HeaderReasonOf(webp), "read");
  for (const auto& [name, least] :
       {std::pair("VP8 ", 10), std::pair("VP8L", 5), std::pair("VP8X", 10)}) {
    std::copy_n(name, 4, webp.begin() + 12);
    std::fill_n(webp.begin() + 16, 4, std::uint8_t{0});
    webp[16] = static_cast<std::uint8_t>(least - 1);
    EXPECT_EQ(HeaderReasonOf(webp), "image_corrupt") << name;
  }
}

// OpenCV would read it as DICOM, for which none of the limits hold.
TEST(DecodeImage, RefusesAWebpThatIsDicomBeneath) {
  FileBytes webp = EncodeAs(testing::NoiseImage(80, 60, 3), ".webp");
  ASSERT_GT(webp.size(), 200U);
  webp[23] ^= 1;  // libwebp does not know it any more
  std::copy_n("DICM", 4, webp.begin() + 128);
  EXPECT_EQ(ReasonOf(webp), "image_corrupt");
}

}  // namespace
}  // namespace pliant
