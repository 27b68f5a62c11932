// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// WebP (RFC 9649): a RIFF container of VP8, VP8L or VP8X chunks.
#include <algorithm>
#include <new>
#include <vector>

#include <webp/decode.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr std::size_t kFileHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kLeastChunkBytes = 5;  // the header of a lossless image

// Calls visit(place, data's place, data's length) for each chunk until it says false. The length is
// what the chunk says.
template <typename Visit>
void WalkWebp(const ByteReader& reader, Visit visit) {
  std::size_t at = kFileHeaderBytes;
  while (const auto length = reader.U32(at + 4)) {
    const std::size_t data = at + kChunkHeaderBytes;
    if (!visit(at, data, std::size_t{*length})) return;
    at = data + *length + (*length & 1);
  }
}

// The data of the first EXIF chunk, empty for none.
Bytes FindExif(Bytes bytes) {
  const ByteReader reader(bytes, false);
  Bytes exif;
  WalkWebp(reader, [&](std::size_t at, std::size_t data, std::size_t length) {
    if (!reader.StartsWith(at, "EXIF")) return true;
    const Bytes rest = reader.From(data + (reader.StartsWith(data, "Exif") ? 6 : 0));
    exif = rest.first(std::min(rest.size(), length));
    return false;
  });
  return exif;
}

// libwebp refuses files that are shorter than their container says, and reads no longer than that.
// The pixels' chunk counts: this gives the file, or a copy whose container is long enough for it.
Bytes WithRightLength(Bytes bytes, std::vector<std::uint8_t>& copy) {
  constexpr std::size_t kLengthAt = 4;
  const ByteReader reader(bytes, false);
  std::size_t end = kFileHeaderBytes;
  WalkWebp(reader, [&](std::size_t at, std::size_t data, std::size_t length) {
    const bool pixels = reader.StartsWith(at, "VP8 ") || reader.StartsWith(at, "VP8L");
    if (pixels) end = data + length;
    return !pixels;
  });
  const std::size_t said = std::size_t{reader.U32(kLengthAt).value_or(0)} + kChunkHeaderBytes;
  if (bytes.size() < kFileHeaderBytes || (said >= end && said <= bytes.size())) return bytes;
  const std::size_t length = std::max(end, bytes.size()) - kChunkHeaderBytes;
  copy.assign(bytes.begin(), bytes.end());
  for (unsigned i = 0; i < 4; ++i) copy[kLengthAt + i] = static_cast<std::uint8_t>(length >> 8 * i);
  return copy;
}

}  // namespace

ScannedImage ScanWebp(Bytes bytes) {
  // libwebp's own copy in four channels, its result, and that without transparency.
  constexpr int kPixelBytes = 4 + 4 + 3;
  ScannedImage scanned{.header = {.format = ImageFormat::kWebp}, .pixel_bytes = kPixelBytes};
  std::vector<std::uint8_t> copy;
  const Bytes file = WithRightLength(bytes, copy);
  const ByteReader reader(file, false);
  WebPBitstreamFeatures features{};
  const VP8StatusCode status = WebPGetFeatures(file.data(), file.size(), &features);
  if (status == VP8_STATUS_NOT_ENOUGH_DATA) return scanned;
  // libwebp takes a file whose first chunk is another one for an image without container.
  if (status != VP8_STATUS_OK || !reader.StartsWith(kFileHeaderBytes, "VP8")) {
    scanned.defect = "its first chunk is not an image";
  } else if (reader.U32(kFileHeaderBytes + 4).value_or(0) < kLeastChunkBytes) {
    scanned.defect = "its first chunk is too short to be an image";
  }
  scanned.header.width = features.width;
  scanned.header.height = features.height;
  scanned.header.exif_orientation = ReadOrientation(FindExif(file));
  return scanned;
}

cv::Mat DecodeWebp(Bytes bytes, const ImageHeader& header, bool /*colour*/, int /*reduction*/) {
  std::vector<std::uint8_t> copy;
  const Bytes file = WithRightLength(bytes, copy);
  WebPDecoderConfig config;
  if (WebPInitDecoderConfig(&config) == 0 ||
      WebPGetFeatures(file.data(), file.size(), &config.input) != VP8_STATUS_OK) {
    ThrowUndecodable();
  }
  const bool alpha = config.input.has_alpha != 0;
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width),
                 alpha ? CV_8UC4 : CV_8UC3);
  config.output.colorspace = alpha ? MODE_BGRA : MODE_BGR;
  config.output.is_external_memory = 1;
  config.output.u.RGBA = {pixels.data, static_cast<int>(pixels.step),
                          pixels.total() * pixels.elemSize()};
  const VP8StatusCode status = WebPDecode(file.data(), file.size(), &config);
  if (status == VP8_STATUS_OUT_OF_MEMORY) throw std::bad_alloc();
  if (status == VP8_STATUS_NOT_ENOUGH_DATA || status == VP8_STATUS_SUSPENDED) {
    ThrowTruncated(kRowsMissing);
  }
  if (status != VP8_STATUS_OK) {
    ThrowUndecodable(config.input.has_animation != 0 ? "an animation" : "");
  }
  return pixels;
}

}  // namespace pliant
