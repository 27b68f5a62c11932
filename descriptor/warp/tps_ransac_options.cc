// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What tps_ransac.h has beside the search for a warp.
#include <algorithm>
#include <cmath>
#include <string>

#include "descriptor/base/error.h"
#include "descriptor/warp/tps_ransac.h"

namespace pliant {

void Validate(std::span<const Correspondence> input, const TpsRansacOptions& options) {
  const auto require = [](bool holds, const char* field, const char* rule) {
    if (holds) return;
    throw Error(ErrorCode::kInvalidArgument, std::string("bad_") + field,
                std::string(field) + " must be " + rule + ".");
  };
  require(options.iterations >= 1, "iterations", "1 or more");
  require(options.tolerance_px > 0, "tolerance_px", "above 0");
  require(options.reference_tolerance_px >= 0, "reference_tolerance_px", "0 or more");
  require(options.least_tolerance_px >= 0, "least_tolerance_px", "0 or more");
  require(options.regularization >= 0, "regularization", "0 or more");
  require(options.max_anisotropy >= 1, "max_anisotropy", "1 or more");
  require(options.max_size_factor >= 1, "max_size_factor", "1 or more");
  require(options.min_inliers >= 4, "min_inliers", "4 or more: any three points make a map");
  for (const Correspondence& c : input) {
    require(std::isfinite(c.reference.x) && std::isfinite(c.reference.y) &&
                std::isfinite(c.query.x) && std::isfinite(c.query.y) && std::isfinite(c.size_ratio),
            "correspondences", "finite numbers");
  }
}

const char* ToString(TpsRansacFailure failure) {
  switch (failure) {
    case TpsRansacFailure::kNone:
      return "none";
    case TpsRansacFailure::kTooFew:
      return "too_few_matches";
    case TpsRansacFailure::kNoAgreement:
      return "no_agreement";
    case TpsRansacFailure::kDegenerate:
      return "degenerate";
    case TpsRansacFailure::kFolded:
      return "folded";
  }
  return "unknown";
}

double ToleranceAt(const TpsRansacOptions& options, double determinant) {
  if (options.reference_tolerance_px == 0) return options.tolerance_px;
  const double shrunk = options.reference_tolerance_px * std::sqrt(std::max(0.0, determinant));
  return std::min(options.tolerance_px, std::max(options.least_tolerance_px, shrunk));
}

}  // namespace pliant
