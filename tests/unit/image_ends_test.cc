// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Image files whose ends are missing, wrong or another's: the rows of pixels count.
#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/image_reason.h"

namespace pliant {
namespace {

using testing::EncodeAs;
using testing::FileBytes;
using testing::NoiseImage;
using testing::ReasonOf;

FileBytes Jpeg(const std::vector<int>& parameters = {}) {
  FileBytes bytes;
  cv::imencode(".jpg", NoiseImage(160, 120, 5), bytes, parameters);
  return bytes;
}

FileBytes Without(FileBytes bytes, std::size_t last) {
  bytes.resize(bytes.size() - last);
  return bytes;
}

FileBytes With(FileBytes bytes, const std::string& behind) {
  bytes.insert(bytes.end(), behind.begin(), behind.end());
  return bytes;
}

// Where two bytes in the middle of a JPEG's pixels can be replaced by a marker.
std::size_t Middle(const FileBytes& jpeg) {
  std::size_t at = jpeg.size() * 2 / 3;
  while (std::find(jpeg.begin() + at - 2, jpeg.begin() + at + 3, 0xFF) != jpeg.begin() + at + 3) {
    ++at;
  }
  return at;
}

FileBytes WithMarker(FileBytes jpeg, std::uint8_t marker) {
  const std::size_t at = Middle(jpeg);
  jpeg[at] = 0xFF;
  jpeg[at + 1] = marker;
  return jpeg;
}

void ExpectSamePixels(const FileBytes& bytes, const FileBytes& as) {
  for (const bool colour : {false, true}) {
    const DecodeOptions options{.colour = colour, .thumbnail_side_px = 48};
    ASSERT_EQ(ReasonOf(bytes, options), "decoded");
    const DecodedImage decoded = DecodeImage(bytes, options);
    const DecodedImage expected = DecodeImage(as, options);
    EXPECT_EQ(decoded.image.pixels, expected.image.pixels);
    EXPECT_EQ(decoded.thumbnail.pixels, expected.thumbnail.pixels);
  }
}

// As telephones write panoramas.
const std::string kTrailer("\0\0\x30\x0A\x12\0\0\0Image_UTC_Data1446123456789SEFH\x6A\0\0\0SEFT",
                           45);

TEST(ImageEnds, AJpegNeedsNoEndMark) {
  for (const auto& parameters :
       {std::vector<int>{}, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}, {cv::IMWRITE_JPEG_OPTIMIZE, 1}}) {
    const FileBytes whole = Jpeg(parameters);
    ExpectSamePixels(Without(whole, 2), whole);
    ExpectSamePixels(Without(whole, 1), whole);
    for (const std::size_t missing : {40U, 400U, 4000U}) {
      EXPECT_EQ(ReasonOf(Without(whole, missing)), "image_truncated") << missing;
      EXPECT_EQ(ReasonOf(Without(whole, missing), {.thumbnail_side_px = 48}), "image_truncated");
    }
  }
  const FileBytes baseline = Jpeg();
  ExpectSamePixels(With(Without(baseline, 2), kTrailer), baseline);
  ExpectSamePixels(With(baseline, kTrailer), baseline);
}

TEST(ImageEnds, AProgressiveJpegIsCutBetweenItsScans) {
  const FileBytes whole = Jpeg({cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  int scans = 0;
  for (std::size_t at = 2; at + 1 < whole.size(); ++at) {
    if (whole[at] != 0xFF || whole[at + 1] != 0xDA || ++scans == 1) continue;
    const FileBytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(at));
    EXPECT_EQ(ReasonOf(cut), "image_truncated") << scans;
  }
  EXPECT_GT(scans, 3);
}

// A download that stopped, in a file that had its whole length from the beginning.
TEST(ImageEnds, ZerosAreNoPixels) {
  for (const std::vector<int>& parameters :
       {std::vector<int>{}, {cv::IMWRITE_JPEG_PROGRESSIVE, 1}}) {
    FileBytes jpeg = Jpeg(parameters);
    std::fill(jpeg.begin() + static_cast<std::ptrdiff_t>(Middle(jpeg)), jpeg.end(), 0);
    EXPECT_NE(ReasonOf(jpeg), "decoded");
    EXPECT_NE(ReasonOf(jpeg, {.thumbnail_side_px = 48}), "decoded");
  }
}

TEST(ImageEnds, AMarkerAmongThePixelsIsDamage) {
  for (const std::uint8_t marker : {0x3A, 0xD3, 0xD9, 0xE5}) {
    EXPECT_EQ(ReasonOf(WithMarker(Jpeg(), marker)), "image_corrupt") << int{marker};
  }
  // Rows behind the next restart are there.
  EXPECT_EQ(ReasonOf(WithMarker(Jpeg({cv::IMWRITE_JPEG_RST_INTERVAL, 4}), 0xD3)), "decoded");
}

TEST(ImageEnds, APngNeedsNoEndChunk) {
  constexpr std::size_t kEndBytes = 12;
  const FileBytes whole = EncodeAs(NoiseImage(160, 120, 5), ".png");
  const FileBytes cut = Without(whole, kEndBytes);
  ExpectSamePixels(cut, whole);
  ExpectSamePixels(Without(whole, 3), whole);
  ExpectSamePixels(With(cut, kTrailer), whole);
  EXPECT_EQ(ReasonOf(Without(whole, kEndBytes + 100)), "image_truncated");
  FileBytes damaged = whole;
  damaged[whole.size() - kEndBytes - 1] ^= 1;  // the checksum of the pixels' data
  EXPECT_EQ(ReasonOf(damaged), "image_corrupt");
}

TEST(ImageEnds, AWebpIsAsLongAsItsData) {
  for (const int quality : {60, 101}) {  // 101: lossless
    FileBytes whole;
    cv::imencode(".webp", NoiseImage(160, 120, 5), whole, {cv::IMWRITE_WEBP_QUALITY, quality});
    for (const int more : {-40, -2, 2, 100'000}) {
      FileBytes wrong = whole;
      const auto said = static_cast<std::uint32_t>(static_cast<int>(whole.size()) - 8 + more);
      for (unsigned i = 0; i < 4; ++i) wrong[4 + i] = static_cast<std::uint8_t>(said >> 8 * i);
      ExpectSamePixels(wrong, whole);
      EXPECT_EQ(ReasonOf(Without(wrong, 100)), "image_truncated") << more;
    }
  }
}

}  // namespace
}  // namespace pliant
