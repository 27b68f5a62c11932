// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as a file, the format by its name:
//   .npz          NumPy's archive: arrays `keypoints` float32 N x 6 (x, y, size, angle, response,
//                 octave), `descriptors` float32 or uint8 N x D, and single values `width`,
//                 `height` (int64) and `model_id` (text). numpy.load(file)["keypoints"]
//   .safetensors  tensors `keypoints` and `descriptors` as above; metadata model_id, width, height
//                 (descriptor/base/safetensors.h)
#pragma once

#include <filesystem>

#include "descriptor/features/features.h"

namespace pliant::cli {

// Throws kInvalidArgument "bad_features_name" for another extension; to be called before the work
// whose result is written.
void CheckFeaturesName(const std::filesystem::path& path);

// Replaces the file in one step. Throws what CheckFeaturesName throws, and kNoSpace "write_failed".
void WriteFeatures(const std::filesystem::path& path, const Features& features);

}  // namespace pliant::cli
