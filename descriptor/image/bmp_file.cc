// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// BMP: a file header, an information header of one of several lengths, rows of pixels.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr std::size_t kFileHeaderBytes = 14;
constexpr std::uint32_t kCoreBytes = 12;  // information header of OS/2
constexpr std::uint32_t kInfoBytes = 40;  // of Windows; later ones are longer
constexpr std::size_t kMasksAt = kFileHeaderBytes + kInfoBytes;

enum Compression : std::uint32_t {
  kPlain = 0,
  kRuns8 = 1,
  kRuns4 = 2,
  kBitFields = 3,
  kAlphaBitFields = 6,
};

// What the headers say.
struct Layout {
  std::int64_t width = 0;
  std::int64_t height = 0;
  bool top_down = false;
  int bits = 0;
  std::uint32_t compression = kPlain;
  std::int64_t pixels_at = 0;
  std::size_t palette_at = 0;
  std::size_t palette_entry_bytes = 4;
  std::array<std::uint32_t, 4> masks = {};  // red, green, blue, alpha

  bool runs() const { return compression == kRuns8 || compression == kRuns4; }
  bool alpha() const { return masks[3] != 0; }
  std::int64_t used_row_bytes() const { return (width * bits + 7) / 8; }
  std::int64_t row_bytes() const { return (width * bits + 31) / 32 * 4; }
};

Layout ReadLayout(const ByteReader& reader) {
  Layout layout;
  const std::uint32_t header_bytes = reader.U32(kFileHeaderBytes).value_or(0);
  const bool core = header_bytes == kCoreBytes;
  layout.pixels_at = reader.U32(10).value_or(0);
  if (core) {
    layout.width = reader.U16(18).value_or(0);
    layout.height = reader.U16(20).value_or(0);
  } else {
    const auto height = static_cast<std::int32_t>(reader.U32(22).value_or(0));
    layout.width = static_cast<std::int32_t>(reader.U32(18).value_or(0));
    layout.height = std::llabs(height);
    layout.top_down = height < 0;
    layout.compression = reader.U32(30).value_or(0);
  }
  layout.bits = reader.U16(core ? 24 : 28).value_or(0);
  const bool fields = layout.compression == kBitFields || layout.compression == kAlphaBitFields;
  std::size_t masks_behind_header = 0;
  if (fields) {
    for (std::size_t i = 0; i < 3; ++i) layout.masks[i] = reader.U32(kMasksAt + 4 * i).value_or(0);
    // The header of 52 bytes is the one with masks but none of alpha.
    if (layout.compression == kAlphaBitFields || header_bytes > 52) {
      layout.masks[3] = reader.U32(kMasksAt + 12).value_or(0);
    }
    if (header_bytes == kInfoBytes) {
      masks_behind_header = layout.compression == kAlphaBitFields ? 16 : 12;
    }
  } else if (layout.bits == 16) {
    layout.masks = {0x7C00, 0x03E0, 0x001F, 0};
  } else {  // many programs keep alpha in the byte that 32 bits have left
    layout.masks = {0xFF0000, 0xFF00, 0xFF, layout.bits == 32 ? 0xFF000000 : 0};
  }
  layout.palette_at = kFileHeaderBytes + header_bytes + masks_behind_header;
  if (core) layout.palette_entry_bytes = 3;
  return layout;
}

bool CanDecode(const Layout& layout) {
  switch (layout.compression) {
    case kPlain:
      return layout.bits == 1 || layout.bits == 4 || layout.bits == 8 || layout.bits == 16 ||
             layout.bits == 24 || layout.bits == 32;
    case kRuns8:
      return layout.bits == 8 && !layout.top_down;
    case kRuns4:
      return layout.bits == 4 && !layout.top_down;
    case kBitFields:
    case kAlphaBitFields:
      return (layout.bits == 16 || layout.bits == 32) &&
             std::all_of(layout.masks.begin(), layout.masks.begin() + 3,
                         [](std::uint32_t mask) { return mask != 0; });
    default:
      return false;
  }
}

// The bits of a mask, which lie side by side, as 0..255.
std::uint8_t Channel(std::uint32_t value, std::uint32_t mask) {
  const int shift = std::countr_zero(mask);
  const std::uint64_t largest = mask >> shift;
  return static_cast<std::uint8_t>(((value & mask) >> shift) * std::uint64_t{255} / largest);
}

using Palette = std::array<cv::Vec3b, 256>;

Palette ReadPalette(const ByteReader& reader, const Layout& layout) {
  Palette palette;
  palette.fill({0, 0, 0});
  for (std::size_t i = 0; i < (std::size_t{1} << layout.bits); ++i) {
    const std::size_t at = layout.palette_at + i * layout.palette_entry_bytes;
    if (static_cast<std::int64_t>(at + 3) > layout.pixels_at) break;
    palette[i] = {reader.U8(at).value_or(0), reader.U8(at + 1).value_or(0),
                  reader.U8(at + 2).value_or(0)};
  }
  return palette;
}

// The row of the image that is the y-th in the file.
int RowOf(const Layout& layout, int y) {
  return layout.top_down ? y : static_cast<int>(layout.height) - 1 - y;
}

// Run lengths: pairs of a count and a value; a count of 0 is a command. What no run covers has the
// palette's first colour.
cv::Mat DecodeRuns(Bytes data, const Layout& layout, const Palette& palette) {
  cv::Mat pixels(static_cast<int>(layout.height), static_cast<int>(layout.width), CV_8UC3,
                 cv::Scalar(palette[0][0], palette[0][1], palette[0][2]));
  const bool halves = layout.compression == kRuns4;
  int x = 0;
  int y = 0;
  const auto put = [&](std::uint8_t value, int i) {
    if (halves) value = i % 2 == 0 ? value >> 4U : value & 15U;
    if (x < pixels.cols) pixels.at<cv::Vec3b>(RowOf(layout, y), x++) = palette[value];
  };
  for (std::size_t at = 0; at + 1 < data.size() && y < pixels.rows;) {
    const std::uint8_t count = data[at];
    const std::uint8_t value = data[at + 1];
    at += 2;
    if (count > 0) {
      for (int i = 0; i < count && x < pixels.cols; ++i) put(value, i);
    } else if (value == 0) {  // end of the row
      x = 0;
      ++y;
    } else if (value == 1) {  // end of the image
      return pixels;
    } else if (value == 2) {  // move
      if (at + 1 >= data.size()) break;
      x = std::min(x + data[at], pixels.cols);
      y = std::min(y + data[at + 1], pixels.rows);
      at += 2;
    } else {  // `value` pixels as they are, padded to two bytes
      const std::size_t bytes = halves ? (value + 1U) / 2 : value;
      if (data.size() - at < bytes) break;
      for (int i = 0; i < value; ++i)
        put(data[at + static_cast<std::size_t>(halves ? i / 2 : i)], i);
      at += (bytes + 1) / 2 * 2;
    }
  }
  if (y + 1 < pixels.rows) ThrowTruncated(kRowsMissing);
  return pixels;
}

void DecodeRow(const std::uint8_t* row, const Layout& layout, const Palette& palette,
               std::uint8_t* out) {
  const auto width = static_cast<std::size_t>(layout.width);
  const auto bytes = static_cast<std::size_t>(layout.bits / 8);
  for (std::size_t x = 0; x < width; ++x) {
    if (layout.bits <= 8) {
      const std::size_t bit = x * static_cast<std::size_t>(layout.bits);
      const unsigned shift = 8U - static_cast<unsigned>(layout.bits) - bit % 8;
      const cv::Vec3b& colour =
          palette[(row[bit / 8] >> shift) & ((1U << static_cast<unsigned>(layout.bits)) - 1)];
      out = std::copy_n(colour.val, 3, out);
      continue;
    }
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) value |= std::uint32_t{row[x * bytes + i]} << 8 * i;
    for (const std::size_t channel : {2U, 1U, 0U}) *out++ = Channel(value, layout.masks[channel]);
    if (layout.alpha()) *out++ = Channel(value, layout.masks[3]);
  }
}

// Some programs leave alpha at 0 everywhere.
void MakeOpaqueIfInvisible(cv::Mat* pixels) {
  const auto visible = [](const cv::Vec4b& pixel) { return pixel[3] != 0; };
  if (std::any_of(pixels->begin<cv::Vec4b>(), pixels->end<cv::Vec4b>(), visible)) return;
  for (cv::Vec4b& pixel : cv::Mat_<cv::Vec4b>(*pixels)) pixel[3] = 255;
}

}  // namespace

ScannedImage ScanBmp(Bytes bytes) {
  const Layout layout = ReadLayout(ByteReader(bytes, false));
  ScannedImage scanned{
      .header = {.format = ImageFormat::kBmp, .width = layout.width, .height = layout.height},
      .pixel_bytes = layout.alpha() ? 4 + 3 : 3 + 1};
  if (layout.runs()) return scanned;  // the decoder notices
  const auto data = static_cast<std::int64_t>(bytes.size()) - layout.pixels_at;
  // Divided, not multiplied: nobody has checked the size yet, and the product may overflow. The
  // last row needs no padding.
  const std::int64_t padding = layout.row_bytes() - layout.used_row_bytes();
  scanned.complete =
      data >= 0 && (layout.height == 0 || layout.row_bytes() <= (data + padding) / layout.height);
  return scanned;
}

cv::Mat DecodeBmp(Bytes bytes, const ImageHeader& /*header*/, bool /*colour*/, int /*reduction*/) {
  const ByteReader reader(bytes, false);
  const Layout layout = ReadLayout(reader);
  if (!CanDecode(layout)) {
    ThrowUndecodable(std::to_string(layout.bits) + " bits a pixel with compression " +
                     std::to_string(layout.compression));
  }
  const Palette palette = layout.bits <= 8 ? ReadPalette(reader, layout) : Palette{};
  const Bytes data = reader.From(static_cast<std::size_t>(layout.pixels_at));
  if (layout.runs()) return DecodeRuns(data, layout, palette);
  cv::Mat pixels(static_cast<int>(layout.height), static_cast<int>(layout.width),
                 layout.alpha() ? CV_8UC4 : CV_8UC3);
  for (int y = 0; y < pixels.rows; ++y) {
    const auto at = static_cast<std::size_t>(y * layout.row_bytes());
    if (data.size() < at + static_cast<std::size_t>(layout.used_row_bytes())) {
      ThrowTruncated(kRowsMissing);
    }
    DecodeRow(data.data() + at, layout, palette, pixels.ptr(RowOf(layout, y)));
  }
  if (layout.alpha()) MakeOpaqueIfInvisible(&pixels);
  return pixels;
}

}  // namespace pliant
