// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Locates an object in an image. The tracker uses this for every frame, the server for its
// requests. Verification as in retrieval, then a check whether the warp is plausible.
#pragma once

#include "descriptor/features/features.h"
#include "index/records/location.h"
#include "index/verify/verification.h"

namespace pliant {

// A stable word for programs ("few_matches"), and a sentence for people.
const char* ToString(LostReason reason);
const char* Describe(LostReason reason);

struct LocateOptions {
  // ransac.iterations is 1500, as in the paper (Potje et al. 2021, supplement: "Non-Rigid Object
  // Tracking"); ransac.regularization is the spline's.
  VerificationOptions verification;
  int min_inliers = 8;  // different objects have up to seven by chance
  // Smallest share of the object's area inside the inliers' convex hull.
  double min_patch = 0.02;
  // Largest share of the mesh among the inliers that mirrors or tears (real folds do).
  double max_folded = 0.15;
};

// `image` must be made from `image_features` with options.verification. Not found is no error.
// Throws what Verifier::Verify throws. Thread-safe.
Location Locate(const Verifier& image, const Features& image_features, const Features& object,
                const LocateOptions& options);

// Throws kInvalidArgument naming the field.
void Validate(const LocateOptions& options);

}  // namespace pliant
