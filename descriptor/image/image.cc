// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <new>
#include <optional>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/image/cv_image.h"
#include "descriptor/image/image_header.h"

namespace pliant {
namespace {

void CheckLimits(const ImageHeader& header, const DecodeOptions& options) {
  const std::string size = std::to_string(header.width) + " x " + std::to_string(header.height);
  if (header.width > options.max_pixels / header.height) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "The image has " + size + " pixels; the limit is " +
                    std::to_string(options.max_pixels) + " pixels. Scale it down.");
  }
  if (std::min(header.width, header.height) < options.min_side_px) {
    throw Error(ErrorCode::kUnprocessable, "image_too_small",
                "The image has " + size + " pixels; each side needs at least " +
                    std::to_string(options.min_side_px) + ".");
  }
}

// What decoding and the conversions to 8 bits may take, by what the file says of itself.
void CheckMemory(const ScannedImage& scanned, int reduction, const DecodeOptions& options) {
  const std::int64_t pixels = scanned.header.width * scanned.header.height;
  const std::int64_t needed = pixels / (std::int64_t{reduction} * reduction) * scanned.pixel_bytes;
  if (needed <= options.max_decode_bytes &&
      scanned.buffer_bytes <= options.max_decode_bytes - needed) {
    return;
  }
  throw Error(ErrorCode::kTooLarge, "image_too_large",
              "Decoding the image of " + std::to_string(scanned.header.width) + " x " +
                  std::to_string(scanned.header.height) + " pixels takes more than " +
                  FormatBytes(static_cast<std::uint64_t>(options.max_decode_bytes)) +
                  " of memory. Scale it down, or save it as a non-progressive JPEG.");
}

// libjpeg can decode at 1/2, 1/4 or 1/8 of the size; take the smallest that is not below
// the wanted size.
int JpegReduction(const ImageHeader& header, const ScaledSize& wanted) {
  if (header.format != ImageFormat::kJpeg) return 1;
  int reduction = 1;
  while (reduction < 8 && wanted.scale * reduction * 2 <= 1) reduction *= 2;
  return reduction;
}

// By the orientation of EXIF 2.3, tag 0x0112: 5 to 8 are 1 to 4 after a transposition.
cv::Mat TurnUpright(cv::Mat pixels, int orientation) {
  constexpr std::array kFlips = {1, -1, 0};  // left to right, both ways, upside down
  if (orientation >= 5) cv::transpose(pixels, pixels);
  const int flip = (orientation - 1) % 4;
  if (flip > 0) cv::flip(pixels, pixels, kFlips[static_cast<std::size_t>(flip) - 1]);
  return pixels;
}

// The grey level behind transparent pixels. White, as most viewers have it, unless the edges of
// what is opaque show less contrast on it than on black (white prints for dark cloth) or, for
// prints of both, on a grey between.
int GroundFor(const cv::Mat& bgra) {
  constexpr std::array kGrounds = {255, 0, 128};
  constexpr int kEnough = 64;       // levels of contrast: more does not make an edge clearer
  constexpr double kClearly = 1.1;  // as much more contrast as white has to have less
  std::array<double, 256> edges{};  // steps of alpha, by the level of their more opaque side
  const auto add = [&](const cv::Vec4b& one, const cv::Vec4b& other) {
    if (one[3] == other[3]) return;
    const cv::Vec4b& opaque = one[3] > other[3] ? one : other;
    const int level = (29 * opaque[0] + 150 * opaque[1] + 77 * opaque[2]) / 256;
    edges[static_cast<std::size_t>(level)] += std::abs(one[3] - other[3]);
  };
  for (int y = 0; y < bgra.rows; ++y) {
    const auto* row = bgra.ptr<cv::Vec4b>(y);
    const auto* next = bgra.ptr<cv::Vec4b>(std::min(y + 1, bgra.rows - 1));
    for (int x = 0; x < bgra.cols; ++x) {
      add(row[x], row[std::min(x + 1, bgra.cols - 1)]);
      add(row[x], next[x]);
    }
  }
  int best = kGrounds[0];
  double most = 0;
  for (const int ground : kGrounds) {
    double contrast = 0;
    for (int level = 0; level < 256; ++level) {
      contrast +=
          edges[static_cast<std::size_t>(level)] * std::min(std::abs(level - ground), kEnough);
    }
    if (contrast <= kClearly * most) continue;
    most = contrast;
    best = ground;
  }
  return best;
}

// B, G, R of B, G, R, A: transparent pixels get a ground, because the colour under them is
// arbitrary.
cv::Mat ComposeOnGround(const cv::Mat& bgra) {
  const int ground = GroundFor(bgra);
  cv::Mat bgr(bgra.size(), CV_8UC3);
  for (int y = 0; y < bgra.rows; ++y) {
    const auto* source = bgra.ptr<cv::Vec4b>(y);
    auto* target = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < bgra.cols; ++x) {
      const int alpha = source[x][3];
      for (int c = 0; c < 3; ++c) {
        target[x][c] =
            static_cast<std::uint8_t>((source[x][c] * alpha + ground * (255 - alpha) + 127) / 255);
      }
    }
  }
  return bgr;
}

// From grey or B, G, R, which may be changed: with the channels wanted, upright, scaled down.
Image Finished(cv::Mat pixels, int orientation, const ScaledSize& size, bool colour) {
  if (!colour && pixels.channels() == 3) {
    cv::Mat grey;
    cv::cvtColor(pixels, grey, cv::COLOR_BGR2GRAY);
    pixels = grey;
  }
  pixels = TurnUpright(std::move(pixels), orientation);
  if (size.width < pixels.cols || size.height < pixels.rows) {
    cv::Mat scaled;
    cv::resize(pixels, scaled, {size.width, size.height}, 0, 0, cv::INTER_AREA);
    pixels = scaled;
  }
  if (!colour) return CopyFromMat(pixels);
  cv::Mat rgb;
  cv::cvtColor(pixels, rgb, pixels.channels() == 1 ? cv::COLOR_GRAY2RGB : cv::COLOR_BGR2RGB);
  return CopyFromMat(rgb);
}

// Grey, or B, G, R; not turned upright.
cv::Mat Read(Bytes bytes, const ImageHeader& header, bool colour, int reduction) {
  cv::Mat pixels = DecodePixels(bytes, header, colour, reduction);
  return pixels.channels() == 4 ? ComposeOnGround(pixels) : pixels;
}

// What is asked of one image: a size is of the upright one.
struct Wanted {
  int reduction = 1;
  int orientation = 1;
  bool colour = false;
  ScaledSize size;
  ScaledSize thumbnail = {};

  cv::Size StoredThumbnail() const {
    const cv::Size upright(thumbnail.width, thumbnail.height);
    return orientation < 5 ? upright : cv::Size(upright.height, upright.width);
  }
};

Image ThumbnailFrom(const cv::Mat& pixels, const Wanted& wanted) {
  const cv::Size size = wanted.StoredThumbnail();
  cv::Mat small;
  if (size.width < pixels.cols || size.height < pixels.rows) {
    cv::resize(pixels, small, size, 0, 0, cv::INTER_AREA);
  } else {
    small = pixels.clone();  // turned below
  }
  return Finished(small, wanted.orientation, wanted.thumbnail, true);
}

// In one pass over the file where a decoder gives both; in two, the thumbnail's pixels are gone
// before the image's come, and memory is what it is without a thumbnail in colours.
void ReadBoth(Bytes bytes, const ImageHeader& header, const Wanted& wanted, DecodedImage* decoded) {
  cv::Mat pixels;
  const auto planes = header.format == ImageFormat::kJpeg && !wanted.colour
                          ? DecodeJpegPlanes(bytes, header, wanted.reduction)
                          : std::nullopt;
  if (planes) {
    decoded->thumbnail = ThumbnailFrom(ThumbnailOf(*planes, wanted.StoredThumbnail()), wanted);
    if (!planes->damaged) pixels = planes->grey;
  } else if (header.format == ImageFormat::kJpeg && !wanted.colour) {
    ScaledSize small = wanted.thumbnail;
    small.scale *= wanted.size.scale;
    const int coarse = JpegReduction(header, small);
    decoded->thumbnail = ThumbnailFrom(Read(bytes, header, true, coarse), wanted);
  }
  // A thumbnail that is made of these pixels has their colours.
  const bool colour = wanted.colour || decoded->thumbnail.empty();
  if (pixels.empty()) pixels = Read(bytes, header, colour, wanted.reduction);
  if (decoded->thumbnail.empty()) decoded->thumbnail = ThumbnailFrom(pixels, wanted);
  decoded->image = Finished(std::move(pixels), wanted.orientation, wanted.size, wanted.colour);
}

DecodedImage Decode(Bytes bytes, const DecodeOptions& options) {
  if (static_cast<std::int64_t>(bytes.size()) > options.max_bytes) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                "The image file exceeds the limit of " +
                    FormatBytes(static_cast<std::uint64_t>(options.max_bytes)) +
                    ". Scale the image down.");
  }
  ScannedImage scanned = ScanImage(bytes);
  const ImageHeader& header = scanned.header;
  CheckLimits(header, options);
  const bool turned = header.exif_orientation >= 5;
  const auto width = static_cast<int>(turned ? header.height : header.width);
  const auto height = static_cast<int>(turned ? header.width : header.height);
  const ScaledSize size = ScaleToFit(width, height, options.max_side_px);
  const int reduction = JpegReduction(header, size);
  CheckMemory(scanned, reduction, options);
  CheckStructure(bytes, scanned);
  CheckMemory(scanned, reduction, options);  // now all that is needed is known

  DecodedImage decoded;
  decoded.format = header.format;
  decoded.original_width = width;
  decoded.original_height = height;
  Wanted wanted{.reduction = reduction,
                .orientation = header.exif_orientation,
                .colour = options.colour,
                .size = size};
  decoded.scale = wanted.size.scale;
  if (options.thumbnail_side_px > 0) {
    wanted.thumbnail = ScaleToFit(wanted.size.width, wanted.size.height, options.thumbnail_side_px);
    ReadBoth(bytes, header, wanted, &decoded);
  } else {
    decoded.image = Finished(Read(bytes, header, options.colour, reduction), wanted.orientation,
                             wanted.size, options.colour);
  }
  return decoded;
}

}  // namespace

DecodedImage DecodeImage(Bytes bytes, const DecodeOptions& options) {
  try {
    return Decode(bytes, options);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) throw std::bad_alloc();
    throw;
  }
}

ScaledSize ScaleToFit(int width, int height, int max_side_px) {
  const int longer = std::max(width, height);
  if (max_side_px <= 0 || longer <= max_side_px) return {width, height, 1.0};
  const double side = max_side_px;
  const double shorter = std::min(width, height);
  double scale = side / longer;
  if (shorter * scale < side / 4) {
    const double of_area = side * std::sqrt(0.75 / (longer * shorter));  // as 4:3 has
    scale = std::min({side / 4 / shorter, of_area, 1.0});
  }
  const auto scaled = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * scale)));
  };
  return {scaled(width), scaled(height), scale};
}

std::string MediaType(ImageFormat format) {
  static constexpr std::array kTypes = {"application/octet-stream",
                                        "image/jpeg",
                                        "image/png",
                                        "image/webp",
                                        "image/bmp",
                                        "image/tiff",
                                        "image/gif",
                                        "image/heic",
                                        "image/avif"};
  return kTypes[static_cast<std::size_t>(format)];
}

Image ToGrey(const Image& image) {
  if (image.channels == 1) return image;
  cv::Mat grey;
  cv::cvtColor(ViewAsMat(image), grey, cv::COLOR_RGB2GRAY);
  return CopyFromMat(grey);
}

Image CutOut(const Image& image, const PixelBox& box) {
  return CopyFromMat(ViewAsMat(image)(cv::Rect(box.x, box.y, box.width, box.height)));
}

Image MirrorImage(const Image& image) {
  if (image.empty()) return {};
  cv::Mat mirrored;
  cv::flip(ViewAsMat(image), mirrored, 1);
  return CopyFromMat(mirrored);
}

Image ResizeImage(const Image& image, int width, int height) {
  if (width < 1 || height < 1 || image.empty()) {
    throw Error(
        ErrorCode::kInvalidArgument, "bad_size",
        "Cannot scale an image to " + std::to_string(width) + " x " + std::to_string(height));
  }
  const bool larger = width > image.width && height > image.height;
  cv::Mat scaled;
  cv::resize(ViewAsMat(image), scaled, {width, height}, 0, 0,
             larger ? cv::INTER_CUBIC : cv::INTER_AREA);
  return CopyFromMat(scaled);
}

void PrepareForSandbox() {
  cv::setNumThreads(1);
  LoadHeifPlugins();
}

}  // namespace pliant
