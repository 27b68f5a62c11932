// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as arrays of a NumPy archive: `keypoints` float32 N x 6 (x, y, size, angle, response,
// octave), `descriptors` float32 or uint8 N x D, and `model_id` (text).
#pragma once

#include <string>
#include <vector>

#include "descriptor/features/features.h"
#include "index/files/npz_archive.h"

namespace pliant {

// N x 6, row-major.
std::vector<float> KeypointRows(const Features& features);

// Throws kTooLarge "archive_too_large" above 2 GiB.
void AddFeatures(NpzArchive& archive, const Features& features);

// The whole file of one picture, with the single values `width` and `height` (int64), pixels of the
// upright picture, beside.
std::string FeaturesNpz(const Features& features);

}  // namespace pliant
