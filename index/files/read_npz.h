// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features from .npz files, as features_npz.h describes them: written by Pliant, by
// numpy.savez, or by numpy.savez_compressed.
#pragma once

#include <filesystem>
#include <string>

#include "descriptor/features/foreign_features.h"

namespace pliant {

// Of one image. Throws kNotFound for a missing file, kTooLarge above 256 MiB, kCorrupt
// "features_unreadable" for a damaged file or arrays of another type or shape; the message names
// the file and the array.
Features ReadFeaturesNpz(const std::filesystem::path& file);

// "NAME=FOLDER": the features of the image `root`/PATH are in FOLDER/PATH.npz, those of an image
// outside `root` in FOLDER/FILE.npz by its file name. Throws kInvalidArgument "features_invalid"
// for other text, and for a folder that does not exist.
FeatureSource ParseFeatureSource(const std::string& text, const std::filesystem::path& root);

}  // namespace pliant
