// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What image.h has beside decoding.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/base/error.h"
#include "descriptor/image/cv_image.h"
#include "descriptor/image/image.h"

namespace pliant {
namespace {

std::vector<std::uint8_t> Encode(const Image& image, const char* extension,
                                 const std::vector<int>& parameters) {
  cv::Mat pixels = ViewAsMat(image);
  if (image.channels == 3) cv::cvtColor(pixels, pixels, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> encoded;
  if (!cv::imencode(extension, pixels, encoded, parameters)) {
    throw Error(ErrorCode::kInternal, "image_encode_failed", "An image could not be encoded");
  }
  return encoded;
}

}  // namespace

ScaledSize ScaleToFit(int width, int height, int max_side_px) {
  const int longer = std::max(width, height);
  if (max_side_px <= 0 || longer <= max_side_px) return {width, height, 1.0};
  const double scale = static_cast<double>(max_side_px) / longer;
  const auto scaled = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(side * scale)));
  };
  return {scaled(width), scaled(height), scale};
}

std::string MediaType(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return "image/jpeg";
    case ImageFormat::kPng:
      return "image/png";
    case ImageFormat::kWebp:
      return "image/webp";
    case ImageFormat::kBmp:
      return "image/bmp";
    case ImageFormat::kTiff:
      return "image/tiff";
    case ImageFormat::kUnknown:
      break;
  }
  return "application/octet-stream";
}

std::vector<std::uint8_t> EncodeJpeg(const Image& image, int quality) {
  return Encode(image, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

std::vector<std::uint8_t> EncodePng(const Image& image) { return Encode(image, ".png", {}); }

Image ToGrey(const Image& image) {
  if (image.channels == 1) return image;
  cv::Mat grey;
  cv::cvtColor(ViewAsMat(image), grey, cv::COLOR_RGB2GRAY);
  return CopyFromMat(grey);
}

Image CutOut(const Image& image, const PixelBox& box) {
  return CopyFromMat(ViewAsMat(image)(cv::Rect(box.x, box.y, box.width, box.height)));
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

}  // namespace pliant
