// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The keypoints that the service looks for: SIFT's, and fainter ones. Worn, small and pale prints
// have few of SIFT's own.
#pragma once

#include <span>
#include <vector>

#include "descriptor/features/keypoints.h"

namespace pliant {

// As DetectKeypoints, with half of SIFT's threshold of contrast (0.02 in place of 0.04; Lowe 2004,
// section 4). Where that finds more than options.max_keypoints, the faint ones are those left out.
// On simulated pairs two thirds more keypoints are matched correctly; the share of them that is
// matched is smaller. Thread-safe.
std::vector<Keypoint> DetectFaintKeypoints(const Image& grey, const KeypointOptions& options = {});

// How much each keypoint counts where many of an image's show something else: 1 at SIFT's own
// threshold of contrast and above, below it the contrast's share of it, and 1 where the contrast is
// not known (response 0). A faint keypoint of a whole photograph is more often one of its
// background.
std::vector<float> ContrastWeights(std::span<const Keypoint> keypoints);

}  // namespace pliant
