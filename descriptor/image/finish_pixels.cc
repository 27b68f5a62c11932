// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/finish_pixels.h"

#include <utility>

#include <opencv2/imgproc.hpp>

#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

cv::Mat TurnUpright(cv::Mat pixels, int orientation) {
  switch (orientation) {
    case 2:
      cv::flip(pixels, pixels, 1);
      break;
    case 3:
      cv::rotate(pixels, pixels, cv::ROTATE_180);
      break;
    case 4:
      cv::flip(pixels, pixels, 0);
      break;
    case 5:
      cv::transpose(pixels, pixels);
      break;
    case 6:
      cv::rotate(pixels, pixels, cv::ROTATE_90_CLOCKWISE);
      break;
    case 7:
      cv::transpose(pixels, pixels);
      cv::rotate(pixels, pixels, cv::ROTATE_180);
      break;
    case 8:
      cv::rotate(pixels, pixels, cv::ROTATE_90_COUNTERCLOCKWISE);
      break;
    default:
      break;
  }
  return pixels;
}

}  // namespace

cv::Mat ComposeOnWhite(const cv::Mat& bgra) {
  cv::Mat bgr(bgra.size(), CV_8UC3);
  for (int y = 0; y < bgra.rows; ++y) {
    const auto* source = bgra.ptr<cv::Vec4b>(y);
    auto* target = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < bgra.cols; ++x) {
      const int alpha = source[x][3];
      for (int c = 0; c < 3; ++c) {
        target[x][c] =
            static_cast<std::uint8_t>((source[x][c] * alpha + 255 * (255 - alpha) + 127) / 255);
      }
    }
  }
  return bgr;
}

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

}  // namespace pliant
