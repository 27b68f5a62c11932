// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// HEIF (ISO/IEC 23008-12), the container of HEIC (HEVC, photos of telephones) and AVIF (AV1):
// libheif finds the main image, joins its tiles and turns it upright.
#include <memory>
#include <new>
#include <string>

#include <libheif/heif.h>
#include <opencv2/imgproc.hpp>

#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

template <auto kRelease>
struct Release {
  template <typename T>
  void operator()(T* object) const {
    kRelease(object);
  }
};
using Context = std::unique_ptr<heif_context, Release<heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Release<heif_image_handle_release>>;
using Options = std::unique_ptr<heif_decoding_options, Release<heif_decoding_options_free>>;
using Pixels = std::unique_ptr<heif_image, Release<heif_image_release>>;

// The file and its main image. `bytes` must live as long.
struct MainImage {
  Context context;
  Handle handle;
  heif_error error{};
};

MainImage Open(Bytes bytes) {
  MainImage image{.context = Context(heif_context_alloc()), .handle = nullptr};
  if (!image.context) throw std::bad_alloc();
  heif_context_set_max_decoding_threads(image.context.get(), 0);
  image.error = heif_context_read_from_memory_without_copy(image.context.get(), bytes.data(),
                                                           bytes.size(), nullptr);
  if (image.error.code != heif_error_Ok) return image;
  heif_image_handle* handle = nullptr;
  image.error = heif_context_get_primary_image_handle(image.context.get(), &handle);
  image.handle.reset(handle);
  return image;
}

// Whether a box is longer than what the file has of it (ISO/IEC 14496-12, 4.2). A size of 1 stands
// for one of 64 bits, 0 for the rest of the file.
bool IsCutShort(Bytes bytes) {
  const ByteReader reader(bytes, true);
  std::uint64_t at = 0;
  while (const auto said = reader.U32(at)) {
    std::uint64_t size = *said;
    if (size == 1) {
      size = std::uint64_t{reader.U32(at + 8).value_or(0)} << 32 | reader.U32(at + 12).value_or(0);
    }
    if (size > bytes.size() - at) return true;
    if (size < 8) return false;
    at += size;
  }
  return false;
}

[[noreturn]] void ThrowFailed(const heif_error& error, Bytes bytes) {
  if (error.subcode == heif_suberror_End_of_data || IsCutShort(bytes)) ThrowTruncated(kRowsMissing);
  if (error.code == heif_error_Memory_allocation_error &&
      error.subcode != heif_suberror_Security_limit_exceeded) {
    throw std::bad_alloc();
  }
  std::string message = error.message;  // some end with a line break
  message.erase(message.find_last_not_of(" \n") + 1);
  ThrowUndecodable(message);
}

}  // namespace

ScannedImage ScanHeif(Bytes bytes) {
  ScannedImage scanned{.header = {.format = SniffFormat(bytes)}};
  const MainImage image = Open(bytes);
  if (!image.handle) ThrowFailed(image.error, bytes);
  // The planes of the codec and those of libheif, then its 8 bits and the result.
  const int channels = heif_image_handle_has_alpha_channel(image.handle.get()) != 0 ? 4 : 3;
  const bool deep = heif_image_handle_get_luma_bits_per_pixel(image.handle.get()) > 8;
  scanned.pixel_bytes = 2 * channels * (deep ? 2 : 1) + 2 * channels;
  scanned.header.width = heif_image_handle_get_width(image.handle.get());
  scanned.header.height = heif_image_handle_get_height(image.handle.get());
  return scanned;
}

cv::Mat DecodeHeif(Bytes bytes, const ImageHeader& /*header*/, bool /*colour*/, int /*reduction*/) {
  MainImage image = Open(bytes);
  if (!image.handle) ThrowFailed(image.error, bytes);
  const bool alpha = heif_image_handle_has_alpha_channel(image.handle.get()) != 0;
  const Options options(heif_decoding_options_alloc());
  if (!options) throw std::bad_alloc();
  options->convert_hdr_to_8bit = 1;
  heif_image* decoded = nullptr;
  const heif_error error = heif_decode_image(
      image.handle.get(), &decoded, heif_colorspace_RGB,
      alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB, options.get());
  const Pixels owner(decoded);
  if (error.code != heif_error_Ok) ThrowFailed(error, bytes);
  int stride = 0;
  const std::uint8_t* rows =
      heif_image_get_plane_readonly(decoded, heif_channel_interleaved, &stride);
  if (rows == nullptr) ThrowUndecodable();
  const cv::Mat rgb(heif_image_get_height(decoded, heif_channel_interleaved),
                    heif_image_get_width(decoded, heif_channel_interleaved),
                    alpha ? CV_8UC4 : CV_8UC3, const_cast<std::uint8_t*>(rows),
                    static_cast<std::size_t>(stride));
  cv::Mat pixels;
  cv::cvtColor(rgb, pixels, alpha ? cv::COLOR_RGBA2BGRA : cv::COLOR_RGB2BGR);
  return pixels;
}

void LoadHeifPlugins() { heif_init(nullptr); }

}  // namespace pliant
