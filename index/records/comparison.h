// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Whether two images show the same object (Engine::Compare). Plain values.
#pragma once

#include <cstdint>
#include <vector>

#include "descriptor/features/descriptor.h"
#include "index/records/explanation.h"
#include "index/records/search.h"

namespace pliant {

struct ComparedImage {
  int width = 0;  // original, upright, in pixels
  int height = 0;
  std::uint32_t keypoints = 0;
};

struct Comparison {
  ComparedImage first;
  ComparedImage second;
  // As a search by the second explains a hit that is the first: the query is the second image,
  // the reference the first. ranking_score is kNoResemblance: there is nothing to rank among.
  Explanation explanation;
  std::vector<Point> outline;  // of the first's object, in the second image; empty: unknown
  // That both show the same object: what a search would say of a hit with these inliers that its
  // ranking gives no reason for (index/verify/verification.h, Probability).
  double probability = 0;
  ExtractionTimings timings;  // of both images
  double verify_ms = 0;

  bool found() const { return probability >= kFoundProbability; }
};

}  // namespace pliant
