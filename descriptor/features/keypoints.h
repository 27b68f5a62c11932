// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// SIFT keypoint detection (Lowe 2004) through OpenCV.
#pragma once

#include <optional>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

inline constexpr int kMaxKeypoints = 4096;

struct KeypointOptions {
  int max_keypoints = 1024;  // strongest by response; 1 to kMaxKeypoints
  // SIFT repeats a keypoint once for each dominant orientation (about 17 % of them). Rotation-
  // invariant descriptors see the repeats as duplicates, so by default one per location is kept.
  bool keep_repeated_orientations = false;
  // Only keypoints in this part, in pixels of the image they are detected in.
  std::optional<Region> inside = {};
};

// Detects in a grey image. Order is deterministic: response descending, then y, x, size, angle.
// Throws kInvalidArgument for options out of range or an image that is not grey. Thread-safe.
std::vector<Keypoint> DetectKeypoints(const Image& grey, const KeypointOptions& options = {});

}  // namespace pliant
