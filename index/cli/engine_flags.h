// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options that several subcommands share.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "index/engine/engine.h"
#include "index/verify/locate.h"

namespace pliant::cli {

// --db FILE, required.
void AddDatabaseFlag(CLI::App& app, EngineOptions& engine);
// An existing database, as it is. Its descriptor is made when it is needed, and the index with
// `with_index` at once.
Engine OpenExisting(EngineOptions options, bool read_only, bool with_index = false);
// --collection NAME
void AddCollectionFlag(CLI::App& app, std::string& collection);
// --originals-dir
CLI::Option* AddOriginalsFlag(CLI::App& app, EngineOptions& engine, const std::string& help);
// --json
void AddJsonFlag(CLI::App& app, bool& json);
// --jobs N; `what` the threads do, for the help: "threads, one scene each".
void AddJobsFlag(CLI::App& app, int& jobs, const std::string& what = "threads");
// --model FILE
void AddModelFlag(CLI::App& app, std::filesystem::path& model);
// --rank neighbours|histogram
void AddRankFlag(CLI::App& app, RankMethod& rank, const std::string& help);
// --csv FILE; empty = none, - = standard output.
void AddCsvFlag(CLI::App& app, std::filesystem::path& csv, const std::string& help);
// --filter JSON
void AddFilterFlag(CLI::App& app, std::string& filter, const std::string& help);
// --seed N
void AddSeedFlag(CLI::App& app, std::uint64_t& seed, const std::string& help);
// The ratio test of matching.
void AddRatioFlag(CLI::App& app, const std::string& name, float& ratio);

// --descriptor NAME, --model FILE, --max-keypoints N, --max-side PX: how images are described.
// `of_database`: by default as the database's other images.
void AddExtractionFlags(CLI::App& app, EngineOptions& engine, bool of_database = false);
// The descriptor that they name.
std::string DescriptorName(const EngineOptions& engine);
std::shared_ptr<const Descriptor> NamedDescriptor(const EngineOptions& engine);
// The same flags with several names, NAME,... (commands that compare descriptors).
void AddDescriptorListFlags(CLI::App& app, std::vector<std::string>& names,
                            DescriptorOptions& descriptor, ExtractionOptions& extraction);

// --features NAME=FOLDER, which can be repeated: rows of other programs (read_npz.h).
void AddFeaturesFlag(CLI::App& app, std::vector<std::string>& features);

// --every N, --iterations, --max-ratio, --tolerance, --regularization, --min-inliers: of `track`
// and `eval tracking`.
void AddTrackingFlags(CLI::App& app, int& every, LocateOptions& locate);

}  // namespace pliant::cli
