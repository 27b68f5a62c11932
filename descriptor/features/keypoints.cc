// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/keypoints.h"

#include <algorithm>
#include <string>
#include <tuple>

#include <opencv2/features2d.hpp>

#include "descriptor/base/error.h"
#include "descriptor/image/cv_image.h"

namespace pliant {
namespace {

constexpr double kContrast = 0.04;  // OpenCV's default
constexpr double kLowContrast = 0.02;
constexpr int kLayersAnOctave = 3;

void CheckOptions(const Image& grey, const KeypointOptions& options) {
  if (grey.channels != 1 || grey.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "not_grey",
                "Keypoints are detected in grey images with at least one pixel");
  }
  if (options.max_keypoints < 1 || options.max_keypoints > kMaxKeypoints) {
    throw Error(ErrorCode::kInvalidArgument, "bad_max_keypoints",
                "max_keypoints is " + std::to_string(options.max_keypoints) + "; it must be 1 to " +
                    std::to_string(kMaxKeypoints));
  }
}

bool StrongerFirst(const Keypoint& a, const Keypoint& b) {
  return std::tuple(-a.response, a.y, a.x, a.size, a.angle) <
         std::tuple(-b.response, b.y, b.x, b.size, b.angle);
}

bool SamePlace(const Keypoint& a, const Keypoint& b) {
  return a.x == b.x && a.y == b.y && a.size == b.size;
}

std::vector<Keypoint> Detect(const Image& grey, const KeypointOptions& options, double contrast) {
  constexpr int kAll = 0;
  CheckOptions(grey, options);
  std::vector<cv::KeyPoint> detected;
  cv::SIFT::create(kAll, kLayersAnOctave, contrast)->detect(ViewAsMat(grey), detected);

  std::vector<Keypoint> keypoints;
  keypoints.reserve(detected.size());
  for (const cv::KeyPoint& k : detected) {
    if (options.inside && !Contains(*options.inside, k.pt.x, k.pt.y)) continue;
    keypoints.push_back({k.pt.x, k.pt.y, k.size, k.angle, k.response, k.octave});
  }
  std::sort(keypoints.begin(), keypoints.end(), StrongerFirst);
  if (!options.keep_repeated_orientations) {
    // Repeats have the same response and place, so the sort put them side by side.
    keypoints.erase(std::unique(keypoints.begin(), keypoints.end(), SamePlace), keypoints.end());
  }
  if (keypoints.size() > static_cast<std::size_t>(options.max_keypoints)) {
    keypoints.resize(options.max_keypoints);
  }
  return keypoints;
}

}  // namespace

std::vector<Keypoint> DetectKeypoints(const Image& grey, const KeypointOptions& options) {
  return Detect(grey, options, kContrast);
}

std::vector<Keypoint> DetectLowContrastKeypoints(const Image& grey,
                                                 const KeypointOptions& options) {
  return Detect(grey, options, kLowContrast);
}

std::vector<float> ContrastWeights(std::span<const Keypoint> keypoints) {
  constexpr auto kFull = static_cast<float>(kContrast / kLayersAnOctave);  // as OpenCV's responses
  std::vector<float> weights;
  weights.reserve(keypoints.size());
  for (const Keypoint& k : keypoints) {
    weights.push_back(k.response > 0 ? std::min(1.0F, k.response / kFull) : 1.0F);
  }
  return weights;
}

}  // namespace pliant
