// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// WebP (RFC 9649): a RIFF container of VP8, VP8L or VP8X chunks.
#include <algorithm>

#include <webp/decode.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr std::size_t kFileHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kLeastChunkBytes = 5;  // the header of a lossless image

// The data of the first EXIF chunk, empty for none.
Bytes FindExif(Bytes bytes) {
  const ByteReader reader(bytes, false);
  std::size_t at = kFileHeaderBytes;
  while (const auto length = reader.U32(at + 4)) {
    const std::size_t data = at + kChunkHeaderBytes;
    if (reader.StartsWith(at, "EXIF")) {
      const Bytes rest = reader.From(data + (reader.StartsWith(data, "Exif") ? 6 : 0));
      return rest.first(std::min<std::size_t>(rest.size(), *length));
    }
    at = data + *length + (*length & 1);
  }
  return {};
}

}  // namespace

ScannedImage ScanWebp(Bytes bytes) {
  // libwebp's own copy in four channels, its result, and that without transparency.
  constexpr int kPixelBytes = 4 + 4 + 3;
  ScannedImage scanned{.header = {.format = ImageFormat::kWebp}, .pixel_bytes = kPixelBytes};
  const ByteReader reader(bytes, false);
  WebPBitstreamFeatures features;
  const VP8StatusCode status = WebPGetFeatures(bytes.data(), bytes.size(), &features);
  if (status == VP8_STATUS_NOT_ENOUGH_DATA) return scanned;
  // libwebp takes a file whose first chunk is another one for an image without container.
  if (status != VP8_STATUS_OK || !reader.StartsWith(kFileHeaderBytes, "VP8")) {
    scanned.defect = "its first chunk is not an image";
  } else if (reader.U32(kFileHeaderBytes + 4).value_or(0) < kLeastChunkBytes) {
    scanned.defect = "its first chunk is too short to be an image";
  }
  scanned.header.width = features.width;
  scanned.header.height = features.height;
  scanned.header.exif_orientation = ReadOrientation(FindExif(bytes));
  scanned.complete = std::uint64_t{reader.U32(4).value_or(0)} + 8 <= bytes.size();
  return scanned;
}

cv::Mat DecodeWebp(Bytes bytes, const ImageHeader& header, bool /*colour*/, int /*reduction*/) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK) ThrowUndecodable();
  const bool alpha = features.has_alpha != 0;
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width),
                 alpha ? CV_8UC4 : CV_8UC3);
  const auto decode = alpha ? WebPDecodeBGRAInto : WebPDecodeBGRInto;
  if (decode(bytes.data(), bytes.size(), pixels.data, pixels.total() * pixels.elemSize(),
             static_cast<int>(pixels.step)) == nullptr) {
    ThrowUndecodable(features.has_animation != 0 ? "an animation" : "");
  }
  return pixels;
}

}  // namespace pliant
