// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/keypoints.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/features/sift.h"

namespace pliant {
namespace {

constexpr double kContrast = 0.04;  // OpenCV's default
constexpr double kLowContrast = 0.02;

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

}  // namespace

std::vector<Keypoint> DetectKeypoints(const Image& grey, const KeypointOptions& options,
                                      int threads) {
  CheckOptions(grey, options);
  return sift::Detect(grey, options, kContrast, threads);
}

std::vector<Keypoint> DetectLowContrastKeypoints(const Image& grey, const KeypointOptions& options,
                                                 int threads) {
  CheckOptions(grey, options);
  return sift::Detect(grey, options, kLowContrast, threads);
}

void KeepStrongAndSpread(std::size_t count, std::vector<Keypoint>* keypoints) {
  constexpr float kClearly = 0.9F;
  if (keypoints->size() <= count) return;
  const std::vector<Keypoint>& all = *keypoints;
  const std::size_t strongest = count / 2;
  std::vector<std::pair<float, std::size_t>> apart;  // squared, of the others
  for (std::size_t i = strongest; i < all.size(); ++i) {
    float nearest = std::numeric_limits<float>::infinity();
    for (std::size_t j = 0; j < i && kClearly * all[j].response > all[i].response; ++j) {
      const float dx = all[j].x - all[i].x;
      const float dy = all[j].y - all[i].y;
      nearest = std::min(nearest, dx * dx + dy * dy);
    }
    apart.emplace_back(-nearest, i);
  }
  std::sort(apart.begin(), apart.end());
  std::vector<std::size_t> kept(count);
  std::iota(kept.begin(), kept.end(), 0U);
  for (std::size_t i = strongest; i < count; ++i) kept[i] = apart[i - strongest].second;
  std::sort(kept.begin(), kept.end());
  std::vector<Keypoint> result;
  for (const std::size_t i : kept) result.push_back(all[i]);
  *keypoints = std::move(result);
}

std::vector<float> ContrastWeights(std::span<const Keypoint> keypoints) {
  constexpr auto kFull = static_cast<float>(kContrast / sift::kLayers);  // as OpenCV's responses
  std::vector<float> weights;
  weights.reserve(keypoints.size());
  for (const Keypoint& k : keypoints) {
    weights.push_back(k.response > 0 ? std::min(1.0F, k.response / kFull) : 1.0F);
  }
  return weights;
}

}  // namespace pliant
