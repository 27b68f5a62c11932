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

ScannedImage Scan(Bytes bytes) {
  switch (SniffFormat(bytes)) {
    case ImageFormat::kJpeg:
      return ScanJpeg(bytes);
    case ImageFormat::kPng:
      return ScanPng(bytes);
    case ImageFormat::kWebp:
      return ScanWebp(bytes);
    case ImageFormat::kBmp:
      return ScanBmp(bytes);
    case ImageFormat::kTiff:
      return ScanTiff(bytes);
    case ImageFormat::kUnknown:
      break;
  }
  throw Error(ErrorCode::kUnsupportedMediaType, "image_type_unknown",
              "The file is no picture of a type that Pliant reads. Send JPEG, PNG, WebP, BMP "
              "or TIFF.");
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
  const ScannedImage scanned = Scan(bytes);
  if (!scanned.defect.empty()) ThrowDefect(scanned);  // its size may be any
  if (scanned.header.width <= 0 || scanned.header.height <= 0) {
    ThrowTruncated("its header gives no size");
  }
  return scanned;
}

ImageHeader ReadImageHeader(Bytes bytes) { return ScanImage(bytes).header; }

void CheckStructure(Bytes bytes, ScannedImage& scanned) {
  if (scanned.header.format == ImageFormat::kJpeg) CheckJpegScans(bytes, scanned);
  if (!scanned.complete) ThrowTruncated("it ends before its own end mark");
  if (scanned.header.format == ImageFormat::kPng) CheckPngData(bytes, scanned);
  if (!scanned.defect.empty()) ThrowDefect(scanned);
}

std::vector<std::uint8_t> WithoutMetadata(Bytes bytes, ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return JpegWithoutMetadata(bytes);
    case ImageFormat::kPng:
      return PngWithoutMetadata(bytes);
    case ImageFormat::kWebp:
      return WebpWithoutMetadata(bytes);
    case ImageFormat::kBmp:
    case ImageFormat::kTiff:
    case ImageFormat::kUnknown:
      break;
  }
  return {};
}

}  // namespace pliant
