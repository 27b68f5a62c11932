// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/enlarged_keypoints.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "descriptor/features/faint_keypoints.h"

namespace pliant {
namespace {

constexpr double kEnlargement = 2;
constexpr int kEnlargedSide = 1024;         // pixels, at most: a larger image is not a small one
constexpr double kLeastEnlargement = 1.25;  // below, nothing new comes to light

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

double EnlargementOf(double longer_side_px, int max_side_px) {
  const int side = max_side_px > 0 ? std::min(max_side_px, kEnlargedSide) : kEnlargedSide;
  const double factor = std::min(kEnlargement, side / longer_side_px);
  return factor < kLeastEnlargement ? 1 : factor;
}

EnlargedKeypoints WithoutKnown(Image image, double scale, int top, std::span<const Keypoint> found,
                               std::span<const Keypoint> known) {
  EnlargedKeypoints result;
  result.image = std::move(image);
  std::vector<Keypoint> placed(found.begin(), found.end());
  for (Keypoint& k : placed) k.y += static_cast<float>(top);
  ScaleToOriginal(placed, scale);
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

EnlargedKeypoints DetectEnlarged(const Image& grey, std::span<const Keypoint> known,
                                 int max_side_px, const KeypointOptions& options) {
  const double factor = EnlargementOf(std::max(grey.width, grey.height), max_side_px);
  if (factor == 1) return {};
  const auto scaled = [&](int side) { return static_cast<int>(std::lround(side * factor)); };
  Image image = ResizeImage(grey, scaled(grey.width), scaled(grey.height));
  KeypointOptions enlarged = options;
  if (options.inside) enlarged.inside = Scaled(*options.inside, factor);
  const auto found = DetectFaintKeypoints(image, enlarged);
  return WithoutKnown(std::move(image), factor, /*top=*/0, found, known);
}

}  // namespace pliant
