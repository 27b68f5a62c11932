// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The images below a folder, described one after the other on all threads.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "index/cli/interrupt.h"
#include "index/engine/engine.h"
#include "index/files/image_files.h"
#include "index/json/json.h"

namespace pliant::cli {

struct FolderImage {
  std::filesystem::path path;
  std::string name;  // below the root, with slashes
  Features features;
  int exif_orientation = 1;
};

struct FolderFeatures {
  std::filesystem::path root;  // the folder, or what the named images' folders have in common
  std::vector<FolderImage> images;
  std::vector<SkippedFile> skipped;  // by name below the root
};

// Finds the images of a folder, or takes those that are named, in the order of their names. The
// simulator's NAME.uv.png are left out. Throws kNotFound for an input that does not exist.
FolderFeatures FindFolderImages(const std::vector<std::filesystem::path>& inputs);

// Describes them; images that cannot be described move to the skipped ones. `threads`: 0 = one
// per core, each with its own image. Ends early when interrupted. Throws for an invalid
// descriptor and when too many files are open.
void DescribeFolder(FolderFeatures& folder, const EngineOptions& engine, int threads,
                    const Interrupt& interrupt);

// "skipped a.png: ..." on standard error; [{"file", "code", "reason"}].
void ReportSkipped(const std::vector<SkippedFile>& skipped);
Json SkippedJson(const std::vector<SkippedFile>& skipped);

}  // namespace pliant::cli
