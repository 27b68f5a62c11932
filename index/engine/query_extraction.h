// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How a search describes its query.
#pragma once

#include <algorithm>
#include <limits>

#include "descriptor/features/descriptor.h"
#include "descriptor/features/keypoints.h"

namespace pliant {

// From how the images of an index are described. The object may be a small part of the query: so
// twice as many keypoints, and as many again of the enlarged image.
inline ExtractionOptions QueryExtraction(ExtractionOptions indexed) {
  indexed.keypoints.max_keypoints = std::min(2 * indexed.keypoints.max_keypoints, kMaxKeypoints);
  indexed.enlarge_below = std::numeric_limits<int>::max();
  return indexed;
}

}  // namespace pliant
