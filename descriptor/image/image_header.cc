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

// Calls visit(marker, payload) for each segment up to EOI; false when the file ends before EOI.
template <typename Visit>
bool WalkJpeg(Bytes bytes, Visit visit) {
  std::size_t at = 2;
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

ImageHeader ReadJpeg(Bytes bytes) {
  ImageHeader header{.format = ImageFormat::kJpeg};
  WalkJpeg(bytes, [&](int marker, Bytes payload) {
    const ByteReader reader(payload, true);
    if (marker == 0xE1 && payload.size() > 6 && reader.StartsWith(0, "Exif")) {
      header.exif_orientation = ReadTiffDirectory(reader.From(6)).orientation;
    }
    if (!IsStartOfFrame(marker)) return true;
    header.height = reader.U16(1).value_or(0);
    header.width = reader.U16(3).value_or(0);
    return false;
  });
  return header;
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

ImageHeader ReadPng(Bytes bytes) {
  ImageHeader header{.format = ImageFormat::kPng};
  const ByteReader reader(bytes, true);
  if (!reader.StartsWith(12, "IHDR")) return header;
  header.width = reader.U32(16).value_or(0);
  header.height = reader.U32(20).value_or(0);
  WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (reader.StartsWith(type, "eXIf")) {
      header.exif_orientation = ReadTiffDirectory(data).orientation;
    }
  });
  return header;
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

ImageHeader ReadWebp(Bytes bytes) {
  ImageHeader header{.format = ImageFormat::kWebp};
  const ByteReader reader(bytes, false);
  std::size_t at = 12;
  while (const auto length = reader.U32(at + 4)) {
    if (header.width == 0) ReadWebpCanvas(reader, at + 8, header);
    if (reader.StartsWith(at, "EXIF")) {
      const std::size_t skip = reader.StartsWith(at + 8, "Exif") ? 6 : 0;
      header.exif_orientation = ReadTiffDirectory(reader.From(at + 8 + skip)).orientation;
    }
    at += 8 + std::size_t{*length} + (*length & 1);
  }
  return header;
}

ImageHeader ReadBmp(Bytes bytes) {
  ImageHeader header{.format = ImageFormat::kBmp};
  const ByteReader reader(bytes, false);
  if (reader.U32(14) == 12U) {  // OS/2 core header
    header.width = reader.U16(18).value_or(0);
    header.height = reader.U16(20).value_or(0);
  } else {
    header.width = static_cast<std::int32_t>(reader.U32(18).value_or(0));
    header.height = std::llabs(static_cast<std::int32_t>(reader.U32(22).value_or(0)));
  }
  return header;
}

ImageHeader ReadTiff(Bytes bytes) {
  const TiffDirectory directory = ReadTiffDirectory(bytes);
  return {.format = ImageFormat::kTiff,
          .width = directory.width,
          .height = directory.height,
          .exif_orientation = directory.orientation};
}

bool BmpComplete(Bytes bytes, const ImageHeader& header) {
  const ByteReader reader(bytes, false);
  const bool core = reader.U32(14) == 12U;
  const std::uint32_t compression = core ? 0 : reader.U32(30).value_or(0);
  if (compression != 0 && compression != 3) return true;  // run lengths: the decoder notices
  const std::int64_t bits = reader.U16(core ? 24 : 28).value_or(0);
  const std::int64_t row = (header.width * bits + 31) / 32 * 4;
  const std::int64_t offset = reader.U32(10).value_or(0);
  return offset + row * header.height <= static_cast<std::int64_t>(bytes.size());
}

bool TiffComplete(Bytes bytes) {
  const TiffDirectory directory = ReadTiffDirectory(bytes);
  if (!directory.complete) return false;
  for (std::size_t i = 0; i < directory.data_offsets.size(); ++i) {
    const std::uint64_t size = i < directory.data_bytes.size() ? directory.data_bytes[i] : 0;
    if (directory.data_offsets[i] + size > bytes.size()) return false;
  }
  return true;
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

ImageHeader ReadImageHeader(Bytes bytes) {
  if (bytes.empty()) {
    throw Error(ErrorCode::kUnprocessable, "image_empty",
                "The picture is empty (0 bytes). Send the file's content.");
  }
  ImageHeader header;
  switch (SniffFormat(bytes)) {
    case ImageFormat::kJpeg:
      header = ReadJpeg(bytes);
      break;
    case ImageFormat::kPng:
      header = ReadPng(bytes);
      break;
    case ImageFormat::kWebp:
      header = ReadWebp(bytes);
      break;
    case ImageFormat::kBmp:
      header = ReadBmp(bytes);
      break;
    case ImageFormat::kTiff:
      header = ReadTiff(bytes);
      break;
    case ImageFormat::kUnknown:
      throw Error(ErrorCode::kUnsupportedMediaType, "image_type_unknown",
                  "The file is no picture of a type that Pliant reads. Send JPEG, PNG, WebP, BMP "
                  "or TIFF.");
  }
  if (header.width <= 0 || header.height <= 0) ThrowTruncated("its header gives no size");
  return header;
}

void CheckComplete(Bytes bytes, ImageFormat format) {
  bool complete = true;
  switch (format) {
    case ImageFormat::kJpeg:
      complete = WalkJpeg(bytes, [](int, Bytes) { return true; });
      break;
    case ImageFormat::kPng:
      complete = WalkPng(bytes, [](std::size_t, Bytes) {});
      break;
    case ImageFormat::kWebp:
      complete = std::uint64_t{ByteReader(bytes, false).U32(4).value_or(0)} + 8 <= bytes.size();
      break;
    case ImageFormat::kBmp:
      complete = BmpComplete(bytes, ReadBmp(bytes));
      break;
    case ImageFormat::kTiff:
      complete = TiffComplete(bytes);
      break;
    case ImageFormat::kUnknown:
      break;
  }
  if (!complete) ThrowTruncated("it ends before its own end mark");
}

}  // namespace pliant
