// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as NumPy archives (index/files/features_npz.h). The path "-" is standard output.
#pragma once

#include <filesystem>
#include <vector>

#include "descriptor/features/features.h"
#include "index/cli/folder_features.h"

namespace pliant::cli {

// Throws kInvalidArgument "bad_features_name" unless the name ends in .npz, and kNoSpace
// "write_failed" for what CheckWritable refuses. Call it before the work.
void CheckFeaturesName(const std::filesystem::path& path);

// Both replace the file in one step and throw kNoSpace "write_failed".
void WriteFeatures(const std::filesystem::path& path, const Features& features);
// The same descriptor made all of them.
void WriteFolderFeatures(const std::filesystem::path& path,
                         const std::vector<FolderPicture>& pictures);

}  // namespace pliant::cli
