// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image_header.h"

#include <cstdlib>

#include "descriptor/base/error.h"
#include "descriptor/image/byte_reader.h"
#include "descriptor/image/tiff_directory.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowTruncated(const std::string& what) {
  throw Error(ErrorCode::kUnprocessable, "image_truncated",
              "The picture is cut short: " + what + ". Send the whole file.");
}

// JPEG (ITU T.81): a list of marker segments; entropy-coded data follows SOS.

bool IsStartOfFrame(int marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

bool HasNoPayload(int marker) { return marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8); }

// Calls visit(marker, payload) for each segment from `at` up to EOI, leaving `at` at the segment
// for which visit said false; false when the file ends before EOI. Entropy-coded data hold no
// marker by themselves: an 0xFF in them is followed by a stuffed 0x00 (B.1.1.5), so they are
// skipped bytewise.
template <typename Visit>
bool WalkJpeg(Bytes bytes, std::size_t& at, Visit visit) {
  while (at + 1 < bytes.size()) {
    if (bytes[at] != 0xFF) {  // entropy-coded data, or padding
      ++at;
      continue;
    }
    const int marker = bytes[at + 1];
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker == 0xD9) return true;  // EOI
    if (marker == 0x00 || HasNoPayload(marker)) {
      at += 2;
      continue;
    }
    const auto length = ByteReader(bytes, true).U16(at + 2);
    if (!length || *length < 2 || bytes.size() - at - 2 < *length) return false;
    if (!visit(marker, bytes.subspan(at + 4, *length - 2))) return true;
    at += 2 + *length;
  }
  return false;
}

ScannedImage ScanJpeg(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kJpeg}, .jpeg_rest = 2};
  ImageHeader& header = scanned.header;
  WalkJpeg(bytes, scanned.jpeg_rest, [&](int marker, Bytes payload) {
    const ByteReader reader(payload, true);
    if (marker == 0xE1 && payload.size() > 6 && reader.StartsWith(0, "Exif")) {
      header.exif_orientation = ReadTiffDirectory(reader.From(6)).orientation;
    }
    if (!IsStartOfFrame(marker)) return true;
    header.height = reader.U16(1).value_or(0);
    header.width = reader.U16(3).value_or(0);
    return false;
  });
  return scanned;
}

// PNG (ISO/IEC 15948): chunks of length, type, data, CRC. Calls visit(type offset, data).

template <typename Visit>
bool WalkPng(Bytes bytes, Visit visit) {
  const ByteReader reader(bytes, true);
  std::size_t at = 8;
  while (const auto length = reader.U32(at)) {
    const std::size_t data = at + 8;
    if (data > bytes.size() || bytes.size() - data < std::size_t{*length} + 4) return false;
    if (reader.StartsWith(at + 4, "IEND")) return true;
    visit(at + 4, bytes.subspan(data, *length));
    at = data + *length + 4;
  }
  return false;
}

ScannedImage ScanPng(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kPng}};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, true);
  if (!reader.StartsWith(12, "IHDR")) return scanned;
  header.width = reader.U32(16).value_or(0);
  header.height = reader.U32(20).value_or(0);
  scanned.complete = WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (reader.StartsWith(type, "eXIf")) {
      header.exif_orientation = ReadTiffDirectory(data).orientation;
    }
  });
  return scanned;
}

// WebP (RFC 9649): a RIFF container of VP8, VP8L or VP8X chunks.

void ReadWebpCanvas(const ByteReader& file, std::size_t data, ImageHeader& header) {
  const ByteReader reader(file.From(data), false);
  const auto u24 = [&](std::size_t at) {
    return std::int64_t{reader.U16(at).value_or(0)} +
           (std::int64_t{reader.U8(at + 2).value_or(0)} << 16);
  };
  if (file.StartsWith(data - 8, "VP8X")) {
    header.width = u24(4) + 1;
    header.height = u24(7) + 1;
  } else if (file.StartsWith(data - 8, "VP8L")) {
    const std::uint32_t bits = reader.U32(1).value_or(0);
    header.width = (bits & 0x3FFF) + 1;
    header.height = ((bits >> 14) & 0x3FFF) + 1;
  } else if (file.StartsWith(data - 8, "VP8 ")) {
    header.width = reader.U16(6).value_or(0) & 0x3FFF;
    header.height = reader.U16(8).value_or(0) & 0x3FFF;
  }
}

ScannedImage ScanWebp(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kWebp}};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, false);
  scanned.complete = std::uint64_t{reader.U32(4).value_or(0)} + 8 <= bytes.size();
  std::size_t at = 12;
  while (const auto length = reader.U32(at + 4)) {
    if (header.width == 0) ReadWebpCanvas(reader, at + 8, header);
    if (reader.StartsWith(at, "EXIF")) {
      const std::size_t skip = reader.StartsWith(at + 8, "Exif") ? 6 : 0;
      header.exif_orientation = ReadTiffDirectory(reader.From(at + 8 + skip)).orientation;
    }
    at += 8 + std::size_t{*length} + (*length & 1);
  }
  return scanned;
}

ScannedImage ScanBmp(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kBmp}};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, false);
  const bool core = reader.U32(14) == 12U;  // of OS/2
  if (core) {
    header.width = reader.U16(18).value_or(0);
    header.height = reader.U16(20).value_or(0);
  } else {
    header.width = static_cast<std::int32_t>(reader.U32(18).value_or(0));
    header.height = std::llabs(static_cast<std::int32_t>(reader.U32(22).value_or(0)));
  }
  const std::uint32_t compression = core ? 0 : reader.U32(30).value_or(0);
  if (compression != 0 && compression != 3) return scanned;  // run lengths: the decoder notices
  const std::int64_t bits = reader.U16(core ? 24 : 28).value_or(0);
  const std::int64_t row = (header.width * bits + 31) / 32 * 4;  // rows are padded to four bytes
  const std::int64_t offset = reader.U32(10).value_or(0);
  const auto data = static_cast<std::int64_t>(bytes.size()) - offset;
  // Divided, not multiplied: nobody has checked the size yet, and the product may overflow.
  scanned.complete = data >= 0 && (header.height == 0 || row <= data / header.height);
  return scanned;
}

ScannedImage ScanTiff(Bytes bytes) {
  const TiffDirectory directory = ReadTiffDirectory(bytes);
  ScannedImage scanned{.header = {.format = ImageFormat::kTiff,
                                  .width = directory.width,
                                  .height = directory.height,
                                  .exif_orientation = directory.orientation},
                       .complete = directory.complete};
  for (std::size_t i = 0; i < directory.data_offsets.size(); ++i) {
    const std::uint64_t size = i < directory.data_bytes.size() ? directory.data_bytes[i] : 0;
    if (directory.data_offsets[i] + size > bytes.size()) scanned.complete = false;
  }
  return scanned;
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
  if (scanned.header.width <= 0 || scanned.header.height <= 0) {
    ThrowTruncated("its header gives no size");
  }
  return scanned;
}

ImageHeader ReadImageHeader(Bytes bytes) { return ScanImage(bytes).header; }

void CheckComplete(Bytes bytes, const ScannedImage& scanned) {
  bool complete = scanned.complete;
  if (scanned.header.format == ImageFormat::kJpeg) {
    std::size_t at = scanned.jpeg_rest;
    complete = WalkJpeg(bytes, at, [](int, Bytes) { return true; });
  }
  if (!complete) ThrowTruncated("it ends before its own end mark");
}

}  // namespace pliant
