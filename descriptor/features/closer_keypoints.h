// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Key points that a closer look at a picture finds: in more of its pixels than it is described with
// otherwise, or enlarged further. Prints that take up a fifth of a street photograph have many of
// theirs there.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "descriptor/features/enlarged_keypoints.h"
#include "descriptor/features/keypoints.h"

namespace pliant {

// The longer side, in pixels, at which a picture is looked at more closely than by its own key
// points and those of DetectEnlarged: three times `longer_side_px`, that of the original, but not
// beyond 1.5 times `max_side_px` (0 = 1024). Absent where that is not a quarter more.
std::optional<int> CloserSide(double longer_side_px, int max_side_px);

// Detects key points in `grey`, which shows the original scaled by `scale`, once it is `factor`
// (at least 1) times as large: the strongest options.max_keypoints of options.inside (in pixels of
// `grey`), without those that `known` has already.
// `known` and EnlargedKeypoints::placed are in pixels of the original. The picture comes in strips
// of the same size, which overlap, so that neither OpenCV's pyramid (230 bytes a pixel) nor what
// describes the strip takes more memory than for a picture of the usual size; a key point is
// listed with the strip whose middle it lies in. Thread-safe.
std::vector<EnlargedKeypoints> DetectCloser(const Image& grey, double scale,
                                            std::span<const Keypoint> known, double factor,
                                            const KeypointOptions& options);

}  // namespace pliant
