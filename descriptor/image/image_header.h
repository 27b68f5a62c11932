// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Image files, format by format. First the structure (size, completeness, cost of decoding),
// because a file of a few kilobytes can declare gigabytes. Then the pixels, by the library of the
// format: libjpeg-turbo, libpng, libwebp, libtiff, giflib, libheif; BMP needs none. Metadata are
// not decoded. Internal to the descriptor library; callers use image.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "descriptor/image/image.h"

namespace pliant {

// Bounds-checked reads of little- and big-endian numbers.
class ByteReader {
 public:
  ByteReader(Bytes bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  std::size_t size() const { return bytes_.size(); }

  std::optional<std::uint8_t> U8(std::size_t at) const {
    if (at >= bytes_.size()) return std::nullopt;
    return bytes_[at];
  }
  std::optional<std::uint16_t> U16(std::size_t at) const { return Read<std::uint16_t>(at); }
  std::optional<std::uint32_t> U32(std::size_t at) const { return Read<std::uint32_t>(at); }

  bool StartsWith(std::size_t at, const char* text) const {
    const std::size_t length = std::strlen(text);
    return at <= bytes_.size() && bytes_.size() - at >= length &&
           std::memcmp(bytes_.data() + at, text, length) == 0;
  }

  // The rest from `at` on; empty when `at` is beyond the end.
  Bytes From(std::size_t at) const { return at < bytes_.size() ? bytes_.subspan(at) : Bytes{}; }

 private:
  template <typename T>
  std::optional<T> Read(std::size_t at) const {
    if (at > bytes_.size() || bytes_.size() - at < sizeof(T)) return std::nullopt;
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      const std::size_t shift = 8 * (big_endian_ ? sizeof(T) - 1 - i : i);
      value = static_cast<T>(value | static_cast<T>(static_cast<T>(bytes_[at + i]) << shift));
    }
    return value;
  }

  Bytes bytes_;
  bool big_endian_;
};

// The result of one pass over a file's structure.
struct ScannedImage {
  ImageHeader header;
  bool complete = true;       // the file does not end before its pixels do
  std::size_t jpeg_rest = 0;  // JPEG: where the walk for the size ended; see CheckStructure
  std::string defect = {};    // why the structure is refused, "it names ..."; empty = it is not

  // Memory of decoding: bytes per pixel of the decoder's result, with its conversions to 8-bit grey
  // or colour, and additional bytes for any size of the result.
  std::int64_t pixel_bytes = 3;
  std::int64_t buffer_bytes = 0;
};

// Throws as ReadImageHeader does. Takes time linear in the file's size, with a small factor.
ScannedImage ScanImage(Bytes bytes);

// Throws Error "image_truncated" when the file ends before its pixels do, as far as that is known
// without decoding (BMP, TIFF); and "image_corrupt" for files that no camera or program writes:
// TIFF strips that overlap, a progressive JPEG of thousands of scans. Of a JPEG this walks the
// pixels' data, which ScanImage leaves out (callers check the size first), and adds the memory that
// its scans need.
void CheckStructure(Bytes bytes, ScannedImage& scanned);

// The pixels as they are stored, not turned upright, 8 bits each: grey, B, G, R, or B, G, R, A. A
// JPEG gives grey if no colour is wanted, at 1/reduction of its size (1, 2, 4, 8); the others give
// what they have. Throws Error "image_truncated" when the file ends and rows are missing (an end
// mark alone can be), and "image_corrupt", also if the decoder finds another size than the header
// says.
cv::Mat DecodePixels(Bytes bytes, const ImageHeader& header, bool colour, int reduction);

inline constexpr const char* kRowsMissing = "rows of pixels are missing";
[[noreturn]] void ThrowTruncated(const std::string& what);
[[noreturn]] void ThrowUndecodable(const std::string& detail = {});

// 8 bits of 16: grey, B, G, R, or B, G, R, A. If 14 bits or fewer are used, their largest value
// becomes white (and another's alpha opaque), as cameras and scanners of 10, 12 or 14 bits mean it.
cv::Mat ToEightBits(const cv::Mat& deep);

// The orientation (tag 0x0112) of an EXIF block, which has the form of a TIFF file (EXIF 2.3): 1 to
// 8; 1 when it is missing or makes no sense. Takes time linear in the block's size.
int ReadOrientation(Bytes exif);

// The formats' parts of the above. Only DecodeJpeg uses `colour` and `reduction`.
ScannedImage ScanJpeg(Bytes bytes);
void CheckJpegScans(Bytes bytes, ScannedImage& scanned);  // sets the defect
cv::Mat DecodeJpeg(Bytes bytes, const ImageHeader& header, bool colour, int reduction);

// The planes of a JPEG as the file keeps them: one pass over the file gives grey values and
// colours. (A progressive file takes as long to decode to grey as to colours.) Planes of colour may
// be coarser than grey, as the file has them; they and `padded` (the size of grey as they count it)
// reach beyond the image, right and below, to whole samples of colour.
struct JpegPlanes {
  cv::Mat grey;     // Y, in the image's size divided by the reduction
  cv::Size padded;  // at least that size
  cv::Mat blue;     // Cb; empty in a grey JPEG
  cv::Mat red;      // Cr
  bool damaged;     // there are warnings: decoding to grey alone may give other values
};

// As the file has it, not turned upright. `reduction`: 1, 2, 4 or 8. Nothing for JPEGs that are
// neither grey nor of Y, Cb and Cr (CMYK, RGB), whose sampling is unusual, or that cannot be
// decoded to their end. Throws std::bad_alloc. Thread-safe.
std::optional<JpegPlanes> DecodeJpegPlanes(Bytes bytes, const ImageHeader& header, int reduction);

// Scaled to `size`, as B, G, R.
cv::Mat ThumbnailOf(const JpegPlanes& planes, cv::Size size);

ScannedImage ScanPng(Bytes bytes);
cv::Mat DecodePng(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
cv::Mat DecodeDeepPng(Bytes bytes);  // with the depth that the file has, 8 or 16 bits
ScannedImage ScanWebp(Bytes bytes);
cv::Mat DecodeWebp(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
ScannedImage ScanBmp(Bytes bytes);
cv::Mat DecodeBmp(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
ScannedImage ScanTiff(Bytes bytes);
cv::Mat DecodeTiff(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
ScannedImage ScanGif(Bytes bytes);
cv::Mat DecodeGif(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
ScannedImage ScanHeif(Bytes bytes);  // HEIC and AVIF
cv::Mat DecodeHeif(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
void LoadHeifPlugins();

}  // namespace pliant
