// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/enlarged_keypoints.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "descriptor/features/faint_keypoints.h"

namespace pliant {
namespace {

constexpr double kEnlargement = 2;
constexpr int kEnlargedSide = 1024;         // pixels, at most: a larger picture is not a small one
constexpr double kLeastEnlargement = 1.25;  // below, nothing new comes to light

// How much larger a picture of this size may be described again; 1 = not at all.
double EnlargementOf(const Image& image, int most) {
  const int longer = std::max(image.width, image.height);
  const int side = most > 0 ? std::min(most, kEnlargedSide) : kEnlargedSide;
  const double factor = std::min(kEnlargement, static_cast<double>(side) / longer);
  return factor < kLeastEnlargement ? 1 : factor;
}

bool IsTwin(const Keypoint& a, const Keypoint& b) {
  constexpr float kPlace = 0.25F;   // of the size
  constexpr float kOctaves = 1.2F;  // ratio of sizes
  const float size = std::min(a.size, b.size);
  return std::abs(a.x - b.x) < kPlace * size && std::abs(a.y - b.y) < kPlace * size &&
         a.size < kOctaves * b.size && b.size < kOctaves * a.size;
}

}  // namespace

void ScaleToOriginal(std::vector<Keypoint>& keypoints, double scale) {
  if (scale == 1.0) return;
  const auto inverse = static_cast<float>(1.0 / scale);
  for (Keypoint& k : keypoints) {
    k.x = (k.x + 0.5F) * inverse - 0.5F;
    k.y = (k.y + 0.5F) * inverse - 0.5F;
    k.size *= inverse;
  }
}

EnlargedKeypoints DetectEnlarged(const Image& grey, std::span<const Keypoint> known,
                                 int max_side_px, const KeypointOptions& options) {
  EnlargedKeypoints result;
  const double factor = EnlargementOf(grey, max_side_px);
  if (factor == 1) return result;
  const auto scaled = [&](int side) { return static_cast<int>(std::lround(side * factor)); };
  result.picture = ResizeImage(grey, scaled(grey.width), scaled(grey.height));
  const std::vector<Keypoint> found = DetectFaintKeypoints(result.picture, options);
  std::vector<Keypoint> placed = found;
  ScaleToOriginal(placed, factor);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Keypoint& place = placed[i];
    if (std::any_of(known.begin(), known.end(),
                    [&](const Keypoint& other) { return IsTwin(place, other); })) {
      continue;
    }
    result.inside.push_back(found[i]);
    result.placed.push_back(place);
  }
  return result;
}

}  // namespace pliant
