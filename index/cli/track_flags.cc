// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/track_flags.h"

#include "index/usage/checks.h"

namespace pliant::cli {

void AddTrackingFlags(CLI::App& app, LocateOptions& locate) {
  VerificationOptions& verification = locate.verification;
  app.add_option("--iterations", verification.ransac.iterations,
                 "number of RANSAC samples per frame")
      ->capture_default_str()
      ->check(Between(1, 1'000'000));
  app.add_option("--max-ratio", verification.max_ratio,
                 "ratio test: keep a match if its distance is at most this times that of the "
                 "second nearest")
      ->capture_default_str();
  app.add_option("--tolerance", verification.tolerance,
                 "largest distance of a match from the warp, relative to the frame's longer side")
      ->capture_default_str();
  app.add_option("--regularization", verification.ransac.regularization,
                 "stiffness of the thin-plate spline; 0 = none")
      ->capture_default_str()
      ->check(AtLeast(0));
  app.add_option("--min-inliers", locate.min_inliers,
                 "with fewer inliers the object counts as lost")
      ->capture_default_str();
}

}  // namespace pliant::cli
