// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image_header.h"

#include <algorithm>
#include <array>
#include <bit>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowDefect(const ScannedImage& scanned) {
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image is refused: " + scanned.defect + ". Save it again as JPEG or PNG.");
}

// What reads each format, in the order of ImageFormat.
struct Reader {
  ScannedImage (*scan)(Bytes bytes);
  cv::Mat (*decode)(Bytes bytes, const ImageHeader& header, bool colour, int reduction);
};
constexpr std::array kReaders = {
    Reader{nullptr, nullptr},     Reader{ScanJpeg, DecodeJpeg}, Reader{ScanPng, DecodePng},
    Reader{ScanWebp, DecodeWebp}, Reader{ScanBmp, DecodeBmp},   Reader{ScanTiff, DecodeTiff},
    Reader{ScanGif, DecodeGif},   Reader{ScanHeif, DecodeHeif}, Reader{ScanHeif, DecodeHeif}};

const Reader& ReaderOf(ImageFormat format) { return kReaders[static_cast<std::size_t>(format)]; }

// By the brands in the first box (ISO/IEC 14496-12, 4.3): AVIF names the general ones, too. Videos
// have others.
ImageFormat HeifFormat(const ByteReader& reader) {
  if (!reader.StartsWith(4, "ftyp")) return ImageFormat::kUnknown;
  constexpr std::size_t kMostBytes = 64;
  const std::size_t end =
      std::min(std::size_t{ByteReader(reader.From(0), true).U32(0).value_or(0)}, kMostBytes);
  ImageFormat format = ImageFormat::kUnknown;
  for (std::size_t at = 8; at + 4 <= end; at += at == 8 ? 8 : 4) {  // a version stands between
    for (const char* brand : {"avif", "avis"}) {
      if (reader.StartsWith(at, brand)) return ImageFormat::kAvif;
    }
    for (const char* brand : {"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1"}) {
      if (reader.StartsWith(at, brand)) format = ImageFormat::kHeic;
    }
  }
  return format;
}

}  // namespace

ImageFormat SniffFormat(Bytes bytes) {
  const ByteReader reader(bytes, false);
  if (reader.StartsWith(0, "\xFF\xD8\xFF")) return ImageFormat::kJpeg;
  if (reader.StartsWith(0, "\x89PNG\r\n\x1A\n")) return ImageFormat::kPng;
  if (reader.StartsWith(0, "RIFF") && reader.StartsWith(8, "WEBP")) return ImageFormat::kWebp;
  for (const std::uint32_t tiff : {0x002A4949U, 0x2A004D4DU, 0x002B4949U, 0x2B004D4DU}) {
    if (reader.U32(0) == tiff) return ImageFormat::kTiff;  // 2B is BigTIFF
  }
  if (reader.StartsWith(0, "BM") && reader.U32(14).value_or(12) <= 124) return ImageFormat::kBmp;
  if (reader.StartsWith(0, "GIF87a") || reader.StartsWith(0, "GIF89a")) return ImageFormat::kGif;
  return HeifFormat(reader);
}

int ReadOrientation(Bytes exif) {
  constexpr std::uint16_t kOrientation = 0x0112;
  constexpr std::uint16_t kShort = 3;
  constexpr std::uint16_t kLong = 4;
  constexpr std::size_t kEntryBytes = 12;  // tag, type, count, value
  const ByteReader reader(exif, ByteReader(exif, false).StartsWith(0, "MM"));
  if (reader.U16(2) != std::uint16_t{42}) return 1;
  const std::size_t directory = reader.U32(4).value_or(0);
  const std::size_t entries = reader.U16(directory).value_or(0);
  for (std::size_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + i * kEntryBytes;
    if (reader.U16(entry) != kOrientation) continue;
    if (reader.U32(entry + 4) != 1U) return 1;
    const std::uint16_t type = reader.U16(entry + 2).value_or(0);
    const std::uint32_t value = type == kShort  ? reader.U16(entry + 8).value_or(0)
                                : type == kLong ? reader.U32(entry + 8).value_or(0)
                                                : 1;
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

cv::Mat ToEightBits(const cv::Mat& deep) {
  constexpr int kMostUnusual = 14;  // an image of 16 bits has something brighter than a quarter
  const int channels = deep.channels();
  const int values = deep.cols * channels;
  const auto kind = [&](int i) { return channels == 4 && i % 4 == 3 ? 1U : 0U; };  // 1: alpha
  std::array<unsigned, 2> used = {};
  for (int y = 0; y < deep.rows; ++y) {
    const auto* row = deep.ptr<std::uint16_t>(y);
    for (int i = 0; i < values; ++i) used[kind(i)] |= row[i];
  }
  std::array<float, 2> scales{};
  for (std::size_t i = 0; i < 2; ++i) {
    const int bits = std::max(8, static_cast<int>(std::bit_width(used[i])));
    scales[i] = 255.0F / static_cast<float>((1U << (bits <= kMostUnusual ? bits : 16)) - 1);
  }
  cv::Mat pixels(deep.size(), CV_8UC(channels));
  for (int y = 0; y < deep.rows; ++y) {
    const auto* from = deep.ptr<std::uint16_t>(y);
    std::uint8_t* to = pixels.ptr(y);
    for (int i = 0; i < values; ++i) {
      to[i] = static_cast<std::uint8_t>(static_cast<float>(from[i]) * scales[kind(i)] + 0.5F);
    }
  }
  return pixels;
}

ScannedImage ScanImage(Bytes bytes) {
  if (bytes.empty()) {
    throw Error(ErrorCode::kUnprocessable, "image_empty",
                "The image is empty (0 bytes). Send the file's content.");
  }
  const ImageFormat format = SniffFormat(bytes);
  if (format == ImageFormat::kUnknown) {
    throw Error(ErrorCode::kUnsupportedMediaType, "image_type_unknown",
                std::string("The file type is not supported. Send ") + kImageFormats + ".");
  }
  const ScannedImage scanned = ReaderOf(format).scan(bytes);
  if (!scanned.defect.empty()) ThrowDefect(scanned);  // its size may be any
  if (scanned.header.width <= 0 || scanned.header.height <= 0) {
    ThrowTruncated("its header gives no size");
  }
  return scanned;
}

ImageHeader ReadImageHeader(Bytes bytes) { return ScanImage(bytes).header; }

void CheckStructure(Bytes bytes, ScannedImage& scanned) {
  if (scanned.header.format == ImageFormat::kJpeg) CheckJpegScans(bytes, scanned);
  if (!scanned.complete) ThrowTruncated(kRowsMissing);
  if (!scanned.defect.empty()) ThrowDefect(scanned);
}

void ThrowTruncated(const std::string& what) {
  throw Error(ErrorCode::kUnprocessable, "image_truncated",
              "The image is cut short: " + what + ". Send the whole file.");
}

void ThrowUndecodable(const std::string& detail) {
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image cannot be decoded: its data is damaged or not supported" +
                  (detail.empty() ? detail : " (" + detail + ")") +
                  ". Save it again as JPEG or PNG.");
}

cv::Mat DecodePixels(Bytes bytes, const ImageHeader& header, bool colour, int reduction) {
  cv::Mat pixels = ReaderOf(header.format).decode(bytes, header, colour, reduction);
  const auto reduced = [&](std::int64_t side) { return (side + reduction - 1) / reduction; };
  if (pixels.cols == reduced(header.width) && pixels.rows == reduced(header.height)) return pixels;
  throw Error(ErrorCode::kUnprocessable, "image_corrupt",
              "The image is damaged: its header says " + std::to_string(header.width) + " x " +
                  std::to_string(header.height) + " pixels, but its data has " +
                  std::to_string(pixels.cols) + " x " + std::to_string(pixels.rows) +
                  ". Save it again as JPEG or PNG.");
}

}  // namespace pliant
