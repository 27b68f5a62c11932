// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TIFF 6.0 and BigTIFF: directories of tags that point to strips or tiles of pixels. Each is a
// page; the largest counts, because scanners and cameras put small ones before it or behind.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <tiffio.h>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

constexpr int kMostPages = 16;                 // that are looked at
constexpr std::uint32_t kMostPieces = 65'536;  // libtiff starts again for every strip or tile
constexpr tmsize_t kMostTableBytes = tmsize_t{256} << 20;

// A file in memory, as libtiff reads it.
struct MemoryFile {
  Bytes bytes;
  std::uint64_t at = 0;
};

tmsize_t Read(thandle_t handle, void* to, tmsize_t size) {
  auto& file = *static_cast<MemoryFile*>(handle);
  if (file.at >= file.bytes.size()) return 0;
  const std::size_t count = std::min(static_cast<std::size_t>(size), file.bytes.size() - file.at);
  std::memcpy(to, file.bytes.data() + file.at, count);
  file.at += count;
  return static_cast<tmsize_t>(count);
}

toff_t Seek(thandle_t handle, toff_t offset, int from) {
  auto& file = *static_cast<MemoryFile*>(handle);
  const std::uint64_t base =
      from == SEEK_CUR ? file.at : (from == SEEK_END ? file.bytes.size() : 0);
  return file.at = base + offset;
}

int Map(thandle_t handle, void** base, toff_t* size) {
  const Bytes bytes = static_cast<MemoryFile*>(handle)->bytes;
  *base = const_cast<std::uint8_t*>(bytes.data());  // libtiff only reads
  *size = bytes.size();
  return 1;
}

int KeepSilent(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct Close {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, Close>;

template <typename T>
T Field(const Tiff& tiff, std::uint32_t tag, T otherwise) {
  T value{};
  return TIFFGetFieldDefaulted(tiff.get(), tag, &value) != 0 ? value : otherwise;
}

void GoToLargestPage(const Tiff& tiff) {
  double most_pixels = -1;
  int largest = 0;
  int page = 0;
  for (;; ++page) {
    const double pixels = 1.0 * Field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH, 0) *
                          Field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH, 0);
    if (pixels > most_pixels) {
      most_pixels = pixels;
      largest = page;
    }
    if (page + 1 == kMostPages || TIFFLastDirectory(tiff.get()) != 0) break;
    if (TIFFReadDirectory(tiff.get()) == 0) {
      page = -1;  // none is current
      break;
    }
  }
  if (page != largest) TIFFSetDirectory(tiff.get(), static_cast<tdir_t>(largest));
}

// At the largest page. Null if there is no readable directory. `file` must live as long.
Tiff Open(MemoryFile& file) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMostTableBytes);
  TIFFOpenOptionsSetErrorHandlerExtR(options, KeepSilent, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options, KeepSilent, nullptr);
  Tiff tiff(TIFFClientOpenExt(
      "", "r", &file, Read, [](thandle_t, void*, tmsize_t) -> tmsize_t { return 0; }, Seek,
      [](thandle_t) { return 0; },
      [](thandle_t handle) -> toff_t { return static_cast<MemoryFile*>(handle)->bytes.size(); },
      Map, [](thandle_t, void*, toff_t) {}, options));
  TIFFOpenOptionsFree(options);
  if (tiff) GoToLargestPage(tiff);
  return tiff;
}

std::uint32_t Pieces(const Tiff& tiff) {
  return TIFFIsTiled(tiff.get()) != 0 ? TIFFNumberOfTiles(tiff.get())
                                      : TIFFNumberOfStrips(tiff.get());
}

struct PieceSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

PieceSize PieceSizeOf(const Tiff& tiff, const ImageHeader& header) {
  if (TIFFIsTiled(tiff.get()) != 0) {
    return {Field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH, 0),
            Field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)};
  }
  const auto height = static_cast<std::uint32_t>(header.height);
  return {static_cast<std::uint32_t>(header.width),
          std::min(Field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height), height)};
}

// libtiff decodes a strip or a tile at a time, and then makes four bytes of each pixel. Of numbers
// that nobody has checked.
std::int64_t BufferBytes(const Tiff& tiff, const PieceSize& piece) {
  const double bits = 1.0 * Field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) *
                      Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  const double bytes = 1.0 * piece.width * piece.height * (4 + (bits + 7) / 8);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 4;
  return bytes < static_cast<double>(kMost) ? static_cast<std::int64_t>(bytes) : kMost;
}

// Whether the pixels' data lie within the file, and not over one another.
void CheckPieces(const Tiff& tiff, std::size_t file_bytes, ScannedImage& scanned) {
  const std::uint32_t pieces = Pieces(tiff);
  if (pieces > kMostPieces) {
    scanned.defect = "it has " + std::to_string(pieces) + " strips or tiles";
    return;
  }
  std::uint64_t total = 0;
  for (std::uint32_t i = 0; i < pieces; ++i) {
    const std::uint64_t offset = TIFFGetStrileOffset(tiff.get(), i);
    const std::uint64_t size = TIFFGetStrileByteCount(tiff.get(), i);
    if (offset > file_bytes || size > file_bytes - offset) scanned.complete = false;
    total += std::min<std::uint64_t>(size, file_bytes);
  }
  if (total > file_bytes && scanned.complete) {
    scanned.defect = "its strips or tiles overlap";
  }
}

enum class Alpha { kNone, kPremultiplied, kSeparate };

// As libtiff's own conversion takes it.
Alpha AlphaOf(const Tiff& tiff) {
  const int samples = Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  std::uint16_t count = 0;
  const std::uint16_t* kinds = nullptr;
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_EXTRASAMPLES, &count, &kinds);
  if (count == 0) return Alpha::kNone;
  if (kinds[0] == EXTRASAMPLE_UNASSALPHA) return Alpha::kSeparate;
  return kinds[0] == EXTRASAMPLE_ASSOCALPHA || samples > 3 ? Alpha::kPremultiplied : Alpha::kNone;
}

// The colour that was multiplied with alpha.
std::uint8_t Divided(std::uint32_t value, std::uint32_t alpha) {
  if (alpha == 0) return 0;
  return static_cast<std::uint8_t>(std::min(255U, (value * 255 + alpha / 2) / alpha));
}

// Whether the samples are plain numbers of 16 bits. libtiff's conversion to 8 bits takes all 16 for
// used (ToEightBits).
bool IsDeep(const Tiff& tiff) {
  const int samples = Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  const int alphas = AlphaOf(tiff) == Alpha::kNone ? 0 : 1;
  const int photometric = Field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_SEPARATED);
  const int colours = photometric == PHOTOMETRIC_RGB ? 3 : 1;
  return Field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) == 16 &&
         Field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT &&
         (samples == 1 ||
          Field<std::uint16_t>(tiff, TIFFTAG_PLANARCONFIG, 0) == PLANARCONFIG_CONTIG) &&
         photometric <= PHOTOMETRIC_RGB && samples == colours + alphas;
}

// Of the decoder's result and its conversions.
std::int64_t PixelBytes(const Tiff& tiff, int orientation) {
  const bool alpha = AlphaOf(tiff) != Alpha::kNone;
  if (IsDeep(tiff)) return 3 * (alpha ? 4 : Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1));
  if (alpha) return 4 + 3;
  return orientation >= 5 ? 3 + 3 : 3 + 1;  // turned, or grey
}

// One strip or tile at (x, y), of pixels with premultiplied alpha, bottom row first.
void Place(const std::vector<std::uint32_t>& raster, const PieceSize& piece, int rows, int x, int y,
           cv::Mat& pixels) {
  const int columns = std::min(static_cast<int>(piece.width), pixels.cols - x);
  for (int row = 0; row < std::min(rows, pixels.rows - y); ++row) {
    const std::uint32_t* from =
        raster.data() + static_cast<std::size_t>(rows - 1 - row) * piece.width;
    std::uint8_t* to = pixels.ptr(y + row, x);
    for (int i = 0; i < columns; ++i) {
      const std::uint32_t alpha = pixels.channels() == 4 ? TIFFGetA(from[i]) : 255;
      *to++ = Divided(TIFFGetB(from[i]), alpha);
      *to++ = Divided(TIFFGetG(from[i]), alpha);
      *to++ = Divided(TIFFGetR(from[i]), alpha);
      if (pixels.channels() == 4) *to++ = static_cast<std::uint8_t>(alpha);
    }
  }
}

// The same of samples of 16 bits, top row first: grey, B, G, R, or B, G, R, A.
void PlaceDeep(const std::vector<std::uint16_t>& samples, const PieceSize& piece, int rows, int x,
               int y, int per_pixel, cv::Mat& pixels) {
  const int columns = std::min(static_cast<int>(piece.width), pixels.cols - x);
  const int colours = per_pixel >= 3 ? 3 : 1;
  for (int row = 0; row < std::min(rows, pixels.rows - y); ++row) {
    const std::uint16_t* from =
        samples.data() + static_cast<std::size_t>(row) * piece.width * per_pixel;
    auto* to = pixels.ptr<std::uint16_t>(y + row, x);
    for (int i = 0; i < columns; ++i, from += per_pixel, to += pixels.channels()) {
      for (int c = 0; c < std::min(pixels.channels(), 3); ++c)
        to[c] = from[colours == 3 ? 2 - c : 0];
      if (pixels.channels() == 4) to[3] = from[colours];
    }
  }
}

// Calls read(column, row, rows) for each strip or tile; false: it cannot be read.
template <typename Read>
void ForEachPiece(const Tiff& tiff, const PieceSize& piece, const ImageHeader& header, Read read) {
  if (piece.width == 0 || piece.height == 0) ThrowUndecodable("empty strips");
  const bool tiled = TIFFIsTiled(tiff.get()) != 0;
  const auto width = static_cast<std::uint32_t>(header.width);
  const auto height = static_cast<std::uint32_t>(header.height);
  for (std::uint32_t y = 0; y < height; y += piece.height) {
    for (std::uint32_t x = 0; x < width; x += piece.width) {
      // The last strip has the rows that are left; a tile is always whole.
      if (!read(x, y, tiled ? piece.height : std::min(piece.height, height - y))) {
        ThrowUndecodable();
      }
    }
  }
}

cv::Mat DecodeDeep(const Tiff& tiff, const ImageHeader& header, const PieceSize& piece) {
  const int per_pixel = Field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  const Alpha alpha = AlphaOf(tiff);
  cv::Mat deep(static_cast<int>(header.height), static_cast<int>(header.width),
               CV_16UC(alpha != Alpha::kNone ? 4 : per_pixel));
  std::vector<std::uint16_t> samples(std::size_t{piece.width} * piece.height * per_pixel);
  ForEachPiece(tiff, piece, header, [&](std::uint32_t x, std::uint32_t y, std::uint32_t rows) {
    const auto wanted = static_cast<tmsize_t>(std::size_t{piece.width} * rows * per_pixel * 2);
    const tmsize_t got =
        TIFFIsTiled(tiff.get()) != 0
            ? TIFFReadEncodedTile(tiff.get(), TIFFComputeTile(tiff.get(), x, y, 0, 0),
                                  samples.data(), wanted)
            : TIFFReadEncodedStrip(tiff.get(), TIFFComputeStrip(tiff.get(), y, 0), samples.data(),
                                   wanted);
    if (got < wanted) return false;
    PlaceDeep(samples, piece, static_cast<int>(rows), static_cast<int>(x), static_cast<int>(y),
              per_pixel, deep);
    return true;
  });
  cv::Mat pixels = ToEightBits(deep);
  if (alpha == Alpha::kPremultiplied) {
    for (cv::Vec4b& pixel : cv::Mat_<cv::Vec4b>(pixels)) {
      for (int c = 0; c < 3; ++c) pixel[c] = Divided(pixel[c], pixel[3]);
    }
  }
  if (Field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, 0) == PHOTOMETRIC_MINISWHITE) {
    pixels ^= cv::Scalar(255, 255, 255, 0);
  }
  return pixels;
}

}  // namespace

ScannedImage ScanTiff(Bytes bytes) {
  ScannedImage scanned{.header = {.format = ImageFormat::kTiff}};
  MemoryFile file{bytes};
  const Tiff tiff = Open(file);
  if (!tiff) return scanned;
  scanned.header.width = Field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH, 0);
  scanned.header.height = Field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH, 0);
  const int orientation = Field<std::uint16_t>(tiff, TIFFTAG_ORIENTATION, 1);
  if (orientation >= 1 && orientation <= 8) scanned.header.exif_orientation = orientation;
  scanned.pixel_bytes = PixelBytes(tiff, scanned.header.exif_orientation);
  scanned.buffer_bytes = BufferBytes(tiff, PieceSizeOf(tiff, scanned.header));
  CheckPieces(tiff, bytes.size(), scanned);
  return scanned;
}

cv::Mat DecodeTiff(Bytes bytes, const ImageHeader& header, bool /*colour*/, int /*reduction*/) {
  MemoryFile file{bytes};
  const Tiff tiff = Open(file);
  char reason[1024] = "";
  if (!tiff || TIFFRGBAImageOK(tiff.get(), reason) == 0) {
    std::string_view text(reason);
    if (text.starts_with("Sorry, ")) text.remove_prefix(7);
    ThrowUndecodable(std::string(text));
  }
  const PieceSize piece = PieceSizeOf(tiff, header);
  if (IsDeep(tiff)) return DecodeDeep(tiff, header, piece);
  TIFFSetField(tiff.get(), TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);  // callers turn it upright
  const bool alpha = AlphaOf(tiff) != Alpha::kNone;
  cv::Mat pixels(static_cast<int>(header.height), static_cast<int>(header.width),
                 alpha ? CV_8UC4 : CV_8UC3);
  std::vector<std::uint32_t> raster(std::size_t{piece.width} * piece.height);
  ForEachPiece(tiff, piece, header, [&](std::uint32_t x, std::uint32_t y, std::uint32_t rows) {
    const int read = TIFFIsTiled(tiff.get()) != 0
                         ? TIFFReadRGBATile(tiff.get(), x, y, raster.data())
                         : TIFFReadRGBAStrip(tiff.get(), y, raster.data());
    if (read == 0) return false;
    Place(raster, piece, static_cast<int>(rows), static_cast<int>(x), static_cast<int>(y), pixels);
    return true;
  });
  return pixels;
}

}  // namespace pliant
