// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// PNG (ISO/IEC 15948): chunks of length, type, data, CRC.
#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstdio>
#include <exception>
#include <new>

#include <png.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr std::size_t kSignatureBytes = 8;

// Calls visit(type offset, data) for each chunk up to IEND; false when the file ends before it.
template <typename Visit>
bool WalkPng(Bytes bytes, Visit visit) {
  const ByteReader reader(bytes, true);
  std::size_t at = kSignatureBytes;
  while (const auto length = reader.U32(at)) {
    const std::size_t data = at + 8;
    if (data > bytes.size() || bytes.size() - data < std::size_t{*length} + 4) return false;
    visit(at + 4, bytes.subspan(data, *length));
    if (reader.StartsWith(at + 4, "IEND")) return true;
    at = data + *length + 4;
  }
  return false;
}

// Of the decoder's result and of its conversions: to 8 bits, transparency onto a ground, grey.
std::int64_t PixelBytes(int bit_depth, int colour_type, bool transparent_colour) {
  const bool colour = (colour_type & PNG_COLOR_MASK_COLOR) != 0;
  const bool alpha = (colour_type & PNG_COLOR_MASK_ALPHA) != 0 || transparent_colour;
  if (bit_depth == 16) return 3 * (alpha ? 4 : colour ? 3 : 1);
  if (alpha) return 4 + 3;
  return colour ? 3 + 1 : 1;
}

// What the rows need at most: the samples of a pixel, and some bytes for each row and pass.
double MostDataBytes(const ImageHeader& header, int bit_depth, int colour_type) {
  constexpr std::array<int, 7> kSamples = {1, 4, 3, 1, 2, 4, 4};  // by colour type
  const int samples = kSamples[static_cast<std::size_t>(std::min(colour_type, 6))];
  return static_cast<double>(header.height) *
         (static_cast<double>(header.width) * samples * bit_depth / 8 + 16);
}

// Decodes with libpng's push interface, which unpacks no more data than the rows need. (The other
// one unpacks what lies behind the last row as well, a thousand times its size.)
class PngDecoder {
 public:
  PngDecoder() {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, OnError,
                                  [](png_structp, const char*) {});
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
  }
  ~PngDecoder() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;

  cv::Mat Decode(Bytes bytes) {
    if (info_ == nullptr) throw std::bad_alloc();
    const bool decoded = Process(bytes);
    if (out_of_memory_) throw std::bad_alloc();
    if (rows_missing_ && !WalkPng(bytes, [](std::size_t, Bytes) {})) ThrowTruncated(kRowsMissing);
    if (!decoded || rows_missing_) ThrowUndecodable(error_.data());
    return pixels_;
  }

 private:
  // No destructor runs when libpng jumps back here.
  bool Process(Bytes bytes) {
    // All rows can be there with something else behind them.
    if (setjmp(png_jmpbuf(png_)) != 0) return !rows_missing_ && !InPixelData();
    // Texts and profiles may unpack to any size. All chunks that pixels do not depend on are
    // skipped.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_set_progressive_read_fn(png_, this, OnInfo, OnRow, nullptr);
    png_process_data(png_, info_, const_cast<png_bytep>(bytes.data()), bytes.size());  // only reads
    return true;
  }

  bool InPixelData() const {
    constexpr png_uint_32 kPixelData = 0x49444154;  // IDAT
    return png_get_io_chunk_type(png_) == kPixelData;
  }

  static void OnError(png_structp png, const char* text) {
    auto& error = static_cast<PngDecoder*>(png_get_error_ptr(png))->error_;
    std::snprintf(error.data(), error.size(), "%s", text);
    png_longjmp(png, 1);
  }

  static void OnInfo(png_structp png, png_infop info) {
    auto& self = *static_cast<PngDecoder*>(png_get_progressive_ptr(png));
    png_set_expand(png);  // palettes, transparent colours, less than 8 bits
    if (std::endian::native == std::endian::little) png_set_swap(png);
    png_set_bgr(png);
    const int type = png_get_color_type(png, info);
    if (type == PNG_COLOR_TYPE_GRAY_ALPHA ||
        (type == PNG_COLOR_TYPE_GRAY && png_get_valid(png, info, PNG_INFO_tRNS) != 0)) {
      png_set_gray_to_rgb(png);
    }
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    if (!self.Create(static_cast<int>(png_get_image_height(png, info)),
                     static_cast<int>(png_get_image_width(png, info)),
                     CV_MAKETYPE(png_get_bit_depth(png, info) == 16 ? CV_16U : CV_8U,
                                 png_get_channels(png, info)))) {
      png_error(png, "out of memory");
    }
  }

  bool Create(int rows, int columns, int type) {
    try {
      pixels_.create(rows, columns, type);
    } catch (const std::exception&) {
      out_of_memory_ = true;
    }
    return !out_of_memory_;
  }

  static void OnRow(png_structp png, png_bytep row, png_uint_32 y, int pass) {
    auto& self = *static_cast<PngDecoder*>(png_get_progressive_ptr(png));
    if (row != nullptr)
      png_progressive_combine_row(png, self.pixels_.ptr(static_cast<int>(y)), row);
    // The last pass of an interlaced image brings its odd rows.
    const int last_pass =
        png_get_interlace_type(png, self.info_) != 0 && self.pixels_.rows > 1 ? 6 : 0;
    if (pass >= last_pass && static_cast<int>(y) + 1 == self.pixels_.rows) {
      self.rows_missing_ = false;
    }
  }

  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  cv::Mat pixels_;
  bool rows_missing_ = true;
  bool out_of_memory_ = false;
  std::array<char, 80> error_ = {"rows are missing"};
};

}  // namespace

ScannedImage ScanPng(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kPng}};
  ImageHeader& header = scanned.header;
  const ByteReader reader(bytes, true);
  if (!reader.StartsWith(12, "IHDR")) return scanned;
  constexpr std::uint32_t kHeaderBytes = 13;
  if (reader.U32(kSignatureBytes) != kHeaderBytes) {
    scanned.defect = "its header has the wrong length";
    return scanned;
  }
  header.width = reader.U32(16).value_or(0);
  header.height = reader.U32(20).value_or(0);
  bool exif = false;
  bool transparent_colour = false;
  double data_bytes = 0;
  WalkPng(bytes, [&](std::size_t type, Bytes data) {
    if (reader.StartsWith(type, "tRNS")) transparent_colour = true;
    if (reader.StartsWith(type, "IDAT")) data_bytes += static_cast<double>(data.size());
    if (!exif && reader.StartsWith(type, "eXIf")) {
      header.exif_orientation = ReadOrientation(data);
      exif = true;
    }
  });
  const int bit_depth = reader.U8(24).value_or(0);
  const int colour_type = reader.U8(25).value_or(0);
  scanned.pixel_bytes = PixelBytes(bit_depth, colour_type, transparent_colour);
  // Compressed data that are larger than what they unpack to are none of this image's.
  constexpr double kTolerated = 64 * 1024;
  if (data_bytes > MostDataBytes(header, bit_depth, colour_type) + kTolerated) {
    scanned.defect = "it has more data than its size needs";
  }
  return scanned;
}

cv::Mat DecodePng(Bytes bytes, const ImageHeader& /*header*/, bool /*colour*/, int /*reduction*/) {
  const cv::Mat pixels = PngDecoder().Decode(bytes);
  return pixels.depth() == CV_16U ? ToEightBits(pixels) : pixels;
}

cv::Mat DecodeDeepPng(Bytes bytes) { return PngDecoder().Decode(bytes); }

}  // namespace pliant
