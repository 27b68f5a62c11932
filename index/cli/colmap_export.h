// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant match --colmap`: all images of a folder matched with each other, for COLMAP.
#pragma once

#include <filesystem>
#include <vector>

#include "descriptor/match/matching.h"
#include "index/cli/output.h"
#include "index/engine/engine.h"

namespace pliant::cli {

struct ColmapExportOptions {
  std::vector<std::filesystem::path> inputs;  // one folder, or two or more images
  std::filesystem::path database;             // a new file
  std::filesystem::path pairs;                // two names a line; empty = every two images
  bool one_camera = false;
  bool verify = false;  // only matches that agree with a warp
  MatchOptions match;   // threads: of everything
  bool json = false;
};

// `engine`: what concerns extraction. Images that cannot be read are skipped and reported. Throws
// kInvalidArgument "too_few_images", "pairs_invalid", and what CreateColmapDatabase throws.
ExitStatus ExportToColmap(const EngineOptions& engine, const ColmapExportOptions& options);

}  // namespace pliant::cli
