// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Between Image and cv::Mat. Internal to the descriptor library.
#pragma once

#include <opencv2/core.hpp>

#include "descriptor/image/image.h"

namespace pliant {

// A view that shares the pixels and must not outlive or change them.
inline cv::Mat ViewAsMat(const Image& image) {
  return {image.height, image.width, CV_8UC(image.channels),
          const_cast<std::uint8_t*>(image.pixels.data())};
}

inline Image CopyFromMat(const cv::Mat& pixels) {
  Image image{
      .width = pixels.cols, .height = pixels.rows, .channels = pixels.channels(), .pixels = {}};
  image.pixels.reserve(pixels.total() * pixels.elemSize());
  for (int y = 0; y < pixels.rows; ++y) {
    const std::uint8_t* row = pixels.ptr(y);
    image.pixels.insert(image.pixels.end(), row, row + pixels.cols * pixels.elemSize());
  }
  return image;
}

}  // namespace pliant
