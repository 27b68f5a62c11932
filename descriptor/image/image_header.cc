// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image_header.h"

#include "descriptor/base/error.h"
#include "descriptor/image/byte_reader.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowTruncated(const std::string& what) {
  throw Error(ErrorCode::kUnprocessable, "image_truncated",
              "The image is cut short: " + what + ". Send the whole file.");
}

[[noreturn]] void ThrowDefect(const ScannedImage& scanned) {
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image is refused: " + scanned.defect + ". Save it again as JPEG or PNG.");
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
              "The file is no image of a type that Pliant reads. Send JPEG, PNG, WebP, BMP "
              "or TIFF.");
}

cv::Mat Decode(Bytes bytes, const ImageHeader& header, bool colour, int reduction) {
  switch (header.format) {
    case ImageFormat::kJpeg:
      return DecodeJpeg(bytes, colour, reduction);
    case ImageFormat::kPng:
      return DecodePng(bytes);
    case ImageFormat::kWebp:
      return DecodeWebp(bytes, header);
    case ImageFormat::kBmp:
      return DecodeBmp(bytes);
    case ImageFormat::kTiff:
      return DecodeTiff(bytes, header);
    case ImageFormat::kUnknown:
      break;
  }
  ThrowUndecodable();
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
                "The image is empty (0 bytes). Send the file's content.");
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
  if (!scanned.defect.empty()) ThrowDefect(scanned);
}

void ThrowUndecodable(const std::string& detail) {
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image cannot be decoded: its data are damaged or of a kind that is not read" +
                  (detail.empty() ? detail : " (" + detail + ")") +
                  ". Save it again as JPEG or PNG.");
}

cv::Mat DecodePixels(Bytes bytes, const ImageHeader& header, bool colour, int reduction) {
  cv::Mat pixels = Decode(bytes, header, colour, reduction);
  const auto reduced = [&](std::int64_t side) { return (side + reduction - 1) / reduction; };
  if (pixels.cols == reduced(header.width) && pixels.rows == reduced(header.height)) return pixels;
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image contradicts itself: its header says " + std::to_string(header.width) +
                  " x " + std::to_string(header.height) + " pixels, its data are of " +
                  std::to_string(pixels.cols) + " x " + std::to_string(pixels.rows) +
                  ". Save it again as JPEG or PNG.");
}

}  // namespace pliant
