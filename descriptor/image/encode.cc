// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <csetjmp>
#include <memory>
#include <new>

#include <png.h>
#include <turbojpeg.h>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"

namespace pliant {
namespace {

[[noreturn]] void ThrowFailed(const char* detail) {
  throw Error(ErrorCode::kInternal, "image_encode_failed",
              std::string("An image could not be encoded: ") + detail);
}

// No object with a destructor is alive where libpng jumps back to.
class PngEncoder {
 public:
  PngEncoder() {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
  }
  ~PngEncoder() { png_destroy_write_struct(&png_, &info_); }
  PngEncoder(const PngEncoder&) = delete;
  PngEncoder& operator=(const PngEncoder&) = delete;

  std::vector<std::uint8_t> Encode(int width, int height, int channels, int bits,
                                   const std::uint8_t* pixels) {
    if (info_ == nullptr) throw std::bad_alloc();
    if (!Write(width, height, channels, bits, pixels)) ThrowFailed("libpng failed");
    if (out_of_memory_) throw std::bad_alloc();
    return std::move(encoded_);
  }

 private:
  bool Write(int width, int height, int channels, int bits, const std::uint8_t* pixels) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_write_fn(png_, this, Append, nullptr);
    png_set_IHDR(png_, info_, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
                 bits, channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    // Fast, and nearly as small: what SUB predicts compresses well with run lengths.
    png_set_filter(png_, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_compression_level(png_, 1);
    png_set_compression_strategy(png_, 3);  // Z_RLE
    png_write_info(png_, info_);
    if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
    const std::size_t stride =
        static_cast<std::size_t>(width) * static_cast<std::size_t>(channels * bits / 8);
    for (int y = 0; y < height; ++y) {
      png_write_row(png_, pixels + static_cast<std::size_t>(y) * stride);
    }
    png_write_end(png_, info_);
    return true;
  }

  static void Append(png_structp png, png_bytep data, png_size_t size) {
    auto& self = *static_cast<PngEncoder*>(png_get_io_ptr(png));
    try {
      self.encoded_.insert(self.encoded_.end(), data, data + size);
    } catch (const std::bad_alloc&) {
      self.out_of_memory_ = true;
    }
  }

  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::vector<std::uint8_t> encoded_;
  bool out_of_memory_ = false;
};

}  // namespace

std::vector<std::uint8_t> EncodeJpeg(const Image& image, int quality) {
  const std::unique_ptr<void, int (*)(tjhandle)> compressor(tjInitCompress(), tjDestroy);
  if (!compressor) throw std::bad_alloc();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const bool colour = image.channels == 3;
  const int failed = tjCompress2(compressor.get(), image.pixels.data(), image.width, 0,
                                 image.height, colour ? TJPF_RGB : TJPF_GRAY, &bytes, &size,
                                 colour ? TJSAMP_420 : TJSAMP_GRAY, quality, TJFLAG_ACCURATEDCT);
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(bytes, tjFree);
  if (failed != 0) ThrowFailed(tjGetErrorStr2(compressor.get()));
  return {bytes, bytes + size};
}

std::vector<std::uint8_t> EncodePng(const Image& image) {
  return PngEncoder().Encode(image.width, image.height, image.channels, 8, image.pixels.data());
}

std::vector<std::uint8_t> EncodeDeepPng(int width, int height,
                                        std::span<const std::uint16_t> values) {
  return PngEncoder().Encode(width, height, 3, 16,
                             reinterpret_cast<const std::uint8_t*>(values.data()));
}

}  // namespace pliant
