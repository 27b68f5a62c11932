// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Why a picture is a hit, or was not confirmed as one: what verification saw.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "index/verify/verification.h"
#include "index/verify/warp_mesh.h"

namespace pliant {

struct PointPair {
  Vec2 query;      // pixels of the original upright query picture
  Vec2 reference;  // pixels of the original upright picture of the hit
};

struct Explanation {
  double ranking_score = 0;  // by words alone, before verification lifted it
  bool verified = false;
  std::string failure;             // a sentence that says why not; empty when verified
  int matches = 0;                 // tentative: mutual nearest neighbours within the ratio
  double inlier_fraction = 0;      // of the matches
  std::vector<PointPair> inliers;  // the matches that agree with the warp
  std::optional<Mesh> mesh;        // the warp, hit's picture -> query picture; when verified
  int reference_width = 0;         // of the hit's original upright picture; 0 = not looked at
  int reference_height = 0;
};

Explanation Explain(const Features& query, const Features& reference,
                    const VerificationResult& result);

}  // namespace pliant
