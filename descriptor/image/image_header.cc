// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image_header.h"

#include "descriptor/base/error.h"
#include "descriptor/image/byte_reader.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowTruncated(const std::string& what) {
  throw Error(ErrorCode::kUnprocessable, "image_truncated",
              "The picture is cut short: " + what + ". Send the whole file.");
}

[[noreturn]] void ThrowDefect(const ScannedImage& scanned) {
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The picture is refused: " + scanned.defect + ". Save it again as JPEG or PNG.");
}

// What a format knows of its files.
struct Format {
  ScannedImage (*scan)(Bytes bytes);
  void (*check_data)(Bytes bytes, ScannedImage& scanned) = nullptr;  // what scanning left out
  std::vector<std::uint8_t> (*without_metadata)(Bytes bytes) = nullptr;
};

// Null for kUnknown.
const Format* FormatOf(ImageFormat format) {
  static constexpr Format kJpeg{ScanJpeg, CheckJpegScans, JpegWithoutMetadata};
  static constexpr Format kPng{ScanPng, CheckPngData, PngWithoutMetadata};
  static constexpr Format kWebp{ScanWebp, nullptr, WebpWithoutMetadata};
  static constexpr Format kBmp{ScanBmp};
  static constexpr Format kTiff{ScanTiff};
  switch (format) {
    case ImageFormat::kJpeg:
      return &kJpeg;
    case ImageFormat::kPng:
      return &kPng;
    case ImageFormat::kWebp:
      return &kWebp;
    case ImageFormat::kBmp:
      return &kBmp;
    case ImageFormat::kTiff:
      return &kTiff;
    case ImageFormat::kUnknown:
      break;
  }
  return nullptr;
}

}  // namespace

ImageFormat SniffFormat(Bytes bytes) {
  const ByteReader reader(bytes, false);
  if (reader.StartsWith(0, "\xFF\xD8\xFF")) return ImageFormat::kJpeg;
  if (reader.StartsWith(0, "\x89PNG\r\n\x1A\n")) return ImageFormat::kPng;
  if (reader.StartsWith(0, "RIFF") && reader.StartsWith(8, "WEBP")) return ImageFormat::kWebp;
  if (reader.U32(0) == 0x002A4949U || reader.U32(0) == 0x2A004D4DU) return ImageFormat::kTiff;
  if (reader.StartsWith(0, "BM") && reader.U32(14).value_or(12) <= 124) return ImageFormat::kBmp;
  return ImageFormat::kUnknown;
}

ScannedImage ScanImage(Bytes bytes) {
  if (bytes.empty()) {
    throw Error(ErrorCode::kUnprocessable, "image_empty",
                "The picture is empty (0 bytes). Send the file's content.");
  }
  const Format* format = FormatOf(SniffFormat(bytes));
  if (format == nullptr) {
    throw Error(ErrorCode::kUnsupportedMediaType, "image_type_unknown",
                "The file is no picture of a type that Pliant reads. Send JPEG, PNG, WebP, BMP "
                "or TIFF.");
  }
  const ScannedImage scanned = format->scan(bytes);
  if (!scanned.defect.empty()) ThrowDefect(scanned);  // its size may be any
  if (scanned.header.width <= 0 || scanned.header.height <= 0) {
    ThrowTruncated("its header gives no size");
  }
  return scanned;
}

ImageHeader ReadImageHeader(Bytes bytes) { return ScanImage(bytes).header; }

void CheckStructure(Bytes bytes, ScannedImage& scanned) {
  const Format* format = FormatOf(scanned.header.format);
  const bool checks = format != nullptr && format->check_data != nullptr;
  if (scanned.complete && checks) format->check_data(bytes, scanned);
  if (!scanned.complete) ThrowTruncated("it ends before its own end mark");
  if (!scanned.defect.empty()) ThrowDefect(scanned);
}

std::vector<std::uint8_t> WithoutMetadata(Bytes bytes, ImageFormat format) {
  const Format* known = FormatOf(format);
  if (known == nullptr || known->without_metadata == nullptr) return {};
  return known->without_metadata(bytes);
}

}  // namespace pliant
