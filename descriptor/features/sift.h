// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// SIFT's detector (Lowe 2004): extrema of differences of Gaussians. It gives the keypoints of
// OpenCV's cv::SIFT up to rounding, in a third to a fifth of the time and a tenth of the memory.
#pragma once

#include <vector>

#include "descriptor/features/features.h"
#include "descriptor/features/keypoints.h"
#include "descriptor/image/image.h"

namespace pliant::sift {

inline constexpr int kLayers = 3;  // of an octave that can have keypoints

// Keypoints of a grey image, strongest first, then by y, x, size and angle, with up to `threads`
// threads (0 = all cores). Their number does not change the result. contrast: OpenCV's
// contrastThreshold. Needs 25 bytes of memory a pixel. Thread-safe.
std::vector<Keypoint> Detect(const Image& grey, const KeypointOptions& options, double contrast,
                             int threads);

}  // namespace pliant::sift
