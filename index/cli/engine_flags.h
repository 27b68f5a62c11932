// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options that several subcommands share.
#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "index/engine/engine.h"
#include "index/files/image_files.h"
#include "index/verify/locate.h"

namespace pliant::cli {

// --db FILE, required.
void AddDatabaseFlag(CLI::App& app, EngineOptions& engine);
// --collection NAME
void AddCollectionFlag(CLI::App& app, std::string& collection);
// --descriptor NAME, --model FILE, --max-keypoints N, --max-side PX: how images are described.
void AddExtractionFlags(CLI::App& app, EngineOptions& engine);
// The same with several names, NAME,... (commands that compare descriptors).
void AddDescriptorListFlags(CLI::App& app, std::vector<std::string>& names,
                            DescriptorOptions& descriptor, ExtractionOptions& extraction);

// Options that `track` and `eval tracking` share.

// --iterations, --max-ratio, --tolerance, --regularization, --min-inliers.
void AddTrackingFlags(CLI::App& app, LocateOptions& locate);

}  // namespace pliant::cli
