// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decoding of images: type by content, limits before decoding, EXIF orientation applied.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace pliant {

using Bytes = std::span<const std::uint8_t>;

// An 8-bit image, row-major, interleaved, `channels` 1 (grey) or 3 (R, G, B).
// Pixel centres are at integer coordinates: the top-left pixel's centre is (0, 0).
struct Image {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<std::uint8_t> pixels;  // height x width x channels

  bool empty() const { return pixels.empty(); }
};

// A rectangle in pixels of an image. It can extend beyond the image. Pixel centres are at integer
// coordinates: the first pixel of the image extends from -0.5 to 0.5.
struct Region {
  double x = 0, y = 0, width = 0, height = 0;
};

// A rectangle of whole pixels.
struct PixelBox {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

inline bool Contains(const Region& region, double x, double y) {
  return x >= region.x && x < region.x + region.width && y >= region.y &&
         y < region.y + region.height;
}

// The region of a whole image.
inline Region FrameOf(int width, int height) { return {-0.5, -0.5, width + 0.0, height + 0.0}; }

// The same region after the image is scaled.
inline Region Scaled(const Region& region, double scale) {
  return {(region.x + 0.5) * scale - 0.5, (region.y + 0.5) * scale - 0.5, region.width * scale,
          region.height * scale};
}

// The same region in pixels of a cut-out of the image whose first pixel is (left, top).
inline Region SeenFrom(const Region& region, int left, int top) {
  return {region.x - left, region.y - top, region.width, region.height};
}

enum class ImageFormat { kUnknown, kJpeg, kPng, kWebp, kBmp, kTiff, kGif, kHeic, kAvif };

// The formats that Pliant reads, as sentences name them.
inline constexpr const char* kImageFormats = "JPEG, PNG, WebP, HEIC, AVIF, GIF, BMP or TIFF";

// The content of the header, without decoding. Width and height are before EXIF orientation.
struct ImageHeader {
  ImageFormat format = ImageFormat::kUnknown;
  std::int64_t width = 0;
  std::int64_t height = 0;
  int exif_orientation = 1;  // 1..8; 1 = upright
};

struct DecodeOptions {
  int max_side_px = 1024;                       // see ScaleToFit; 0 = no limit
  std::int64_t max_pixels = 100'000'000;        // checked in the header, before decoding
  std::int64_t max_bytes = 64LL * 1024 * 1024;  // of the encoded file
  // Limit of memory for decoding, estimated from the header. 100 megapixels of baseline JPEG need
  // little, of 16-bit colour with transparency 1.2 GB.
  std::int64_t max_decode_bytes = 1LL << 30;
  int min_side_px = 16;       // smaller images are refused
  bool colour = false;        // decode to 3 channels instead of 1
  int thumbnail_side_px = 0;  // of an additional thumbnail, as max_side_px; 0 = none
};

struct DecodedImage {
  Image image;             // upright, at most max_side_px
  Image thumbnail = {};    // upright, 3 channels, scaled to thumbnail_side_px; empty for none
  int original_width = 0;  // upright, before scaling
  int original_height = 0;
  double scale = 1.0;  // image width / original width
  ImageFormat format = ImageFormat::kUnknown;
};

// Type by content ("magic" bytes), never by name. kUnknown if no type matches.
ImageFormat SniffFormat(Bytes bytes);

// Reads only the header. Throws Error: kUnprocessable "image_empty", "image_truncated";
// kUnsupportedMediaType "image_type_unknown".
ImageHeader ReadImageHeader(Bytes bytes);

// Decodes, turns upright and scales. Throws as ReadImageHeader does, and kTooLarge
// "image_too_large" (bytes, pixels or memory), kUnprocessable "image_too_small", "image_corrupt",
// "image_truncated" (incomplete images are refused, never padded with grey); std::bad_alloc.
// Thread-safe.
DecodedImage DecodeImage(Bytes bytes, const DecodeOptions& options = {});

// DecodeImage, or a function that does the same in another process. Thread-safe; throws the same.
using ImageDecoder = std::function<DecodedImage(Bytes bytes, const DecodeOptions& options)>;

// A size scaled down to a longer side of at most `max_side_px` pixels; 0 = not scaled. Panoramas,
// which are over four times as long as wide, keep up to a quarter of that as their shorter side,
// and no more pixels than an image of 4:3.
struct ScaledSize {
  int width = 0;
  int height = 0;
  double scale = 1.0;
};
ScaledSize ScaleToFit(int width, int height, int max_side_px);

// "image/jpeg" and so on; "application/octet-stream" for kUnknown.
std::string MediaType(ImageFormat format);

// Encodes as JPEG (quality 1..100) or PNG. Throws kInternal; std::bad_alloc.
std::vector<std::uint8_t> EncodeJpeg(const Image& image, int quality = 90);
std::vector<std::uint8_t> EncodePng(const Image& image);
// A PNG of 16 bits: width x height x 3 values, row-major.
std::vector<std::uint8_t> EncodeDeepPng(int width, int height,
                                        std::span<const std::uint16_t> values);

// The grey values (0.299 R + 0.587 G + 0.114 B) of a colour image; a copy of a grey one.
Image ToGrey(const Image& image);

// The pixels in the box, which must lie within the image.
Image CutOut(const Image& image, const PixelBox& box);

// Scales to exactly width x height: bicubic to a larger image, otherwise by averaging areas.
Image ResizeImage(const Image& image, int width, int height);

// Left and right exchanged.
Image MirrorImage(const Image& image);

// Before a process restricts itself to open no files: loads the plugins of the decoders. From now
// on ResizeImage starts no threads.
void PrepareForSandbox();

}  // namespace pliant
