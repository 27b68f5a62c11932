// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keypoints of an image that is enlarged first. Small prints have few keypoints, and most of
// them are too fine for a detector that begins at the image's own size.
#pragma once

#include <span>
#include <vector>

#include "descriptor/features/keypoints.h"

namespace pliant {

struct EnlargedKeypoints {
  Image image;                   // grey; empty when the given one is too large to be enlarged
  std::vector<Keypoint> inside;  // in pixels of `image`, where they are described
  std::vector<Keypoint> placed;  // the same ones in pixels of the given image
};

// Enlarges `grey` to twice its size, but not beyond 1024 pixels or `max_side_px` (0 = no such
// limit) on the longer side, and detects keypoints there, at most options.max_keypoints. Leaves
// out those that `known` (in pixels of `grey`) has already: twins would spoil the ratio test of
// matching, in which the second nearest must be clearly farther away. Thread-safe.
EnlargedKeypoints DetectEnlarged(const Image& grey, std::span<const Keypoint> known,
                                 int max_side_px, const KeypointOptions& options);

// How much larger DetectEnlarged makes an image with this longer side; 1 = not at all.
double EnlargementOf(double longer_side_px, int max_side_px);

// Those of `found` in `image` that `known` has not; `image` shows what `known` and `placed` are
// in pixels of, scaled by `scale`, from `top` on (a row of its own pixels).
EnlargedKeypoints WithoutKnown(Image image, double scale, int top, std::span<const Keypoint> found,
                               std::span<const Keypoint> known);

// From pixels of an image scaled by `scale` to pixels of the original: centres are at integers.
void ScaleToOriginal(std::vector<Keypoint>& keypoints, double scale);

}  // namespace pliant
