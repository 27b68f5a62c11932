// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Options that several subcommands share.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include <CLI/CLI.hpp>

#include "index/engine.h"

namespace pliant::cli {

// --db FILE (required) and --collection NAME.
void AddDatabaseFlags(CLI::App& app, EngineOptions& engine, std::string& collection);
// --descriptor NAME, --model FILE, --max-keypoints N, --max-side PX: how pictures are described.
void AddExtractionFlags(CLI::App& app, EngineOptions& engine);

// The whole file. Throws kNotFound when it cannot be read, kTooLarge above `max_bytes`.
std::vector<std::uint8_t> ReadFile(const std::filesystem::path& path, std::int64_t max_bytes);

}  // namespace pliant::cli
