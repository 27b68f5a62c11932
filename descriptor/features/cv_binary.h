// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adapters for OpenCV's ORB and BRISK, which drop key points near the border and return rows in
// an order of their own. Internal to the descriptor library.
#pragma once

#include <algorithm>
#include <cstring>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

// Adds `border` reflected pixels on each side.
inline cv::Mat WithBorder(const cv::Mat& picture, int border) {
  cv::Mat padded;
  cv::copyMakeBorder(picture, padded, border, border, border, border, cv::BORDER_REFLECT_101);
  return padded;
}

// The key point's position, clamped to the picture.
inline cv::Point2f PlaceInside(const Keypoint& keypoint, const Image& picture) {
  return {std::clamp(keypoint.x, 0.0F, static_cast<float>(picture.width - 1)),
          std::clamp(keypoint.y, 0.0F, static_cast<float>(picture.height - 1))};
}

// Copies row j of `described`, the descriptor of given[j], to row given[j].class_id of `result`.
inline void TakeRows(const cv::Mat& described, const std::vector<cv::KeyPoint>& given,
                     Descriptors& result) {
  const auto bytes = static_cast<std::size_t>(result.dim);
  for (std::size_t j = 0; j < given.size(); ++j) {
    std::memcpy(result.bytes.data() + static_cast<std::size_t>(given[j].class_id) * bytes,
                described.ptr(static_cast<int>(j)), bytes);
  }
}

}  // namespace pliant
