// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/independence.h"

#include <cstddef>
#include <numeric>

namespace pliant {
namespace {

bool AreNear(const Keypoint& a, const Keypoint& b, float radius) {
  const float x = a.x - b.x;
  const float y = a.y - b.y;
  return x * x + y * y <= radius * radius;
}

}  // namespace

double IndependentInliers(const Features& query, const Features& reference,
                          const std::vector<MatchedPair>& inliers, double query_radius,
                          double reference_radius) {
  const auto in_query = static_cast<float>(query_radius);
  const auto in_reference = static_cast<float>(reference_radius);
  std::vector<int> near(inliers.size(), 1);
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    const Keypoint& q = query.keypoints[inliers[i].query];
    const Keypoint& r = reference.keypoints[inliers[i].reference];
    for (std::size_t j = 0; j < i; ++j) {
      if (AreNear(q, query.keypoints[inliers[j].query], in_query) ||
          AreNear(r, reference.keypoints[inliers[j].reference], in_reference)) {
        ++near[i];
        ++near[j];
      }
    }
  }
  return std::accumulate(near.begin(), near.end(), 0.0,
                         [](double sum, int n) { return sum + 1.0 / n; });
}

}  // namespace pliant
