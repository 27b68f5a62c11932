// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The pictures below a folder, described one after the other on all threads.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "index/cli/interrupt.h"
#include "index/engine/engine.h"
#include "index/files/picture_files.h"
#include "index/json/json.h"

namespace pliant::cli {

struct FolderPicture {
  std::filesystem::path path;
  std::string name;  // below the root, with slashes
  Features features;
  int exif_orientation = 1;
};

struct FolderFeatures {
  std::filesystem::path root;  // the folder, or what the named pictures' folders have in common
  std::vector<FolderPicture> pictures;
  std::vector<SkippedFile> skipped;  // by name below the root
};

// Finds the pictures of a folder, or takes those that are named, in the order of their names. The
// simulator's NAME.uv.png are left out. Throws kNotFound for an input that does not exist.
FolderFeatures FindFolderPictures(const std::vector<std::filesystem::path>& inputs);

// Describes them; pictures that cannot be described move to the skipped ones. `threads`: 0 = one
// per core, each with its own picture. Ends early when interrupted. Throws for an invalid
// descriptor and when too many files are open.
void DescribeFolder(FolderFeatures& folder, const EngineOptions& engine, int threads,
                    const Interrupt& interrupt);

// "skipped a.png: ..." on standard error; [{"file", "code", "reason"}].
void ReportSkipped(const std::vector<SkippedFile>& skipped);
Json SkippedJson(const std::vector<SkippedFile>& skipped);

}  // namespace pliant::cli
