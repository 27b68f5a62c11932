// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// SIFT keypoint detection (Lowe 2004).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/image/image.h"

namespace pliant {

inline constexpr int kMaxKeypoints = 4096;

struct KeypointOptions {
  int max_keypoints = 1024;  // strongest by response; 1 to kMaxKeypoints
  // SIFT repeats a keypoint for each further dominant orientation (about 17 %). To
  // rotation-invariant descriptors these are duplicates, so by default one per location is kept.
  bool keep_repeated_orientations = false;
  // Only keypoints in this part, in pixels of the image they are detected in.
  std::optional<Region> inside = {};
};

// Detects in a grey image with up to `threads` threads (0 = all cores). Their number does not
// change the result: response descending, then y, x, size, angle. Throws kInvalidArgument for
// options out of range or an image that is not grey. Thread-safe.
std::vector<Keypoint> DetectKeypoints(const Image& grey, const KeypointOptions& options = {},
                                      int threads = 1);

// As DetectKeypoints, with half of SIFT's contrast threshold (0.02 instead of 0.04; Lowe 2004,
// section 4). Worn, small and pale prints have few keypoints above SIFT's own threshold. Above
// options.max_keypoints, the low-contrast keypoints are omitted. On simulated pairs this matches
// two thirds more keypoints correctly, but a smaller share of them. Thread-safe.
std::vector<Keypoint> DetectLowContrastKeypoints(const Image& grey,
                                                 const KeypointOptions& options = {},
                                                 int threads = 1);

// Keeps `count` keypoints of a list that begins with the strongest: half of them are the strongest,
// the others are those farthest from clearly stronger ones (adaptive non-maximal suppression;
// Brown, Szeliski and Winder, CVPR 2005, with their 0.9). So a part of the image that is pale has
// some too. The order stays.
void KeepStrongAndSpread(std::size_t count, std::vector<Keypoint>* keypoints);

// Weight of each keypoint in an image that also shows other things. From SIFT's own contrast
// threshold up it is 1, below it contrast / threshold. It is 1 if the contrast is unknown (response
// 0). Low-contrast keypoints of a whole photo are more often part of its background.
std::vector<float> ContrastWeights(std::span<const Keypoint> keypoints);

}  // namespace pliant
